// Which part of the wall a picture shows, against what the geometry of a straight colon says: from its axis a place is
// hidden by what stands before it at the same angle.
#include "tools/render/seen_wall.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>
#include <numbers>

#include "tools/render/sequence_model.h"

namespace haustra::render {
namespace {

using ::testing::HasSubstr;
using ::testing::StartsWith;

RenderOptions StraightColon() {
  RenderOptions options = RenderOptions::FromPreset(*FindPreset("clear"));
  options.seconds = 4.0;
  options.width_px = 360;
  options.height_px = 270;
  options.preset.colon.max_curvature_per_mm = 0.0;
  options.preset.colon.lumen.polyps_per_mm = 0.0;
  options.preset.blind_end_mm = 80.0;
  return options;
}

// On the axis, looking along it.
ExposureMoment MomentOnAxis(const SequenceModel& model, double arc_mm) {
  const CurveFrame frame = model.colon().centreline().At(arc_mm);
  Eigen::Matrix3d axes;
  axes << frame.normal, frame.binormal, frame.tangent;
  ExposureMoment moment;
  moment.arc_mm = arc_mm;
  moment.world_from_cam = SE3(axes, frame.position);
  return moment;
}

// Of the places of the wall that a camera on the axis looks at: whether a fold hides them.
bool IsHidden(const LumenShape& lumen, double from_mm, double arc_mm, double angle_rad) {
  const double slope = lumen.Radius(arc_mm, angle_rad) / (arc_mm - from_mm);
  for (double at = from_mm + 1.0; at < arc_mm - 1.0; at += 0.25) {
    if (lumen.Radius(at, angle_rad) < slope * (at - from_mm) - 0.2) return true;
  }
  return false;
}

TEST(SeenWall, IsWhatTheGeometryOfAStraightColonSays) {
  const auto model = SequenceModel::Create(StraightColon());
  ASSERT_TRUE(model.ok()) << model.status().ToString();
  const SequenceModel& scene = **model;
  FrameRenderer renderer(scene.colon(), scene.mucosa(), scene.camera(), scene.window());
  const CoverageOptions options;
  SeenWall wall(scene.colon().mesh(), options);
  const double from_mm = 25.0;
  const double dome_mm = scene.colon().centreline().length_mm() - scene.colon().style().dome_mm;
  const ExposureMoment moment = MomentOnAxis(scene, from_mm);
  renderer.FindSeenWall(moment, &wall);
  const SE3 cam_from_world = moment.world_from_cam.Inverse();
  int seen_and_should = 0, seen_only = 0, should_only = 0, neither = 0;
  int well_and_should = 0, of_another_class = 0;
  for (int row = 0; row < wall.num_rows(); ++row) {
    for (int column = 0; column < SeenWall::kAngles; ++column) {
      const SeenWall::Cell& cell = wall.cell(row, column);
      if (cell.arc_mm > dome_mm) continue;  // the lumen's shape does not know the blind end
      const Eigen::Vector3d point = cam_from_world * cell.position;
      Eigen::Vector2d pixel;
      bool is_in_picture = point.z() > 0.0 && scene.camera().Project(point, &pixel) && scene.camera().IsInImage(pixel);
      is_in_picture =
          is_in_picture && scene.window().coverage(static_cast<int>(pixel.x()), static_cast<int>(pixel.y())) >= 1.0f;
      const double range = point.norm();
      const double cosine = -(cam_from_world.rotation * cell.normal).dot(point) / range;
      const bool should = is_in_picture && cosine > 0.0 && range < options.far_radii * wall.radius_mm() &&
                          !IsHidden(scene.colon().lumen(), from_mm, cell.arc_mm, cell.angle_rad);
      const SeenAs seen = wall.SeenAt(row, column);
      seen_and_should += should && seen != SeenAs::kNever ? 1 : 0;
      seen_only += !should && seen != SeenAs::kNever ? 1 : 0;
      should_only += should && seen == SeenAs::kNever ? 1 : 0;
      neither += !should && seen == SeenAs::kNever ? 1 : 0;
      if (!should || seen == SeenAs::kNever) continue;
      const bool is_well = range <= options.max_range_radii * wall.radius_mm() &&
                           cosine >= std::cos(options.max_slant_deg * std::numbers::pi / 180.0);
      well_and_should += is_well == (seen == SeenAs::kWell) ? 1 : 0;
      of_another_class += is_well == (seen == SeenAs::kWell) ? 0 : 1;
    }
  }
  // Cells at the edge of a shadow or of the window are half one and half the other.
  EXPECT_GT(seen_and_should, 400);
  EXPECT_GT(neither, 400);
  EXPECT_LT(seen_only, seen_and_should / 8);
  EXPECT_LT(should_only, seen_and_should / 8);
  EXPECT_GT(well_and_should, 300);
  EXPECT_LT(of_another_class, well_and_should / 15);
}

TEST(SeenWall, TwoHalvesMakeTheWhole) {
  const auto model = SequenceModel::Create(StraightColon());
  ASSERT_TRUE(model.ok());
  const SequenceModel& scene = **model;
  FrameRenderer renderer(scene.colon(), scene.mucosa(), scene.camera(), scene.window());
  SeenWall one(scene.colon().mesh(), CoverageOptions()), other = one, both = one;
  renderer.FindSeenWall(MomentOnAxis(scene, 20.0), &one);
  renderer.FindSeenWall(MomentOnAxis(scene, 40.0), &other);
  renderer.FindSeenWall(MomentOnAxis(scene, 40.0), &both);
  renderer.FindSeenWall(MomentOnAxis(scene, 20.0), &both);
  EXPECT_NE(one.Csv(), both.Csv());
  one.Add(other);
  EXPECT_EQ(one.Csv(), both.Csv());
}

TEST(SeenWall, FramesThatEventsHideShowNothing) {
  RenderOptions options = StraightColon();
  options.events = {{EventKind::kRedout, 1.0, 1.0}};
  const auto model = SequenceModel::Create(options);
  ASSERT_TRUE(model.ok());
  const SequenceModel& scene = **model;
  FrameRenderer renderer(scene.colon(), scene.mucosa(), scene.camera(), scene.window());
  const SeenWall nothing(scene.colon().mesh(), CoverageOptions());
  SeenWall wall = nothing;
  scene.FindSeenWall(static_cast<int>(1.5 * options.rate_hz), &renderer, &wall);
  EXPECT_EQ(wall.Csv(), nothing.Csv());
  scene.FindSeenWall(static_cast<int>(3.0 * options.rate_hz), &renderer, &wall);
  EXPECT_NE(wall.Csv(), nothing.Csv());
}

TEST(SeenWall, ATableHasALineForEachCell) {
  const auto model = SequenceModel::Create(StraightColon());
  ASSERT_TRUE(model.ok());
  SeenWall wall((*model)->colon().mesh(), CoverageOptions());
  const Eigen::Vector3d square = -wall.cell(3, 1).normal;
  for (int ring = 12; ring < 16; ++ring) {
    for (int vertex = 3; vertex < 6; ++vertex) wall.Note(ring, vertex, 10.0, square);
  }
  const std::string csv = wall.Csv();
  EXPECT_THAT(csv, StartsWith("row,column,arc_mm,angle_deg,x_mm,y_mm,z_mm,area_mm2,seen\n0,0,"));
  EXPECT_EQ(std::count(csv.begin(), csv.end(), '\n'), 1 + wall.num_rows() * SeenWall::kAngles);
  EXPECT_EQ(wall.SeenAt(3, 1), SeenAs::kWell);
  EXPECT_EQ(wall.SeenAt(3, 2), SeenAs::kNever);
  EXPECT_THAT(csv, HasSubstr(",well\n"));
  // From behind, and from too far, it is not seen; from a little too far poorly.
  wall.Note(20, 3, 10.0, wall.cell(5, 1).normal);
  for (int ring = 20; ring < 24; ++ring) {
    for (int vertex = 3; vertex < 6; ++vertex) wall.Note(ring, vertex, 7.0 * wall.radius_mm(), -wall.cell(5, 1).normal);
  }
  EXPECT_EQ(wall.SeenAt(5, 1), SeenAs::kNever);
  for (int ring = 20; ring < 24; ++ring) {
    for (int vertex = 3; vertex < 6; ++vertex) wall.Note(ring, vertex, 4.0 * wall.radius_mm(), -wall.cell(5, 1).normal);
  }
  EXPECT_EQ(wall.SeenAt(5, 1), SeenAs::kPoorly);
}

}  // namespace
}  // namespace haustra::render
