// Stool and blood on the wall, held against the same wall without them: how much is covered, what colour, what shows
// through, and how blood spreads.
#include <gtest/gtest.h>

#include <cmath>
#include <numeric>
#include <vector>

#include "tools/render/blood.h"
#include "tools/render/mucosa_texture.h"

namespace haustra::render {
namespace {

constexpr double kStool = 0.3, kBlood = 0.4;

class WallCoverTest : public testing::Test {
 protected:
  static void SetUpTestSuite() {
    ColonStyle style;
    style.length_mm = 130.0;
    colon_ = new Colon(style, 3);
    clean_ = new MucosaTexture(MucosaStyle{}, *colon_, 3, 2);
    MucosaStyle covered;
    covered.stool = kStool;
    stool_ = new MucosaTexture(covered, *colon_, 3, 2);
    covered.stool = 0.0;
    covered.blood.share = kBlood;
    blood_ = new MucosaTexture(covered, *colon_, 3, 2);
  }
  static void TearDownTestSuite() {
    delete blood_;
    delete stool_;
    delete clean_;
    delete colon_;
  }
  // A grid over the tube.
  static std::vector<MucosaSample> Samples(const MucosaTexture& texture) {
    std::vector<MucosaSample> samples;
    for (float u = 3.0f; u < static_cast<float>(colon_->mesh().dome_surface_mm()) - 3.0f; u += 0.83f) {
      for (float v = 0.4f; v < MucosaTexture::kGirthMm; v += 0.91f) {
        samples.push_back(texture.Sample({u, v, 1.0f, 0.0f, 0.07f, 0.07f}));
      }
    }
    return samples;
  }
  static bool Differs(const MucosaSample& a, const MucosaSample& b) {
    return std::abs(a.rgb[0] - b.rgb[0]) + std::abs(a.rgb[1] - b.rgb[1]) + std::abs(a.rgb[2] - b.rgb[2]) > 1e-3f;
  }

  static inline Colon* colon_ = nullptr;
  static inline MucosaTexture *clean_ = nullptr, *stool_ = nullptr, *blood_ = nullptr;
};

double Correlation(const std::vector<double>& a, const std::vector<double>& b) {
  const auto n = static_cast<double>(a.size());
  const double mean_a = std::accumulate(a.begin(), a.end(), 0.0) / n,
               mean_b = std::accumulate(b.begin(), b.end(), 0.0) / n;
  double ab = 0.0, aa = 0.0, bb = 0.0;
  for (std::size_t i = 0; i < a.size(); ++i) {
    ab += (a[i] - mean_a) * (b[i] - mean_b);
    aa += (a[i] - mean_a) * (a[i] - mean_a);
    bb += (b[i] - mean_b) * (b[i] - mean_b);
  }
  return ab / std::sqrt(aa * bb);
}

TEST_F(WallCoverTest, StoolCoversItsShareIsBrownAndHalfTransparent) {
  const std::vector<MucosaSample> clean = Samples(*clean_), covered = Samples(*stool_);
  std::vector<double> below, above;
  double clean_ratio = 0.0, covered_ratio = 0.0;
  for (std::size_t i = 0; i < clean.size(); ++i) {
    if (!Differs(clean[i], covered[i])) continue;
    // Green against red, where a vessel and its surroundings differ most.
    below.push_back(clean[i].rgb[1] / clean[i].rgb[0]);
    above.push_back(covered[i].rgb[1] / covered[i].rgb[0]);
    clean_ratio += clean[i].rgb[2] / clean[i].rgb[1];
    covered_ratio += covered[i].rgb[2] / covered[i].rgb[1];
  }
  const auto count = static_cast<double>(above.size());
  EXPECT_NEAR(count / static_cast<double>(clean.size()), kStool, 0.04);
  // Brown: little blue against green, and green nearer to red than on mucosa.
  EXPECT_LT(covered_ratio, 0.6 * clean_ratio);
  EXPECT_GT(std::accumulate(above.begin(), above.end(), 0.0), 1.1 * std::accumulate(below.begin(), below.end(), 0.0));
  // The wall shows through, and not alone.
  const double correlation = Correlation(below, above);
  EXPECT_GT(correlation, 0.2);
  EXPECT_LT(correlation, 0.95);
}

TEST_F(WallCoverTest, BloodCoversItsShareAndIsDarkRed) {
  std::vector<MucosaSample> clean = Samples(*clean_), covered = Samples(*blood_);
  int num_covered = 0, num_thick = 0;
  for (std::size_t i = 0; i < clean.size(); ++i) {
    // Until it bleeds the wall is as it was.
    ASSERT_FALSE(Differs(clean[i], covered[i]));
    CoverWithBlood(static_cast<float>(kBlood), &covered[i]);
    if (!Differs(clean[i], covered[i])) continue;
    ++num_covered;
    ASSERT_LE(covered[i].rgb[0], clean[i].rgb[0]);
    ASSERT_LT(covered[i].rgb[1], clean[i].rgb[1]);
    if (covered[i].blood_rank > kBlood - 0.15) continue;
    ++num_thick;
    EXPECT_LT(covered[i].rgb[1], 0.1f * clean[i].rgb[1]);
    EXPECT_GT(covered[i].rgb[0], 8.0f * covered[i].rgb[1]);
    EXPECT_LT(covered[i].rgb[0], 0.75f * clean[i].rgb[0]);
  }
  EXPECT_NEAR(static_cast<double>(num_covered) / static_cast<double>(clean.size()), kBlood, 0.04);
  EXPECT_GT(num_thick, num_covered / 3);
}

TEST_F(WallCoverTest, BloodSpreadsAndNeverRecedes) {
  const BloodStyle style{kBlood, 8.0};
  const std::vector<MucosaSample> bare = Samples(*blood_);
  double before = 0.0;
  std::vector<bool> was_covered(bare.size(), false);
  for (const double time_s : {0.0, 2.0, 4.0, 8.0, 30.0}) {
    std::vector<bool> is_covered(bare.size(), false);
    int count = 0;
    for (std::size_t i = 0; i < bare.size(); ++i) {
      MucosaSample sample = bare[i];
      CoverWithBlood(static_cast<float>(style.ShareAt(time_s)), &sample);
      is_covered[i] = Differs(bare[i], sample);
      count += is_covered[i] ? 1 : 0;
      EXPECT_TRUE(is_covered[i] || !was_covered[i]);
    }
    const double share = static_cast<double>(count) / static_cast<double>(bare.size());
    EXPECT_NEAR(share, kBlood * std::min(time_s / 8.0, 1.0), 0.04) << time_s;
    EXPECT_GE(share, before);
    before = share;
    was_covered = is_covered;
  }
}

}  // namespace
}  // namespace haustra::render
