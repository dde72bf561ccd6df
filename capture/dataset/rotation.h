// The little rotation algebra that reading reference trajectories takes. Quaternions are x y z w, matrices row-major.
// reentrant.
#pragma once

#include <array>

namespace haustra::capture::internal {

using Quaternion = std::array<double, 4>;
using Vector3 = std::array<double, 3>;
using Matrix3 = std::array<double, 9>;

double Norm(const Quaternion& q);
Quaternion Normalized(const Quaternion& q);
// c_from_a = c_from_b * b_from_a.
Quaternion Multiply(const Quaternion& c_from_b, const Quaternion& b_from_a);
Vector3 Rotate(const Quaternion& b_from_a, const Vector3& in_a);
// Largest deviation of R^T R from the identity, or 2 when R mirrors.
double RotationError(const Matrix3& r);
// Of a matrix that is a rotation up to rounding (Shepperd 1978).
Quaternion FromMatrix(const Matrix3& r);

}  // namespace haustra::capture::internal
