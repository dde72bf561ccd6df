#include "tools/render/narrow_band.h"

#include <gtest/gtest.h>

#include <cmath>

#include "tools/render/preset.h"

namespace haustra::render {
namespace {

MucosaSample Sample(float red, float green, float blue) {
  MucosaSample sample{{red, green, blue}, 0.4f, 0.1f, -0.2f};
  ShowInNarrowBand(&sample);
  return sample;
}

const auto kBase = MucosaStyle{}.base_rgb;

TEST(NarrowBand, MucosaIsGreenishBrownNoMorePink) {
  const MucosaSample base = Sample(kBase[0], kBase[1], kBase[2]);
  EXPECT_GT(base.rgb[1], base.rgb[0]);
  EXPECT_GT(base.rgb[0], base.rgb[2]);
  EXPECT_LT(base.rgb[1], 1.5f * base.rgb[0]);
  // It is seen: about as bright as in white light.
  EXPECT_GT(base.rgb[1], 0.15f);
  EXPECT_LT(base.rgb[1], 0.6f);
}

// Beer and Lambert: the same blood, seen in the blue channel, takes away more.
TEST(NarrowBand, VesselsAreDarkerAgainstTheMucosaThanInWhiteLight) {
  const MucosaSample base = Sample(kBase[0], kBase[1], kBase[2]);
  const MucosaSample artery =
      Sample(kBase[0] * std::exp(-0.36f), kBase[1] * std::exp(-1.06f), kBase[2] * std::exp(-0.98f));
  EXPECT_LT(artery.rgb[1] / base.rgb[1], 0.7f * std::exp(-1.06f));
  // Fine vessels lie on top: brown. Veins lie deeper, where 415 nm does not come: towards cyan.
  const MucosaSample vein = Sample(kBase[0] * std::exp(-0.6f), kBase[1] * std::exp(-0.76f), kBase[2] * std::exp(-0.4f));
  EXPECT_GT(artery.rgb[0] / artery.rgb[1], base.rgb[0] / base.rgb[1]);
  EXPECT_LT(vein.rgb[0] / vein.rgb[1], base.rgb[0] / base.rgb[1]);
}

TEST(NarrowBand, WetnessAndReliefStay) {
  const MucosaSample sample = Sample(0.5f, 0.2f, 0.1f);
  EXPECT_EQ(sample.wetness, 0.4f);
  EXPECT_EQ(sample.slope_u, 0.1f);
  EXPECT_EQ(sample.slope_v, -0.2f);
}

TEST(NarrowBand, BlackStaysBlack) {
  const MucosaSample sample = Sample(0.0f, 0.0f, 0.0f);
  for (const float value : sample.rgb) EXPECT_EQ(value, 0.0f);
}

}  // namespace
}  // namespace haustra::render
