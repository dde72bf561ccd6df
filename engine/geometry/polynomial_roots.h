// Real roots of polynomials of small degree. reentrant, rt-safe.
#pragma once

#include <array>
#include <span>

namespace haustra {

inline constexpr int kMaxPolynomialDegree = 10;

// Real roots in ascending order of sum coefficients[i] x^i over [low, high], low < high; at most
// `coefficients.size() - 1`, degree at most kMaxPolynomialDegree. Between two neighbouring roots of the derivative the
// polynomial is monotonic, so one bracketed search finds what is there; roots where the sign does not change (even
// multiplicity) are not reported.
int RealRootsInInterval(std::span<const double> coefficients, double low, double high,
                        std::array<double, kMaxPolynomialDegree>* roots);

// All such roots up to 1e12 in size, in no particular order: those with |x| <= 1, then those beyond as reciprocals of
// the roots of the reversed polynomial, so that no size of root loses precision.
int RealRoots(std::span<const double> coefficients, std::array<double, kMaxPolynomialDegree>* roots);

}  // namespace haustra
