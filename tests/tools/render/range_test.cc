// True range: points that one frame shows lie where another one shows them.
#include <gtest/gtest.h>

#include <algorithm>

#include "engine/surface/depth_map.h"
#include "tools/render/sequence_model.h"

namespace haustra::render {
namespace {

constexpr int kStepPx = 4;

TEST(MeasureRange, TwoFramesSeeTheSameWall) {
  RenderOptions options = RenderOptions::FromPreset(*FindPreset("clear"));
  options.preset.path.start_arc_mm = 14.0;
  options.preset.blind_end_mm = 30.0;
  options.seconds = 1.2;
  options.width_px = 240;
  options.height_px = 180;
  const auto model = SequenceModel::Create(options);
  ASSERT_TRUE(model.ok());
  const SequenceModel& scene = **model;
  FrameRenderer renderer(scene.colon(), scene.mucosa(), scene.camera(), scene.window());
  std::vector<float> first, second;
  const int frame_a = 0, frame_b = 20;
  scene.MeasureRange(frame_a, kStepPx, &renderer, &first);
  scene.MeasureRange(frame_b, kStepPx, &renderer, &second);
  const SE3 world_from_a = scene.path().WorldFromCam(scene.TimeS(frame_a));
  const SE3 b_from_world = scene.path().WorldFromCam(scene.TimeS(frame_b)).Inverse();
  const int width = 240 / kStepPx, height = 180 / kStepPx;
  ASSERT_EQ(first.size(), static_cast<std::size_t>(width * height));
  std::vector<double> errors;
  for (int i = 0; i < width * height; ++i) {
    const double x = CellCentrePx(i % width, kStepPx), y = CellCentrePx(i / width, kStepPx);
    Eigen::Vector3d bearing;
    if (scene.window().coverage(static_cast<int>(x), static_cast<int>(y)) < 1.0f) {
      ASSERT_EQ(first[i], 0.0f);
      continue;
    }
    if (first[i] <= 0.0f) continue;
    ASSERT_TRUE(scene.camera().Unproject({x, y}, &bearing));
    const Eigen::Vector3d point = b_from_world * (world_from_a * Eigen::Vector3d(first[i] * bearing));
    Eigen::Vector2d pixel;
    if (!scene.camera().Project(point, &pixel)) continue;
    const double u = (pixel.x() - CellCentrePx(0, kStepPx)) / kStepPx,
                 v = (pixel.y() - CellCentrePx(0, kStepPx)) / kStepPx;
    if (!(u >= 0 && v >= 0 && u < width - 1 && v < height - 1)) continue;
    // Between four cells: the wall is smooth but for the edges of folds.
    const int cell = static_cast<int>(v) * width + static_cast<int>(u);
    const double fu = u - std::floor(u), fv = v - std::floor(v);
    const double seen = (1 - fv) * ((1 - fu) * second[cell] + fu * second[cell + 1]) +
                        fv * ((1 - fu) * second[cell + width] + fu * second[cell + width + 1]);
    errors.push_back(std::abs(seen / point.norm() - 1.0));
  }
  ASSERT_GT(errors.size(), 800u);
  std::sort(errors.begin(), errors.end());
  EXPECT_LT(errors[errors.size() / 2], 0.003);
  EXPECT_LT(errors[errors.size() * 8 / 10], 0.02);
}

}  // namespace
}  // namespace haustra::render
