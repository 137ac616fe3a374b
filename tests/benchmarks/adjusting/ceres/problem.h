// The problem file that tests/benchmarks/adjusting/problem_file.py writes, in its order.
#pragma once

#include <array>
#include <cstdint>
#include <fstream>
#include <stdexcept>
#include <string>
#include <vector>

using Vec3 = std::array<double, 3>;
using Mat3 = std::array<double, 9>;  // row by row

struct Problem {
  double width_px, height_px, pixel_mm;
  std::array<double, 10> interior;  // f, xp, yp, k1, k2, k3, p1, p2, b1, b2
  Mat3 R_b_c;
  Vec3 r_b_c;
  std::vector<Mat3> R_m_b, R_g_m;
  std::vector<Vec3> r_m_b, sigma_position, sigma_attitude;
  std::vector<Vec3> x_m;
  std::vector<int32_t> control_point;
  std::vector<Vec3> control_x_m, control_sigma;
  std::vector<Mat3> control_R_g_m;
  std::vector<int32_t> pose, point;
  std::vector<std::array<double, 2>> colrow;
  std::vector<double> sigma_px;
};

class Reader {
 public:
  explicit Reader(const std::string& path) : in_(path, std::ios::binary) {}

  template <typename T>
  void Value(T* value) { Bytes(value, sizeof(T)); }

  template <typename T>
  void Values(std::vector<T>* values, int64_t n) {
    values->resize(n);
    Bytes(values->data(), n * sizeof(T));
  }

 private:
  void Bytes(void* to, int64_t n) {
    in_.read(static_cast<char*>(to), n);
    if (!in_) throw std::runtime_error("the problem file is missing or too short");
  }

  std::ifstream in_;
};

inline Problem ReadProblem(const std::string& path) {
  Reader in(path);
  std::array<int64_t, 4> counts;
  in.Value(&counts);
  const auto [n_poses, n_points, n_control, n_rays] = counts;
  Problem p;
  in.Value(&p.width_px);
  in.Value(&p.height_px);
  in.Value(&p.pixel_mm);
  in.Value(&p.interior);
  in.Value(&p.R_b_c);
  in.Value(&p.r_b_c);
  in.Values(&p.R_m_b, n_poses);
  in.Values(&p.r_m_b, n_poses);
  in.Values(&p.R_g_m, n_poses);
  in.Values(&p.sigma_position, n_poses);
  in.Values(&p.sigma_attitude, n_poses);
  in.Values(&p.x_m, n_points);
  in.Values(&p.control_point, n_control);
  in.Values(&p.control_x_m, n_control);
  in.Values(&p.control_R_g_m, n_control);
  in.Values(&p.control_sigma, n_control);
  in.Values(&p.pose, n_rays);
  in.Values(&p.point, n_rays);
  in.Values(&p.colrow, n_rays);
  in.Values(&p.sigma_px, n_rays);
  return p;
}
