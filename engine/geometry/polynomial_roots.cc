#include "engine/geometry/polynomial_roots.h"

#include <algorithm>
#include <cmath>

#include "hal/core/check.h"

namespace haustra {
namespace {

double Evaluate(std::span<const double> coefficients, double x) {
  double value = 0.0;
  for (std::size_t i = coefficients.size(); i-- > 0;) value = value * x + coefficients[i];
  return value;
}

// Root between a and b, where `coefficients` is monotonic and changes sign: Newton, kept inside the bracket by
// bisection.
double BracketedRoot(std::span<const double> coefficients, std::span<const double> derivative, double a, double b,
                     double value_a) {
  double x = 0.5 * (a + b);
  for (int i = 0; i < 100; ++i) {
    const double value = Evaluate(coefficients, x);
    if (value == 0.0) return x;
    ((value > 0.0) == (value_a > 0.0) ? a : b) = x;
    const double newton = x - value / Evaluate(derivative, x);
    const double next = newton > a && newton < b ? newton : 0.5 * (a + b);
    if (std::abs(next - x) <= 1e-15 * std::max(1.0, std::abs(x))) return next;
    x = next;
  }
  return x;
}

// derivatives[k], of degree `degree - k`, is the k-th derivative of derivatives[0].
using Derivatives = std::array<std::array<double, kMaxPolynomialDegree + 1>, kMaxPolynomialDegree + 1>;

Derivatives DerivativesOf(std::span<const double> coefficients) {
  const int degree = static_cast<int>(coefficients.size()) - 1;
  Derivatives derivatives;
  std::copy(coefficients.begin(), coefficients.end(), derivatives[0].begin());
  for (int k = 1; k <= degree; ++k) {
    for (int i = 0; i <= degree - k; ++i) derivatives[k][i] = derivatives[k - 1][i + 1] * (i + 1);
  }
  return derivatives;
}

// Whether x is a root of odd multiplicity: as many derivatives are zero there, with the polynomial itself.
bool IsOddRoot(const Derivatives& derivatives, int degree, double x) {
  int multiplicity = 0;
  while (multiplicity <= degree &&
         Evaluate({derivatives[multiplicity].data(), static_cast<std::size_t>(degree - multiplicity + 1)}, x) == 0.0) {
    ++multiplicity;
  }
  return multiplicity <= degree && multiplicity % 2 == 1;
}

// Those between both ends, neither of which is one.
int RealRootsBetween(const Derivatives& derivatives, int degree, double low, double high,
                     std::array<double, kMaxPolynomialDegree>* roots) {
  // From the linear derivative up to the polynomial itself: the roots of one are the break points of the next.
  int count = 0;
  for (int k = degree - 1; k >= 0; --k) {
    const std::span<const double> current(derivatives[k].data(), degree - k + 1);
    const std::span<const double> slope(derivatives[k + 1].data(), degree - k);
    std::array<double, kMaxPolynomialDegree> found;
    int num_found = 0;
    double left = low, value_left = Evaluate(current, low);
    for (int i = 0; i <= count; ++i) {
      const double right = i < count ? (*roots)[i] : high;
      const double value_right = Evaluate(current, right);
      // Whether the sign changes at a break point that is a root itself, the next value tells.
      if (value_right == 0.0) continue;
      if ((value_left < 0.0 && value_right > 0.0) || (value_left > 0.0 && value_right < 0.0)) {
        found[num_found++] = BracketedRoot(current, slope, left, right, value_left);
      }
      left = right;
      value_left = value_right;
    }
    count = num_found;
    std::copy_n(found.begin(), num_found, roots->begin());
  }
  return count;
}

}  // namespace

int RealRootsInInterval(std::span<const double> coefficients, double low, double high,
                        std::array<double, kMaxPolynomialDegree>* roots) {
  const int degree = static_cast<int>(coefficients.size()) - 1;
  HAUSTRA_DCHECK(degree <= kMaxPolynomialDegree);
  if (degree < 1) return 0;
  const Derivatives derivatives = DerivativesOf(coefficients);
  int count = RealRootsBetween(derivatives, degree, low, high, roots);
  if (IsOddRoot(derivatives, degree, high)) (*roots)[count++] = high;
  if (IsOddRoot(derivatives, degree, low)) {
    std::copy_backward(roots->begin(), roots->begin() + count, roots->begin() + count + 1);
    (*roots)[0] = low;
    ++count;
  }
  return count;
}

int RealRoots(std::span<const double> coefficients, std::array<double, kMaxPolynomialDegree>* roots) {
  int count = RealRootsInInterval(coefficients, -1.0, 1.0, roots);
  const int degree = static_cast<int>(coefficients.size()) - 1;
  if (degree < 1) return count;
  std::array<double, kMaxPolynomialDegree + 1> reversed;
  std::reverse_copy(coefficients.begin(), coefficients.end(), reversed.begin());
  std::array<double, kMaxPolynomialDegree> beyond;
  const int num_beyond =
      RealRootsBetween(DerivativesOf({reversed.data(), coefficients.size()}), degree, -1.0, 1.0, &beyond);
  for (int i = 0; i < num_beyond && count < kMaxPolynomialDegree; ++i) {
    if (std::abs(beyond[i]) > 1e-12) (*roots)[count++] = 1.0 / beyond[i];
  }
  return count;
}

}  // namespace haustra
