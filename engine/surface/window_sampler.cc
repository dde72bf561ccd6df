#include "engine/surface/window_sampler.h"

#include <cmath>
#include <cstdint>

namespace haustra {
namespace {

constexpr int kLanes = 4;
typedef float Floats __attribute__((vector_size(kLanes * sizeof(float)), may_alias));
typedef float UnalignedFloats __attribute__((vector_size(kLanes * sizeof(float)), aligned(alignof(float)), may_alias));
typedef std::int32_t Ints __attribute__((vector_size(kLanes * sizeof(std::int32_t)), may_alias));

Floats Load(const float* p) { return *reinterpret_cast<const UnalignedFloats*>(p); }
Floats AsFloats(Ints v) { return __builtin_convertvector(v, Floats); }

float Total(Floats v) {
  float sum = 0.0f;
  for (int i = 0; i < kLanes; ++i) sum += v[i];
  return sum;
}

// Two pixels of a row, the left one in the lower byte whatever the processor's order of bytes.
std::int32_t Pair(const std::uint8_t* p) { return p[0] | p[1] << 8; }

}  // namespace

std::size_t WindowSampler::PaddedSize(int radius) {
  const auto side = static_cast<std::size_t>(2 * radius + 1);
  return (side * side + kLanes - 1) / kLanes * kLanes;
}

std::size_t WindowSampler::BytesFor(int radius) { return 2 * PaddedSize(radius) * sizeof(float); }

// Filler samples the centre.
WindowSampler::WindowSampler(int radius)
    : steps_along_row_(PaddedSize(radius), 0.0f), steps_along_column_(PaddedSize(radius), 0.0f) {
  std::size_t k = 0;
  for (int v = -radius; v <= radius; ++v) {
    for (int u = -radius; u <= radius; ++u, ++k) {
      steps_along_row_[k] = static_cast<float>(u);
      steps_along_column_[k] = static_cast<float>(v);
    }
  }
}

WindowSums WindowSampler::Sum(const ImageView& grey, const WindowFrame& frame, const float* weights,
                              const float* patterns) const {
  // Rounding may carry a corner to the last row or column, of which there is no next one.
  const float most_x = std::nextafter(static_cast<float>(grey.width - 1), 0.0f);
  const float most_y = std::nextafter(static_cast<float>(grey.height - 1), 0.0f);
  const Floats limit_x = most_x - Floats{}, limit_y = most_y - Floats{};
  const std::ptrdiff_t pitch = grey.pitch_bytes;
  Floats values{}, squares{}, products{};
  for (std::size_t k = 0; k < padded_size(); k += kLanes) {
    const Floats u = Load(&steps_along_row_[k]), v = Load(&steps_along_column_[k]);
    Floats x = frame.x + u * frame.along_row_x + v * frame.along_column_x;
    Floats y = frame.y + u * frame.along_row_y + v * frame.along_column_y;
    x = x < limit_x ? x : limit_x;
    y = y < limit_y ? y : limit_y;
    const Ints x0 = __builtin_convertvector(x, Ints), y0 = __builtin_convertvector(y, Ints);
    Ints above_pair, below_pair;
    for (int i = 0; i < kLanes; ++i) {
      const std::uint8_t* p = grey.data + y0[i] * pitch + x0[i];
      above_pair[i] = Pair(p);
      below_pair[i] = Pair(p + pitch);
    }
    const Floats right_part = x - AsFloats(x0), lower_part = y - AsFloats(y0);
    const Floats above_left = AsFloats(above_pair & 0xff), above_right = AsFloats(above_pair >> 8);
    const Floats below_left = AsFloats(below_pair & 0xff), below_right = AsFloats(below_pair >> 8);
    const Floats above = above_left + right_part * (above_right - above_left);
    const Floats below = below_left + right_part * (below_right - below_left);
    const Floats value = above + lower_part * (below - above);
    const Floats weighted = Load(weights + k) * value;
    values += weighted;
    squares += weighted * value;
    products += Load(patterns + k) * value;
  }
  return {Total(values), Total(squares), Total(products)};
}

}  // namespace haustra
