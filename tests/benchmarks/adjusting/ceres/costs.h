// The residuals of an adjustment by eq. (14), in units of their standard deviations.
//
// Angles are omega, phi, kappa: R = Rx(omega) Ry(phi) Rz(kappa) takes camera to body axes, or body
// to mapping axes. Distortion is a function of the measured point, eqs (7)-(11).
#pragma once

#include <cmath>

#include "ceres/ceres.h"
#include "ceres/rotation.h"
#include "problem.h"

// R^T d
template <typename T>
void IntoAxes(const T* opk, const T* d, T* out) {
  using std::cos;
  using std::sin;
  const T so = sin(opk[0]), co = cos(opk[0]);
  const T sp = sin(opk[1]), cp = cos(opk[1]);
  const T sk = sin(opk[2]), ck = cos(opk[2]);
  const T y = co * d[1] + so * d[2], z = co * d[2] - so * d[1];
  const T x = cp * d[0] - sp * z;
  out[0] = ck * x + sk * y;
  out[1] = ck * y - sk * x;
  out[2] = sp * d[0] + cp * z;
}

// R, row by row
template <typename T>
void Rotation(const T* opk, T* R) {
  for (int row = 0; row < 3; ++row) {
    const T unit[3] = {T(row == 0), T(row == 1), T(row == 2)};
    IntoAxes(opk, unit, R + 3 * row);
  }
}

// The coefficients of distortion as parameters belong to radii in units of so many mm: in mm^-6 k3
// would be so small that Ceres takes the covariance matrix for singular.
constexpr double kRadius = 50;
constexpr double kPerRadius2 = 1 / (kRadius * kRadius);
constexpr std::array<double, 8> kUnits = {
    1, 1, 1, kPerRadius2, kPerRadius2* kPerRadius2, kPerRadius2* kPerRadius2* kPerRadius2,
    1 / kRadius, 1 / kRadius};

// A measured image point. Parameters: f, xp, yp, k1, k2, k3, p1, p2 | boresight | lever arm |
// position and attitude of the body | object point.
class ImagePoint {
 public:
  ImagePoint(const Problem& p, int64_t ray)
      : x_((p.colrow[ray][0] - 0.5 * (p.width_px - 1)) * p.pixel_mm),
        y_((0.5 * (p.height_px - 1) - p.colrow[ray][1]) * p.pixel_mm),
        weight_(1 / (p.pixel_mm * p.sigma_px[ray])) {}

  template <typename T>
  bool operator()(const T* interior, const T* boresight, const T* lever, const T* position,
                  const T* attitude, const T* point, T* v) const {
    T d[3], b[3], c[3];
    for (int i = 0; i < 3; ++i) d[i] = point[i] - position[i];
    IntoAxes(attitude, d, b);
    for (int i = 0; i < 3; ++i) b[i] -= lever[i];
    IntoAxes(boresight, b, c);
    const T x = x_ - interior[1], y = y_ - interior[2];
    const T p1 = interior[6] * kUnits[6], p2 = interior[7] * kUnits[7];
    const T r2 = x * x + y * y;
    const T q = kPerRadius2 * r2;
    const T radial = 1.0 - q * (interior[3] + q * (interior[4] + q * interior[5]));
    const T corrected_x = x * radial - p1 * (r2 + 2.0 * x * x) - 2.0 * p2 * x * y;
    const T corrected_y = y * radial - p2 * (r2 + 2.0 * y * y) - 2.0 * p1 * x * y;
    const T scale = -interior[0] / c[2];
    v[0] = weight_ * (scale * c[0] - corrected_x);
    v[1] = weight_ * (corrected_y - scale * c[1]);  // rows count downwards
    return true;
  }

 protected:
  double x_, y_, weight_;  // mm, mm, 1/mm
};

// The same with derivatives written by hand.
class ImagePointByHand : public ceres::SizedCostFunction<2, 8, 3, 3, 3, 3, 3>, private ImagePoint {
 public:
  using ImagePoint::ImagePoint;

  bool Evaluate(double const* const* q, double* v, double** J) const override {
    double A[9], B[9], d[3], b[3], c[3];
    Rotation(q[4], A);  // body to mapping
    Rotation(q[1], B);  // camera to body
    for (int i = 0; i < 3; ++i) d[i] = q[5][i] - q[3][i];
    for (int i = 0; i < 3; ++i)
      b[i] = A[i] * d[0] + A[3 + i] * d[1] + A[6 + i] * d[2];
    const double arm[3] = {b[0] - q[2][0], b[1] - q[2][1], b[2] - q[2][2]};
    for (int i = 0; i < 3; ++i)
      c[i] = B[i] * arm[0] + B[3 + i] * arm[1] + B[6 + i] * arm[2];

    const double f = q[0][0], p1 = q[0][6] * kUnits[6], p2 = q[0][7] * kUnits[7];
    const double *k = q[0] + 3;
    const double x = x_ - q[0][1], y = y_ - q[0][2], r2 = x * x + y * y;
    const double s = kPerRadius2 * r2;
    const double radial = 1 - s * (k[0] + s * (k[1] + s * k[2]));
    const double u = c[0] / c[2], w = c[1] / c[2];
    const double sign[2] = {weight_, -weight_};
    v[0] = sign[0] * (-f * u - x * radial + p1 * (r2 + 2 * x * x) + 2 * p2 * x * y);
    v[1] = sign[1] * (-f * w - y * radial + p2 * (r2 + 2 * y * y) + 2 * p1 * x * y);
    if (J == nullptr) return true;

    if (J[0] != nullptr) {
      const double slope = 2 * kPerRadius2 * (k[0] + s * (2 * k[1] + 3 * s * k[2]));
      const double cross = -x * y * slope - 2 * p1 * y - 2 * p2 * x;
      const double by_xp[2] = {radial - x * x * slope - 6 * p1 * x - 2 * p2 * y, cross};
      const double by_yp[2] = {cross, radial - y * y * slope - 6 * p2 * y - 2 * p1 * x};
      const double xy[2] = {x, y}, ray[2] = {u, w};
      for (int i = 0; i < 2; ++i) {
        double* row = J[0] + 8 * i;
        row[0] = -sign[i] * ray[i];
        row[1] = sign[i] * by_xp[i];
        row[2] = sign[i] * by_yp[i];
        row[3] = sign[i] * xy[i] * s;
        row[4] = row[3] * s;
        row[5] = row[4] * s;
        row[6 + i] = sign[i] * kUnits[6] * (r2 + 2 * xy[i] * xy[i]);
        row[7 - i] = sign[i] * kUnits[6] * 2 * x * y;
      }
    }
    for (int i = 0; i < 2; ++i) {
      // by camera, body and mapping axes
      double by_c[3] = {0, 0, 0}, by_b[3], by_m[3];
      by_c[i] = -sign[i] * f / c[2];
      by_c[2] = sign[i] * f * (i == 0 ? u : w) / c[2];
      for (int j = 0; j < 3; ++j)
        by_b[j] = B[3 * j] * by_c[0] + B[3 * j + 1] * by_c[1] + B[3 * j + 2] * by_c[2];
      for (int j = 0; j < 3; ++j)
        by_m[j] = A[3 * j] * by_b[0] + A[3 * j + 1] * by_b[1] + A[3 * j + 2] * by_b[2];
      if (J[1] != nullptr) ByAngles(B, q[1][2], by_c, c, J[1] + 3 * i);
      if (J[4] != nullptr) ByAngles(A, q[4][2], by_b, b, J[4] + 3 * i);
      for (int j = 0; j < 3; ++j) {
        if (J[2] != nullptr) J[2][3 * i + j] = -by_b[j];
        if (J[3] != nullptr) J[3][3 * i + j] = -by_m[j];
        if (J[5] != nullptr) J[5][3 * i + j] = by_m[j];
      }
    }
    return true;
  }

 private:
  // A small rotation about an axis a of the turned frame moves x by x cross a, and g.(x cross a) is
  // a.(g cross x). The axes of omega, phi, kappa: the first row of R, (sin kappa, cos kappa, 0) and
  // (0, 0, 1).
  static void ByAngles(const double* R, double kappa, const double* g, const double* x,
                       double* out) {
    const double t[3] = {g[1] * x[2] - g[2] * x[1], g[2] * x[0] - g[0] * x[2],
                         g[0] * x[1] - g[1] * x[0]};
    out[0] = R[0] * t[0] + R[1] * t[1] + R[2] * t[2];
    out[1] = std::sin(kappa) * t[0] + std::cos(kappa) * t[1];
    out[2] = t[2];
  }
};

inline double Weight(double sigma) { return std::isinf(sigma) ? 0.0 : 1 / sigma; }

// An observed place, along the axes of its grid.
struct Place {
  Mat3 R_g_m;
  Vec3 observed;
  Vec3 sigma;

  template <typename T>
  bool operator()(const T* x, T* v) const {
    for (int i = 0; i < 3; ++i) {
      v[i] = T(0);
      for (int j = 0; j < 3; ++j) v[i] += R_g_m[3 * i + j] * (x[j] - observed[j]);
      v[i] *= Weight(sigma[i]);
    }
    return true;
  }
};

// An observed attitude, about the body's axes: log(R_observed^T R).
struct Attitude {
  Mat3 R_m_b;
  Vec3 sigma;

  template <typename T>
  bool operator()(const T* opk, T* v) const {
    T R[9], apart[9];
    Rotation(opk, R);
    for (int i = 0; i < 3; ++i) {
      for (int j = 0; j < 3; ++j) {
        apart[3 * i + j] = R_m_b[i] * R[j] + R_m_b[3 + i] * R[3 + j] + R_m_b[6 + i] * R[6 + j];
      }
    }
    ceres::RotationMatrixToAngleAxis(ceres::RowMajorAdapter3x3(static_cast<const T*>(apart)), v);
    for (int i = 0; i < 3; ++i) v[i] *= Weight(sigma[i]);
    return true;
  }
};
