// True normals against the true range of the same picture: the wall between neighbouring cells, and an instrument.
#include <gtest/gtest.h>

#include <Eigen/Geometry>
#include <algorithm>
#include <array>
#include <cmath>
#include <memory>
#include <numbers>

#include "engine/surface/depth_map.h"
#include "tools/render/normal_picture.h"
#include "tools/render/sequence_model.h"

namespace haustra::render {
namespace {

class NormalsTest : public testing::Test {
 protected:
  static constexpr int kStepPx = 4, kColumns = 360 / kStepPx, kRows = 270 / kStepPx;

  void Take(const std::vector<Event>& events, double fluid, double breathing, int frame) {
    RenderOptions options = RenderOptions::FromPreset(*FindPreset("clear"));
    options.preset.path.start_arc_mm = 14.0;
    options.preset.blind_end_mm = 30.0;
    options.seconds = 3.0;
    options.width_px = 360;
    options.height_px = 270;
    options.num_threads = 2;
    options.events = events;
    options.preset.colon.fluid = fluid;
    options.preset.colon.breathing.amplitude = breathing;
    model_ = std::move(*SequenceModel::Create(options));
    FrameRenderer renderer(model_->colon(), model_->mucosa(), model_->camera(), model_->window());
    model_->MeasureRange(frame, kStepPx, &renderer, &range_mm_, &normals_);
    std::vector<float> range_alone;
    model_->MeasureRange(frame, kStepPx, &renderer, &range_alone);
    EXPECT_EQ(range_mm_, range_alone);
  }
  Eigen::Vector3d Bearing(double column, double row) const {
    Eigen::Vector3d bearing;
    const Eigen::Vector2d pixel(CellCentrePx(0, kStepPx) + kStepPx * column, CellCentrePx(0, kStepPx) + kStepPx * row);
    EXPECT_TRUE(model_->camera().Unproject(pixel, &bearing));
    return bearing;
  }
  Eigen::Vector3d Point(int column, int row) const { return range_mm_[row * kColumns + column] * Bearing(column, row); }

  std::unique_ptr<SequenceModel> model_;
  std::vector<float> range_mm_;
  std::vector<Eigen::Vector3f> normals_;
};

TEST_F(NormalsTest, StandOnTheWallThatTheRangesShow) {
  for (const double breathing : {0.0, 0.15}) {
    Take({}, 0.0, breathing, 40);
    std::vector<double> degrees;
    for (int row = 1; row + 1 < kRows; ++row) {
      for (int column = 1; column + 1 < kColumns; ++column) {
        const auto known = [&](int dx, int dy) { return range_mm_[(row + dy) * kColumns + column + dx] > 0.0f; };
        if (!known(0, 0) || !known(1, 0) || !known(-1, 0) || !known(0, 1) || !known(0, -1)) continue;
        const Eigen::Vector3d right = Point(column + 1, row) - Point(column - 1, row);
        const Eigen::Vector3d down = Point(column, row + 1) - Point(column, row - 1);
        // Rows go down and columns to the right: this way round it faces the camera.
        const Eigen::Vector3d normal = down.cross(right).normalized();
        const Eigen::Vector3d told = normals_[row * kColumns + column].cast<double>();
        ASSERT_NEAR(told.norm(), 1.0, 1e-5);
        ASSERT_LT(told.dot(Bearing(column, row)), 1e-6);
        degrees.push_back(std::acos(std::clamp(normal.dot(told), -1.0, 1.0)) * 180.0 / std::numbers::pi);
      }
    }
    ASSERT_GT(degrees.size(), 2500u);
    std::sort(degrees.begin(), degrees.end());
    // Folds bend within four pixels; at their edges two walls are neighbours.
    EXPECT_LT(degrees[degrees.size() / 2], 3.5);
    EXPECT_LT(degrees[degrees.size() * 3 / 4], 12.0);
  }
}

TEST_F(NormalsTest, AreKnownWhereTheRangeIs) {
  Take({{EventKind::kInstrument, 0.0, 3.0}}, 0.5, 0.0, 40);
  const InstrumentShape shape = Instrument({{EventKind::kInstrument, 0.0, 3.0}}, 1).At(model_->TimeS(40));
  int num_unknown = 0, num_on_instrument = 0;
  for (int i = 0; i < kColumns * kRows; ++i) {
    EXPECT_EQ(normals_[i].isZero(), range_mm_[i] == 0.0f);
    num_unknown += range_mm_[i] == 0.0f ? 1 : 0;
    const Eigen::Vector3f point = range_mm_[i] * Bearing(i % kColumns, i / kColumns).cast<float>();
    // On the shaft: away from its axis.
    const Capsule& shaft = shape.parts[0];
    const Eigen::Vector3f axis = (shaft.b - shaft.a).normalized();
    const Eigen::Vector3f from_axis = point - shaft.a - axis.dot(point - shaft.a) * axis;
    if (axis.dot(shaft.b - point) < 0.0f || std::abs(from_axis.norm() - shaft.radius) > 0.01f) continue;
    ++num_on_instrument;
    EXPECT_GT(normals_[i].dot(from_axis.normalized()), 0.999f);
  }
  EXPECT_GT(num_unknown, 300);
  EXPECT_GT(num_on_instrument, 20);
}

TEST(NormalPicture, HoldsTheComponentsInRedGreenBlue) {
  const std::vector<Eigen::Vector3f> normals = {
      {0.0f, 0.0f, -1.0f}, {1.0f, 0.0f, 0.0f}, Eigen::Vector3f::Zero(), {0.6f, -0.8f, 0.0f}};
  const Image picture = NormalPicture(normals, 2, 2);
  ASSERT_EQ(picture.format(), PixelFormat::kBgr8);
  const auto bgr = [&](int x, int y) {
    const std::uint8_t* p = picture.row(y) + 3 * x;
    return std::array<int, 3>{p[0], p[1], p[2]};
  };
  EXPECT_EQ(bgr(0, 0), (std::array<int, 3>{1, 128, 128}));
  EXPECT_EQ(bgr(1, 0), (std::array<int, 3>{128, 128, 255}));
  EXPECT_EQ(bgr(0, 1), (std::array<int, 3>{0, 0, 0}));
  EXPECT_EQ(bgr(1, 1), (std::array<int, 3>{128, 26, 204}));
}

}  // namespace
}  // namespace haustra::render
