#include "tools/render/narrow_band.h"

#include <algorithm>
#include <cmath>

namespace haustra::render {
namespace {

// A band absorbs as the wide channel about it does, but more: by the law of Beer and Lambert a power of the
// reflectance.
constexpr float kPower540 = 1.25f, kPower415 = 1.8f;
// The processor's gains: mucosa of usual colour comes out greenish brown.
constexpr float kGain540 = 2.3f, kGain415 = 14.0f, kBlueShare = 0.58f;

}  // namespace

void ShowInNarrowBand(MucosaSample* sample) {
  const float at_540 = kGain540 * std::pow(std::max(sample->rgb[1], 0.0f), kPower540);
  const float at_415 = kGain415 * std::pow(std::max(sample->rgb[2], 0.0f), kPower415);
  sample->rgb[0] = at_540;
  sample->rgb[1] = at_415;
  sample->rgb[2] = kBlueShare * at_415;
}

void ShowInNarrowBand(std::array<float, 3>* through) {
  const float at_540 = std::pow((*through)[1], kPower540), at_415 = std::pow((*through)[2], kPower415);
  *through = {at_540, at_415, at_415};
}

}  // namespace haustra::render
