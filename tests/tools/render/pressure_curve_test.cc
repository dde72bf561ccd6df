// The lumen that closes as air is lost: how far, when, and that the scope has room.
#include "tools/render/pressure_curve.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>

#include "tools/render/projected_mesh.h"
#include "tools/render/sequence_model.h"

namespace haustra::render {
namespace {

TEST(PressureCurve, FallsToTheCollapseAndComesBackEveryPeriod) {
  const PressureCurve curve{0.3, 8.0};
  double low = 2.0, high = 0.0, steepest = 0.0;
  for (double t = 0.0; t < 24.0; t += 0.01) {
    const double gain = curve.RadiusGain(t);
    low = std::min(low, gain);
    high = std::max(high, gain);
    EXPECT_NEAR(curve.RadiusGain(t + 8.0), gain, 1e-9);
    steepest = std::max(steepest, std::abs(curve.RadiusGain(t + 0.01) - gain) / 0.01);
  }
  EXPECT_NEAR(low, 0.7, 1e-6);
  EXPECT_NEAR(high, 1.0, 1e-6);
  // Insufflation takes 30 % of the period; no jump.
  EXPECT_LT(steepest, 2.0 * 0.3 / (0.3 * 8.0));
  EXPECT_EQ(curve.RadiusGain(0.0), 1.0);
  EXPECT_EQ((PressureCurve{0.0, 8.0}.RadiusGain(5.0)), 1.0);
}

RenderOptions Collapsing(double collapse, std::uint64_t seed) {
  RenderOptions options = RenderOptions::FromPreset(*FindPreset("clear"));
  options.seconds = 10.0;
  options.width_px = 96;
  options.height_px = 72;
  options.seed = seed;
  options.num_threads = 2;
  options.preset.colon.breathing.pressure = {collapse, 10.0};
  return options;
}

// Distances from the centre line, measured on the mesh that is drawn.
TEST(PressureCurve, EveryPlaceOfTheWallComesNearerToTheCentreLineByThatShare) {
  const Colon colon(ColonStyleFor(Collapsing(0.35, 1)), 1);
  const auto camera = CameraModel::Create(CalibrationFor(96, 72, 25.0));
  ASSERT_TRUE(camera.ok());
  ProjectedMesh open, closed;
  ExposureMoment moment;
  moment.arc_mm = 60.0;
  open.Project(colon, *camera, {&moment, 1});
  moment.time_s = 6.5;
  closed.Project(colon, *camera, {&moment, 1});
  ASSERT_EQ(open.vertices.size(), closed.vertices.size());
  const int first = colon.mesh().FirstRingFrom(60.0 - 45.0);
  for (int i = 0; i < open.num_rings(); i += 7) {
    const Eigen::Vector3f centre = colon.mesh().ring(first + i).frame.position.cast<float>();
    for (int j = 0; j < ProjectedMesh::kM; j += 11) {
      const auto index = std::size_t(i) * ProjectedMesh::kM + j;
      const float before = (open.vertices[index].position - centre).norm();
      ASSERT_NEAR((closed.vertices[index].position - centre).norm(), 0.65f * before, 1e-3f * before + 1e-3f);
    }
  }
}

TEST(PressureCurve, ScopeHasRoomInTheNarrowestLumen) {
  for (const std::uint64_t seed : {1u, 2u, 3u}) {
    RenderOptions options = Collapsing(PressureCurve::kMaxCollapse, seed);
    const Colon colon(ColonStyleFor(options), seed);
    const ScopePath path(options.preset.path, colon.centreline(), {}, options.seconds, seed);
    const double gain = colon.style().breathing.MinGain();
    EXPECT_NEAR(gain, 0.6, 1e-9);
    for (double t = 0.0; t < 10.0; t += 0.5) {
      EXPECT_GT(colon.mesh().Clearance(path.WorldFromCam(t).translation, gain), 1.0) << seed << " " << t;
    }
  }
}

TEST(PressureCurve, WhatIsOutOfRangeIsNamed) {
  EXPECT_FALSE(Collapsing(0.41, 1).Validate().ok());
  RenderOptions options = Collapsing(0.2, 1);
  EXPECT_TRUE(options.Validate().ok());
  options.preset.colon.breathing.pressure.period_s = 1.0;
  EXPECT_NE(options.Validate().message().find("period"), std::string::npos);
}

}  // namespace
}  // namespace haustra::render
