#include "capture/dataset/rotation.h"

#include <algorithm>
#include <cmath>

namespace haustra::capture::internal {

double Norm(const Quaternion& q) { return std::sqrt(q[0] * q[0] + q[1] * q[1] + q[2] * q[2] + q[3] * q[3]); }

Quaternion Normalized(const Quaternion& q) {
  const double norm = Norm(q);
  return {q[0] / norm, q[1] / norm, q[2] / norm, q[3] / norm};
}

Quaternion Multiply(const Quaternion& a, const Quaternion& b) {
  return {a[3] * b[0] + a[0] * b[3] + a[1] * b[2] - a[2] * b[1], a[3] * b[1] - a[0] * b[2] + a[1] * b[3] + a[2] * b[0],
          a[3] * b[2] + a[0] * b[1] - a[1] * b[0] + a[2] * b[3], a[3] * b[3] - a[0] * b[0] - a[1] * b[1] - a[2] * b[2]};
}

Vector3 Rotate(const Quaternion& q, const Vector3& v) {
  const Quaternion rotated = Multiply(Multiply(q, {v[0], v[1], v[2], 0.0}), {-q[0], -q[1], -q[2], q[3]});
  return {rotated[0], rotated[1], rotated[2]};
}

double RotationError(const Matrix3& r) {
  double error = 0.0;
  for (int i = 0; i < 3; ++i) {
    for (int j = 0; j < 3; ++j) {
      const double dot = r[i] * r[j] + r[3 + i] * r[3 + j] + r[6 + i] * r[6 + j];
      error = std::max(error, std::abs(dot - (i == j ? 1.0 : 0.0)));
    }
  }
  const double determinant =
      r[0] * (r[4] * r[8] - r[5] * r[7]) - r[1] * (r[3] * r[8] - r[5] * r[6]) + r[2] * (r[3] * r[7] - r[4] * r[6]);
  return determinant > 0.0 ? error : 2.0;
}

Quaternion FromMatrix(const Matrix3& r) {
  // Starts from the largest of the four squared components, so the division is never by a small number.
  const double trace = r[0] + r[4] + r[8];
  const std::array<double, 4> squares = {r[0], r[4], r[8], trace};
  const auto largest = std::max_element(squares.begin(), squares.end()) - squares.begin();
  Quaternion q;
  if (largest == 3) {
    q = {r[7] - r[5], r[2] - r[6], r[3] - r[1], 1.0 + trace};
  } else if (largest == 0) {
    q = {1.0 + r[0] - r[4] - r[8], r[1] + r[3], r[2] + r[6], r[7] - r[5]};
  } else if (largest == 1) {
    q = {r[1] + r[3], 1.0 - r[0] + r[4] - r[8], r[5] + r[7], r[2] - r[6]};
  } else {
    q = {r[2] + r[6], r[5] + r[7], 1.0 - r[0] - r[4] + r[8], r[3] - r[1]};
  }
  q = Normalized(q);
  if (q[3] < 0.0) q = {-q[0], -q[1], -q[2], -q[3]};
  return q;
}

}  // namespace haustra::capture::internal
