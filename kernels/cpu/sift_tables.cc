#include "kernels/cpu/sift_tables.h"

#include <cmath>

namespace haustra::kernels {
namespace {

// Grid of Tables::kSide samples a side, Gaussian of the given width (spacings) as far as the radius.
template <typename Tables>
void FillGrid(float sigma, float radius, Tables* t) {
  constexpr float kCentre = 0.5f * (Tables::kSide - 1);
  for (int i = 0; i < Tables::kNumSamples; ++i) {
    t->u[i] = static_cast<float>(i % Tables::kSide) - kCentre;
    t->v[i] = static_cast<float>(i / Tables::kSide) - kCentre;
    const float squared_radius = t->u[i] * t->u[i] + t->v[i] * t->v[i];
    t->weights[i] = squared_radius <= radius * radius ? std::exp(-squared_radius / (2 * sigma * sigma)) : 0.0f;
  }
}

}  // namespace

const OrientationTables& GetOrientationTables() {
  static const OrientationTables tables = [] {
    OrientationTables t{};
    FillGrid(kOrientationWindowSigma / kOrientationSpacing, kOrientationRadiusSamples + 0.5f, &t);
    return t;
  }();
  return tables;
}

const DescriptorTables& GetDescriptorTables() {
  static const DescriptorTables tables = [] {
    DescriptorTables t{};
    FillGrid(kDescriptorWindowSigma * kDescriptorSamplesPerCell, 1.5f * DescriptorTables::kSide, &t);
    for (int i = 0; i < DescriptorTables::kSide; ++i) {
      const float position = (static_cast<float>(i) + 0.5f) / kDescriptorSamplesPerCell;  // cells from the first sample
      t.after_weight[i] = position - std::floor(position);
      t.before_weight[i] = 1.0f - t.after_weight[i];
    }
    return t;
  }();
  return tables;
}

}  // namespace haustra::kernels
