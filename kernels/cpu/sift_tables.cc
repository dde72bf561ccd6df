#include "kernels/cpu/sift_tables.h"

#include <cmath>

namespace haustra::kernels {

const DescriptorTables& GetDescriptorTables() {
  static const DescriptorTables tables = [] {
    DescriptorTables t{};
    constexpr int kSide = DescriptorTables::kSide;
    constexpr float kSigma = kDescriptorWindowSigma * kDescriptorSamplesPerCell;  // spacings
    for (int i = 0; i < DescriptorTables::kNumSamples; ++i) {
      const int column = i % kSide, row = i / kSide;
      t.u[i] = static_cast<float>(column) - 0.5f * (kSide - 1);
      t.v[i] = static_cast<float>(row) - 0.5f * (kSide - 1);
      t.weights[i] = std::exp(-(t.u[i] * t.u[i] + t.v[i] * t.v[i]) / (2 * kSigma * kSigma));
    }
    for (int i = 0; i < kSide; ++i) {
      const float position = (static_cast<float>(i) + 0.5f) / kDescriptorSamplesPerCell;  // cells from the first sample
      t.after_weight[i] = position - std::floor(position);
      t.before_weight[i] = 1.0f - t.after_weight[i];
    }
    return t;
  }();
  return tables;
}

}  // namespace haustra::kernels
