#include "engine/geometry/five_point.h"

#include <Eigen/Geometry>
#include <cmath>
#include <utility>

#include "engine/geometry/polynomial_roots.h"

namespace haustra {
namespace {

using Vector9d = Eigen::Matrix<double, 9, 1>;

// Polynomials in (x, y, z) of degree one, two and three over these monomials; the cubic order puts first the ten that
// the elimination removes, and last those of (xz^2, xz, x), (yz^2, yz, y), (z^3 .. 1).
using Linear = std::array<double, 4>;      // x y z 1
using Quadratic = std::array<double, 10>;  // xx xy xz x yy yz y zz z 1
using Cubic = std::array<double, 20>;      // xxx yyy xxy xyy xxz xx yyz yy xyz xy | xzz xz x yzz yz y zzz zz z 1

constexpr int kQuadraticIndex[4][4] = {{0, 1, 2, 3}, {1, 4, 5, 6}, {2, 5, 7, 8}, {3, 6, 8, 9}};
constexpr int kCubicIndex[10][4] = {
    {0, 2, 4, 5},      // xx * (x y z 1)
    {2, 3, 8, 9},      // xy
    {4, 8, 10, 11},    // xz
    {5, 9, 11, 12},    // x
    {3, 1, 6, 7},      // yy
    {8, 6, 13, 14},    // yz
    {9, 7, 14, 15},    // y
    {10, 13, 16, 17},  // zz
    {11, 14, 17, 18},  // z
    {12, 15, 18, 19},  // 1
};

void AddProduct(const Linear& a, const Linear& b, double sign, Quadratic* out) {
  for (int i = 0; i < 4; ++i) {
    for (int j = 0; j < 4; ++j) (*out)[kQuadraticIndex[i][j]] += sign * a[i] * b[j];
  }
}

void AddProduct(const Quadratic& a, const Linear& b, double sign, Cubic* out) {
  for (int i = 0; i < 10; ++i) {
    for (int j = 0; j < 4; ++j) (*out)[kCubicIndex[i][j]] += sign * a[i] * b[j];
  }
}

// Removes from v its components along the first `count` columns, twice, so that rounding does not leave any.
void Orthogonalize(const Eigen::Matrix<double, 9, 9>& basis, int count, Vector9d* v) {
  for (int pass = 0; pass < 2; ++pass) {
    for (int i = 0; i < count; ++i) *v -= basis.col(i).dot(*v) * basis.col(i);
  }
}

// Orthonormal basis of the essential matrices (row-major) that all five pairs allow; false when there are more than
// four.
bool NullSpace(std::span<const Eigen::Vector3d, 5> bearings_a, std::span<const Eigen::Vector3d, 5> bearings_b,
               std::array<Vector9d, 4>* null_space) {
  Eigen::Matrix<double, 9, 9> basis;
  for (int i = 0; i < 5; ++i) {
    Vector9d row;
    for (int r = 0; r < 3; ++r) row.segment<3>(3 * r) = bearings_b[i][r] * bearings_a[i];
    Orthogonalize(basis, i, &row);
    const double norm = row.norm();
    if (!(norm > 1e-9)) return false;
    basis.col(i) = row / norm;
  }
  for (int k = 5; k < 9; ++k) {
    // The unit vector that lies farthest outside of what is spanned already.
    int axis = 0;
    basis.leftCols(k).rowwise().squaredNorm().minCoeff(&axis);
    Vector9d v = Vector9d::Unit(axis);
    Orthogonalize(basis, k, &v);
    basis.col(k) = v.normalized();
    (*null_space)[k - 5] = basis.col(k);
  }
  return true;
}

// The ten cubics det(E) = 0 and 2 E E' E - trace(E E') E = 0, E = x E0 + y E1 + z E2 + E3, one a row.
void BuildConstraints(const std::array<Vector9d, 4>& null_space, std::array<Cubic, 10>* rows) {
  Linear e[3][3];
  for (int r = 0; r < 3; ++r) {
    for (int c = 0; c < 3; ++c) {
      for (int k = 0; k < 4; ++k) e[r][c][k] = null_space[k][3 * r + c];
    }
  }
  for (Cubic& row : *rows) row.fill(0.0);

  for (int c = 0; c < 3; ++c) {
    const int c1 = (c + 1) % 3, c2 = (c + 2) % 3;
    Quadratic minor{};
    AddProduct(e[1][c1], e[2][c2], 1.0, &minor);
    AddProduct(e[1][c2], e[2][c1], -1.0, &minor);
    AddProduct(minor, e[0][c], 1.0, &(*rows)[9]);
  }

  Quadratic gram[3][3];  // E E'
  for (int r = 0; r < 3; ++r) {
    for (int c = r; c < 3; ++c) {
      Quadratic sum{};
      for (int k = 0; k < 3; ++k) AddProduct(e[r][k], e[c][k], 1.0, &sum);
      gram[r][c] = gram[c][r] = sum;
    }
  }
  for (int i = 0; i < 10; ++i) {
    const double half_trace = 0.5 * (gram[0][0][i] + gram[1][1][i] + gram[2][2][i]);
    for (int r = 0; r < 3; ++r) gram[r][r][i] -= half_trace;
  }
  for (int r = 0; r < 3; ++r) {
    for (int c = 0; c < 3; ++c) {
      for (int k = 0; k < 3; ++k) AddProduct(gram[r][k], e[k][c], 1.0, &(*rows)[3 * r + c]);
    }
  }
}

// Gauss-Jordan with partial pivoting: the first ten columns become the identity.
bool Eliminate(std::array<Cubic, 10>* rows) {
  for (int column = 0; column < 10; ++column) {
    int pivot = column;
    for (int r = column + 1; r < 10; ++r) {
      if (std::abs((*rows)[r][column]) > std::abs((*rows)[pivot][column])) pivot = r;
    }
    if (!(std::abs((*rows)[pivot][column]) > 1e-14)) return false;
    std::swap((*rows)[column], (*rows)[pivot]);
    const double inverse = 1.0 / (*rows)[column][column];
    for (int c = column; c < 20; ++c) (*rows)[column][c] *= inverse;
    for (int r = 0; r < 10; ++r) {
      const double factor = (*rows)[r][column];
      if (r == column || factor == 0.0) continue;
      for (int c = column; c < 20; ++c) (*rows)[r][c] -= factor * (*rows)[column][c];
    }
  }
  return true;
}

// Polynomials in z, lowest power first; the third column of the matrix has degree four, the others three.
struct RowInZ {
  std::array<double, 4> x, y;
  std::array<double, 5> one;
};

// <upper> - z <lower>, which cancels the monomial that leads both.
RowInZ Subtract(const Cubic& upper, const Cubic& lower) {
  RowInZ row;
  row.x = {upper[12], upper[11] - lower[12], upper[10] - lower[11], -lower[10]};
  row.y = {upper[15], upper[14] - lower[15], upper[13] - lower[14], -lower[13]};
  row.one = {upper[19], upper[18] - lower[19], upper[17] - lower[18], upper[16] - lower[17], -lower[16]};
  return row;
}

template <std::size_t N, std::size_t M>
void AddProduct(const std::array<double, N>& a, const std::array<double, M>& b, double sign,
                std::array<double, N + M - 1>* out) {
  for (std::size_t i = 0; i < N; ++i) {
    for (std::size_t j = 0; j < M; ++j) (*out)[i + j] += sign * a[i] * b[j];
  }
}

template <std::size_t N>
double Evaluate(const std::array<double, N>& coefficients, double z) {
  double value = 0.0;
  for (std::size_t i = N; i-- > 0;) value = value * z + coefficients[i];
  return value;
}

}  // namespace

int SolveFivePoint(std::span<const Eigen::Vector3d, 5> bearings_a, std::span<const Eigen::Vector3d, 5> bearings_b,
                   std::array<Eigen::Matrix3d, 10>* essentials) {
  std::array<Vector9d, 4> null_space;
  if (!NullSpace(bearings_a, bearings_b, &null_space)) return 0;
  std::array<Cubic, 10> rows;
  BuildConstraints(null_space, &rows);
  if (!Eliminate(&rows)) return 0;

  const std::array<RowInZ, 3> matrix = {Subtract(rows[4], rows[5]), Subtract(rows[6], rows[7]),
                                        Subtract(rows[8], rows[9])};
  // Determinant by the third column.
  std::array<double, 11> determinant{};
  for (int r = 0; r < 3; ++r) {
    const RowInZ& p = matrix[(r + 1) % 3];
    const RowInZ& q = matrix[(r + 2) % 3];
    std::array<double, 7> minor{};
    AddProduct(p.x, q.y, 1.0, &minor);
    AddProduct(p.y, q.x, -1.0, &minor);
    AddProduct(minor, matrix[r].one, 1.0, &determinant);
  }

  std::array<double, kMaxPolynomialDegree> roots;
  const int num_roots = RealRoots(determinant, &roots);
  int count = 0;
  for (int i = 0; i < num_roots; ++i) {
    const double z = roots[i];
    std::array<Eigen::Vector3d, 3> values;
    for (int r = 0; r < 3; ++r) {
      values[r] =
          Eigen::Vector3d(Evaluate(matrix[r].x, z), Evaluate(matrix[r].y, z), Evaluate(matrix[r].one, z)).normalized();
    }
    // (x, y, 1) is orthogonal to all rows: from the two that differ most.
    Eigen::Vector3d solution = Eigen::Vector3d::Zero();
    for (int r = 0; r < 3; ++r) {
      const Eigen::Vector3d candidate = values[r].cross(values[(r + 1) % 3]);
      if (candidate.squaredNorm() > solution.squaredNorm()) solution = candidate;
    }
    const double w = solution.z();
    if (!(std::abs(w) > 1e-14)) continue;
    const Vector9d e =
        ((solution.x() / w) * null_space[0] + (solution.y() / w) * null_space[1] + z * null_space[2] + null_space[3])
            .normalized();
    if (!e.allFinite()) continue;
    for (int r = 0; r < 3; ++r) (*essentials)[count].row(r) = e.segment<3>(3 * r).transpose();
    ++count;
  }
  return count;
}

}  // namespace haustra
