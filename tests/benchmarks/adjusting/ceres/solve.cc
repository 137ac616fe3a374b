// Solve a problem file with Ceres and write what it took as JSON:
//   solve PROBLEM automatic|analytic dense|sparse THREADS TOLERANCE [covariance]

#include <sys/resource.h>

#include <chrono>
#include <cstdio>
#include <cstring>
#include <fstream>
#include <iostream>

#include "costs.h"

struct Unknowns {
  std::array<double, 8> interior;
  Vec3 boresight, lever;
  std::vector<Vec3> position, attitude, point;
};

Vec3 Angles(const Mat3& R) {
  return {std::atan2(-R[5], R[8]), std::atan2(R[2], std::hypot(R[5], R[8])),
          std::atan2(-R[1], R[0])};
}

Unknowns Start(const Problem& p) {
  Unknowns u;
  for (int i = 0; i < 8; ++i) u.interior[i] = p.interior[i] / kUnits[i];
  u.boresight = Angles(p.R_b_c);
  u.lever = p.r_b_c;
  u.position = p.r_m_b;
  for (const Mat3& R : p.R_m_b) u.attitude.push_back(Angles(R));
  u.point = p.x_m;
  return u;
}

void AddImagePoints(const Problem& p, bool automatic, Unknowns* u, ceres::Problem* out) {
  for (size_t ray = 0; ray < p.pose.size(); ++ray) {
    ceres::CostFunction* cost;
    if (automatic) {
      cost = new ceres::AutoDiffCostFunction<ImagePoint, 2, 8, 3, 3, 3, 3, 3>(
          new ImagePoint(p, ray));
    } else {
      cost = new ImagePointByHand(p, ray);
    }
    out->AddResidualBlock(cost, nullptr, u->interior.data(), u->boresight.data(), u->lever.data(),
                          u->position[p.pose[ray]].data(), u->attitude[p.pose[ray]].data(),
                          u->point[p.point[ray]].data());
  }
}

void AddPlace(const Place& place, double* x, ceres::Problem* out) {
  auto* cost = new ceres::AutoDiffCostFunction<Place, 3, 3>(new Place(place));
  out->AddResidualBlock(cost, nullptr, x);
}

void AddOthers(const Problem& p, Unknowns* u, ceres::Problem* out) {
  for (size_t i = 0; i < p.control_point.size(); ++i) {
    double* x = u->point[p.control_point[i]].data();
    if (p.control_sigma[i] == Vec3{0, 0, 0}) {
      out->SetParameterBlockConstant(x);
    } else {
      AddPlace({p.control_R_g_m[i], p.control_x_m[i], p.control_sigma[i]}, x, out);
    }
  }
  for (size_t i = 0; i < p.r_m_b.size(); ++i) {
    AddPlace({p.R_g_m[i], p.r_m_b[i], p.sigma_position[i]}, u->position[i].data(), out);
    auto* attitude = new Attitude{p.R_m_b[i], p.sigma_attitude[i]};
    out->AddResidualBlock(new ceres::AutoDiffCostFunction<Attitude, 3, 3>(attitude), nullptr,
                          u->attitude[i].data());
  }
}

ceres::Solver::Options Options(bool dense, int threads, double tolerance, Unknowns* u) {
  ceres::Solver::Options options;
  options.linear_solver_type = dense ? ceres::DENSE_SCHUR : ceres::SPARSE_SCHUR;
  options.num_threads = threads;
  options.max_num_iterations = 100;
  options.initial_trust_region_radius = 1e12;  // Gauss-Newton from the first step
  options.function_tolerance = tolerance;
  options.gradient_tolerance = 1e-30;  // the change of cost alone decides
  options.parameter_tolerance = 1e-30;
  auto* order = new ceres::ParameterBlockOrdering;
  for (Vec3& x : u->point) order->AddElementToGroup(x.data(), 0);
  for (double* x : {u->interior.data(), u->boresight.data(), u->lever.data()})
    order->AddElementToGroup(x, 1);
  for (size_t i = 0; i < u->position.size(); ++i) {
    order->AddElementToGroup(u->position[i].data(), 1);
    order->AddElementToGroup(u->attitude[i].data(), 1);
  }
  options.linear_solver_ordering.reset(order);
  return options;
}

struct Clock {
  double wall, cpu;
};

Clock Now() {
  rusage used;
  getrusage(RUSAGE_SELF, &used);
  const auto seconds = [](const timeval& t) { return t.tv_sec + 1e-6 * t.tv_usec; };
  const auto since = std::chrono::steady_clock::now().time_since_epoch();
  return {std::chrono::duration<double>(since).count(),
          seconds(used.ru_utime) + seconds(used.ru_stime)};
}

// Of this program alone: ru_maxrss would count what the process was before it became this program.
double PeakMegabytes() {
  std::ifstream status("/proc/self/status");
  for (std::string line; std::getline(status, line);) {
    if (line.rfind("VmHWM:", 0) == 0) return std::stod(line.substr(6)) / 1024;
  }
  return -1;
}

void Write(const char* name, const double* values, size_t n) {
  std::printf(",\n \"%s\": [", name);
  for (size_t i = 0; i < n; ++i) std::printf(i ? ", %.17g" : "%.17g", values[i]);
  std::printf("]");
}

// The covariance matrix of interior orientation, boresight and lever arm; writes sigma.
bool WriteCovariance(Unknowns* u, int threads, ceres::Problem* problem) {
  const std::vector<double*> blocks = {u->interior.data(), u->boresight.data(), u->lever.data()};
  const std::vector<const double*> wanted(blocks.begin(), blocks.end());
  ceres::Covariance::Options options;
  options.num_threads = threads;
  ceres::Covariance covariance(options);
  const Clock before = Now();
  const bool found = covariance.Compute(wanted, problem);
  const Clock after = Now();
  std::vector<double> cov(14 * 14), sigma(14);
  if (!found || !covariance.GetCovarianceMatrix(wanted, cov.data())) return false;
  for (int i = 0; i < 14; ++i) sigma[i] = std::sqrt(cov[15 * i]) * (i < 8 ? kUnits[i] : 1);
  Write("sigma", sigma.data(), sigma.size());
  std::printf(",\n \"covariance_wall_s\": %.6f, \"covariance_cpu_s\": %.6f",
              after.wall - before.wall, after.cpu - before.cpu);
  return true;
}

int main(int argc, char** argv) {
  google::InitGoogleLogging(argv[0]);
  if (argc < 6) {
    std::cerr << "solve PROBLEM automatic|analytic dense|sparse THREADS TOLERANCE [covariance]\n";
    return 2;
  }
  const int threads = std::atoi(argv[4]);
  Unknowns u;
  ceres::Problem problem;
  {
    const Problem read = ReadProblem(argv[1]);
    u = Start(read);
    AddImagePoints(read, std::strcmp(argv[2], "automatic") == 0, &u, &problem);
    AddOthers(read, &u, &problem);
  }
  const auto options = Options(std::strcmp(argv[3], "dense") == 0, threads, std::atof(argv[5]), &u);
  ceres::Solver::Summary summary;
  const Clock before = Now();
  ceres::Solve(options, &problem, &summary);
  const Clock after = Now();
  const double peak = PeakMegabytes();
  std::printf("{\"start_cost\": %.17g, \"cost\": %.17g, \"steps\": %d, \"converged\": %s,\n",
              2 * summary.initial_cost, 2 * summary.final_cost,
              summary.num_linear_solves,
              summary.termination_type == ceres::CONVERGENCE ? "true" : "false");
  std::printf(" \"wall_s\": %.6f, \"cpu_s\": %.6f, \"peak_mb\": %.3f", after.wall - before.wall,
              after.cpu - before.cpu, peak);
  auto interior = u.interior;
  for (int i = 0; i < 8; ++i) interior[i] *= kUnits[i];
  Write("interior", interior.data(), 8);
  Write("boresight_opk", u.boresight.data(), 3);
  Write("lever", u.lever.data(), 3);
  Write("position", u.position[0].data(), 3 * u.position.size());
  Write("attitude_opk", u.attitude[0].data(), 3 * u.attitude.size());
  const bool wanted = argc > 6;
  if (wanted && !WriteCovariance(&u, threads, &problem)) {
    std::cerr << "no covariance matrix: the Jacobian is rank deficient\n";
    return 1;
  }
  if (wanted) std::printf(",\n \"covariance_peak_mb\": %.3f", PeakMegabytes());
  std::printf("}\n");
  return summary.IsSolutionUsable() ? 0 : 1;
}
