// The picture of the wall: seamless, repeated where twins are, filtered without a change of brightness.
#include "tools/render/mucosa_texture.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>

namespace haustra::render {
namespace {

constexpr float kGirth = MucosaTexture::kGirthMm;

Footprint Spot(float u_mm, float v_mm, float size_mm) { return {u_mm, v_mm, 1.0f, 0.0f, size_mm, size_mm}; }

class MucosaTextureTest : public testing::Test {
 protected:
  static void SetUpTestSuite() {
    ColonStyle style;
    style.length_mm = 130.0;
    style.twin.start_mm = 15.0;
    style.twin.offset_mm = 50.0;
    style.twin.length_mm = 34.0;
    colon_ = new Colon(style, 3);
    texture_ = new MucosaTexture(MucosaStyle{}, *colon_, 3, 2);
  }
  static void TearDownTestSuite() {
    delete texture_;
    delete colon_;
  }
  static inline Colon* colon_ = nullptr;
  static inline MucosaTexture* texture_ = nullptr;
};

TEST_F(MucosaTextureTest, TwinPlacesLookAlikeAndOthersDoNot) {
  double twins = 0.0, others = 0.0;
  int count = 0;
  for (double arc = 22.0; arc < 42.0; arc += 0.9) {
    const auto u = static_cast<float>(colon_->mesh().SurfaceAtArc(arc));
    const auto twin_u = static_cast<float>(colon_->mesh().SurfaceAtArc(arc + 50.0));
    const auto other_u = static_cast<float>(colon_->mesh().SurfaceAtArc(arc + 25.0));
    for (float v = 1.0f; v < kGirth; v += 5.3f) {
      const float here = texture_->Sample(Spot(u, v, 0.5f)).rgb[1];
      twins += std::abs(here - texture_->Sample(Spot(twin_u, v, 0.5f)).rgb[1]);
      others += std::abs(here - texture_->Sample(Spot(other_u, v, 0.5f)).rgb[1]);
      ++count;
    }
  }
  EXPECT_LT(twins / count, 0.004);  // rows are rounded to whole texels
  EXPECT_GT(others, 5.0 * twins);
}

TEST_F(MucosaTextureTest, HasNoSeamAroundTheGirth) {
  for (float u = 5.0f; u < 100.0f; u += 3.1f) {
    const MucosaSample before = texture_->Sample(Spot(u, -0.005f, 0.05f));
    const MucosaSample after = texture_->Sample(Spot(u, 0.005f, 0.05f));
    const MucosaSample around = texture_->Sample(Spot(u, kGirth + 0.005f, 0.05f));
    for (int c = 0; c < 3; ++c) {
      EXPECT_NEAR(before.rgb[c], after.rgb[c], 0.03f);
      EXPECT_NEAR(after.rgb[c], around.rgb[c], 1e-3f);
    }
  }
}

TEST_F(MucosaTextureTest, PoleOfTheDomeIsOnePlace) {
  // All meridians meet: the same colour from every side.
  const auto pole = static_cast<float>(colon_->mesh().surface_length_mm());
  const MucosaSample reference = texture_->Sample(Spot(pole, 0.0f, 0.1f));
  for (float v = 0.0f; v < kGirth; v += 7.0f) {
    const MucosaSample sample = texture_->Sample(Spot(pole, v, 0.1f));
    for (int c = 0; c < 3; ++c) EXPECT_NEAR(sample.rgb[c], reference.rgb[c], 1e-3f);
  }
}

TEST_F(MucosaTextureTest, WideFootprintGivesTheMeanOfSmallOnes) {
  const float u = 60.0f, v = 40.0f, size = 2.4f;
  double mean = 0.0;
  int count = 0;
  for (float du = -size / 2; du <= size / 2; du += 0.06f) {
    for (float dv = -size / 2; dv <= size / 2; dv += 0.06f, ++count) {
      mean += std::sqrt(texture_->Sample(Spot(u + du, v + dv, 0.05f)).rgb[1]);
    }
  }
  mean /= count;
  EXPECT_NEAR(std::sqrt(texture_->Sample(Spot(u, v, size)).rgb[1]), mean, 0.03);
}

TEST_F(MucosaTextureTest, ReflectancesArePhysical) {
  float lowest = 1.0f, highest = 0.0f;
  for (float u = 1.0f; u < 150.0f; u += 0.9f) {
    for (float v = 0.0f; v < kGirth; v += 1.3f) {
      const MucosaSample sample = texture_->Sample(Spot(u, v, 0.1f));
      lowest = std::min(lowest, sample.rgb[2]);
      highest = std::max(highest, sample.rgb[0]);
      ASSERT_GE(sample.wetness, 0.0f);
      ASSERT_LE(sample.wetness, 1.001f);
    }
  }
  EXPECT_GT(lowest, 0.0f);
  EXPECT_LT(highest, 1.0f);
  EXPECT_GT(highest, 0.5f);
}

}  // namespace
}  // namespace haustra::render
