// Pools of liquid, held against geometry that is worked out here: where they stand, that they are level however the
// scope is turned, what they hide, and how they look.
#include "tools/render/fluid_level.h"

#include <gtest/gtest.h>

#include <Eigen/Eigenvalues>
#include <algorithm>
#include <cmath>
#include <memory>
#include <numbers>

#include "engine/surface/depth_map.h"
#include "tools/render/liquid_look.h"
#include "tools/render/sequence_model.h"

namespace haustra::render {
namespace {

// How high liquid over place `i` can stand before it runs to a lower one; infinity where none is lower.
double SpillsAt(const std::vector<double>& floor, int i) {
  double spills = std::numeric_limits<double>::infinity();
  for (const int step : {-1, 1}) {
    double crest = floor[i];
    for (int k = i; k >= 0 && k < static_cast<int>(floor.size()); k += step) {
      crest = std::max(crest, floor[k]);
      if (floor[k] < floor[i]) {
        spills = std::min(spills, crest);
        break;
      }
    }
  }
  return spills;
}

TEST(FillPools, EachPoolIsAsDeepAsItCanBeAndNothingRunsOff) {
  Rng rng(7);
  int num_pools = 0, num_spilling = 0, num_joined = 0;
  for (int trial = 0; trial < 300; ++trial) {
    std::vector<double> floor(20 + trial % 60);
    for (std::size_t i = 0; i < floor.size(); ++i) floor[i] = rng.Uniform(0.0, 10.0) + trial % 5 * 0.05 * i;
    const double depth = rng.Uniform(0.5, 8.0);
    const std::vector<double> level = FillPools(floor, depth);
    const int count = static_cast<int>(floor.size());
    ASSERT_EQ(level.size(), floor.size());
    for (int i = 0; i < count;) {
      const bool is_hollow = (i == 0 || floor[i - 1] > floor[i]) && (i + 1 == count || floor[i + 1] > floor[i]);
      if (level[i] == FluidLevel::kDry) {
        EXPECT_FALSE(is_hollow) << "a hollow that is dry";
        ++i;
        continue;
      }
      int end = i, lowest = i, num_hollows = 0;
      while (end < count && level[end] != FluidLevel::kDry) {
        ASSERT_EQ(level[end], level[i]) << "one pool, one level";
        ASSERT_GT(level[end], floor[end]);
        if (floor[end] < floor[lowest]) lowest = end;
        num_hollows += end > i && end + 1 < count && floor[end] < floor[end - 1] && floor[end] < floor[end + 1] ? 1 : 0;
        ++end;
      }
      if (i > 0) {
        EXPECT_GE(floor[i - 1], level[i]);
      }
      if (end < count) {
        EXPECT_GE(floor[end], level[i]);
      }
      const double spills = SpillsAt(floor, lowest);
      EXPECT_DOUBLE_EQ(level[i], std::min(floor[lowest] + depth, spills));
      ++num_pools;
      num_spilling += spills < floor[lowest] + depth ? 1 : 0;
      num_joined += num_hollows > 1 ? 1 : 0;
      i = end;
    }
  }
  EXPECT_GT(num_pools, 1000);
  EXPECT_GT(num_spilling, 300);
  EXPECT_GT(num_joined, 100);
}

TEST(FluidLevel, GravityIsAcrossTheColonAndOfItsSeed) {
  for (const double curvature : {0.0, 1.0 / 65.0}) {
    double mean_along = 0.0;
    for (std::uint64_t seed = 1; seed <= 12; ++seed) {
      Rng rng(seed);
      Centreline::Shape shape;
      shape.max_curvature_per_mm = curvature;
      const Centreline centreline(shape, rng);
      const FluidLevel fluid(0.3, centreline, seed);
      EXPECT_NEAR(fluid.up().norm(), 1.0, 1e-12);
      EXPECT_NEAR(fluid.level_x().dot(fluid.up()), 0.0, 1e-12);
      EXPECT_NEAR(fluid.level_y().dot(fluid.up()), 0.0, 1e-12);
      EXPECT_NEAR(fluid.level_x().dot(fluid.level_y()), 0.0, 1e-12);
      EXPECT_EQ(fluid.up(), FluidLevel(0.1, centreline, seed).up());
      EXPECT_NE(fluid.up(), FluidLevel(0.3, centreline, seed + 1).up());
      for (double s = 5.0; s < 300.0; s += 10.0) {
        mean_along += std::abs(centreline.At(s).tangent.dot(fluid.up())) / (12 * 30);
      }
    }
    // 0.5 where it has nothing to do with the colon.
    EXPECT_LT(mean_along, curvature > 0.0 ? 0.3 : 0.1);
  }
}

RenderOptions StraightWithPools(double fluid) {
  RenderOptions options = RenderOptions::FromPreset(*FindPreset("clear"));
  options.seconds = 4.0;
  options.width_px = 240;
  options.height_px = 180;
  options.num_threads = 2;
  options.preset.colon.max_curvature_per_mm = 0.0;
  options.preset.blind_end_mm = 80.0;
  options.preset.colon.fluid = fluid;
  return options;
}

class PoolsTest : public testing::Test {
 protected:
  static constexpr int kStepPx = 2, kColumns = 120, kRows = 90;
  static constexpr double kFluid = 0.45;

  static void SetUpTestSuite() {
    dry_ = SequenceModel::Create(StraightWithPools(0.0))->release();
    wet_ = SequenceModel::Create(StraightWithPools(kFluid))->release();
  }
  static void TearDownTestSuite() {
    delete dry_;
    delete wet_;
  }

  // On the axis, looking along it and to one side, rolled.
  static ExposureMoment Rolled(double arc_mm, double roll_rad, double aside_rad) {
    const CurveFrame frame = wet_->colon().centreline().At(arc_mm);
    Eigen::Matrix3d axes;
    axes << frame.normal, frame.binormal, frame.tangent;
    ExposureMoment moment;
    moment.time_s = 1.0;
    moment.arc_mm = arc_mm;
    const Eigen::Quaterniond turned =
        ExpSO3(Eigen::Vector3d(0.0, 0.0, roll_rad)) * ExpSO3(Eigen::Vector3d(aside_rad, 0.0, 0.0));
    moment.world_from_cam = SE3(Eigen::Quaterniond(axes) * turned, frame.position);
    return moment;
  }
  static FrameRenderer Renderer(const SequenceModel& model) {
    return FrameRenderer(model.colon(), model.mucosa(), model.camera(), model.window());
  }

  // What the wall is at the cells of a picture, and whether liquid hides it.
  struct Place {
    int cell;
    Eigen::Vector3d point;  // world
    double along_mm;        // of the straight axis
    bool is_hidden;
  };
  static std::vector<Place> Look(const ExposureMoment& moment) {
    FrameRenderer dry_renderer = Renderer(*dry_), wet_renderer = Renderer(*wet_);
    std::vector<float> dry, wet;
    dry_renderer.MeasureRange(moment, kStepPx, &dry);
    wet_renderer.MeasureRange(moment, kStepPx, &wet);
    const CurveFrame begin = wet_->colon().centreline().At(0.0);
    std::vector<Place> places;
    for (int i = 0; i < kColumns * kRows; ++i) {
      if (dry[i] == 0.0f) {
        EXPECT_EQ(wet[i], 0.0f);
        continue;
      }
      if (wet[i] != 0.0f) {
        EXPECT_EQ(wet[i], dry[i]);
      }
      Eigen::Vector3d bearing;
      const Eigen::Vector2d pixel(CellCentrePx(i % kColumns, kStepPx), CellCentrePx(i / kColumns, kStepPx));
      if (!wet_->camera().Unproject(pixel, &bearing)) continue;
      const Eigen::Vector3d point = moment.world_from_cam * Eigen::Vector3d(dry[i] * bearing);
      places.push_back({i, point, (point - begin.position).dot(begin.tangent), wet[i] == 0.0f});
    }
    return places;
  }

  static inline SequenceModel *dry_ = nullptr, *wet_ = nullptr;
};

TEST_F(PoolsTest, SurfaceIsLevelHoweverTheScopeIsTurned) {
  // Stretches of 2 mm along the colon, as seen in all pictures together.
  constexpr double kStretchMm = 2.0;
  struct Stretch {
    double highest_hidden = -1e9, lowest_seen = 1e9;
    std::vector<Eigen::Vector3d> shore;
  };
  std::vector<Stretch> stretches(200);
  const Eigen::Vector3d up = wet_->colon().fluid().up();
  for (double roll_rad = 0.0; roll_rad < 15.0; roll_rad += 0.7) {
    const std::vector<Place> places = Look(Rolled(32.0 + roll_rad, roll_rad, 0.35));
    for (std::size_t k = 0; k < places.size(); ++k) {
      const Place& place = places[k];
      Stretch& stretch = stretches.at(static_cast<int>(place.along_mm / kStretchMm));
      double& bound = place.is_hidden ? stretch.highest_hidden : stretch.lowest_seen;
      const double height = up.dot(place.point);
      bound = place.is_hidden ? std::max(bound, height) : std::min(bound, height);
      if (k == 0 || places[k - 1].cell + 1 != place.cell || places[k - 1].is_hidden == place.is_hidden) continue;
      const Eigen::Vector3d step = place.point - places[k - 1].point;
      if (step.norm() < 1.0) stretch.shore.push_back(0.5 * (place.point + places[k - 1].point));
    }
  }
  int num_level = 0, num_wet = 0, num_planes = 0;
  for (const Stretch& stretch : stretches) {
    if (stretch.shore.size() < 25) continue;
    ++num_wet;
    // Between two pools a crest stands in a stretch.
    num_level += stretch.highest_hidden - stretch.lowest_seen < 0.05 ? 1 : 0;
  }
  EXPECT_GT(num_wet, 8);
  EXPECT_GT(num_level, num_wet * 3 / 4);

  // Without asking for gravity: the shores of neighbouring stretches that share a level lie in one plane, across it.
  for (std::size_t first = 0; first + 5 < stretches.size(); ++first) {
    std::vector<Eigen::Vector3d> shore;
    double lowest = 1e9, highest = -1e9;
    for (std::size_t i = first; i < first + 5; ++i) {
      for (const Eigen::Vector3d& point : stretches[i].shore) {
        shore.push_back(point);
        lowest = std::min(lowest, up.dot(point));
        highest = std::max(highest, up.dot(point));
      }
    }
    if (shore.size() < 150) continue;
    Eigen::Vector3d mean = Eigen::Vector3d::Zero();
    for (const Eigen::Vector3d& point : shore) mean += point / static_cast<double>(shore.size());
    Eigen::Matrix3d spread = Eigen::Matrix3d::Zero();
    for (const Eigen::Vector3d& point : shore) spread += (point - mean) * (point - mean).transpose();
    spread /= static_cast<double>(shore.size());
    const Eigen::SelfAdjointEigenSolver<Eigen::Matrix3d> solver(spread);
    // Two pools, or only one of the two shores: not one plane.
    if (std::sqrt(solver.eigenvalues()[0]) > 0.2 || std::sqrt(solver.eigenvalues()[1]) < 2.0) continue;
    ++num_planes;
    EXPECT_GT(std::abs(solver.eigenvectors().col(0).dot(up)), std::cos(2.0 * std::numbers::pi / 180.0));
  }
  EXPECT_GT(num_planes, 2);
}

TEST_F(PoolsTest, HidesTheLowSideAndNothingElse) {
  int num_hidden = 0, num_seen = 0;
  std::vector<double> level_mm;
  const Colon& colon = wet_->colon();
  colon.fluid().FindLevels(colon.mesh(), colon.style().breathing, 1.0, &level_mm);
  for (const double roll_rad : {0.0, 1.3, 2.9, 4.4}) {
    for (const Place& place : Look(Rolled(34.0 + roll_rad, roll_rad, 0.3))) {
      // The liquid at the ring before it and the ring behind it, as far as they are at one.
      const int ring = colon.mesh().FirstRingFrom(place.along_mm);
      if (ring < 2 || ring + 2 > colon.mesh().num_rings()) continue;
      const double before = level_mm[ring - 2], after = level_mm[ring + 1];
      const double height = colon.fluid().up().dot(place.point);
      if (before != after) continue;
      if (height < before - 0.03) {
        EXPECT_TRUE(place.is_hidden) << place.cell;
      }
      if (height > before + 0.03) {
        EXPECT_FALSE(place.is_hidden) << place.cell;
      }
      num_hidden += place.is_hidden ? 1 : 0;
      num_seen += place.is_hidden ? 0 : 1;
    }
  }
  EXPECT_GT(num_hidden, 1500);
  EXPECT_GT(num_seen, 15000);
}

TEST_F(PoolsTest, WallBelowTheLiquidCountsAsNeverSeen) {
  SeenWall dry(dry_->colon().mesh(), CoverageOptions()), wet(wet_->colon().mesh(), CoverageOptions());
  for (const double roll_rad : {0.0, 1.6, 3.1, 4.7}) {
    FrameRenderer dry_renderer = Renderer(*dry_), wet_renderer = Renderer(*wet_);
    dry_renderer.FindSeenWall(Rolled(40.0, roll_rad, 0.3), &dry);
    wet_renderer.FindSeenWall(Rolled(40.0, roll_rad, 0.3), &wet);
  }
  const Colon& colon = wet_->colon();
  std::vector<double> level_mm;
  colon.fluid().FindLevels(colon.mesh(), colon.style().breathing, 1.0, &level_mm);
  int num_below = 0, num_above = 0;
  for (int row = 0; row < dry.num_rows(); ++row) {
    const auto [lowest, highest] = std::minmax_element(level_mm.begin() + row * SeenWall::kRings,
                                                       level_mm.begin() + (row + 1) * SeenWall::kRings + 1);
    for (int column = 0; column < SeenWall::kAngles; ++column) {
      if (dry.SeenAt(row, column) == SeenAs::kNever) {
        EXPECT_EQ(wet.SeenAt(row, column), SeenAs::kNever);
        continue;
      }
      const double height = colon.fluid().up().dot(dry.cell(row, column).position);
      // A cell is 2.2 mm wide.
      if (height < *lowest - 2.0) {
        ++num_below;
        EXPECT_EQ(wet.SeenAt(row, column), SeenAs::kNever);
      }
      if (height > *highest + 2.0) {
        ++num_above;
        EXPECT_EQ(wet.SeenAt(row, column), dry.SeenAt(row, column));
      }
    }
  }
  EXPECT_GT(num_below, 80);
  EXPECT_GT(num_above, 600);
}

TEST_F(PoolsTest, PicturesDifferWhereTheLiquidIsAndNowhereElse) {
  const ExposureMoment moment = Rolled(40.0, 0.4, 0.3);
  FrameRenderer dry_renderer = Renderer(*dry_), wet_renderer = Renderer(*wet_);
  LinearImage dry(240, 180), wet(240, 180);
  dry_renderer.Accumulate(std::span(&moment, 1), 1.0f, &dry);
  wet_renderer.Accumulate(std::span(&moment, 1), 1.0f, &wet);
  std::vector<int> hidden(kColumns * kRows, -1);
  for (const Place& place : Look(moment)) hidden[place.cell] = place.is_hidden ? 1 : 0;
  double dry_blue = 0.0, dry_green = 0.0, wet_blue = 0.0, wet_green = 0.0;
  int num_same = 0, num_changed = 0;
  for (int row = 1; row + 1 < kRows; ++row) {
    for (int column = 1; column + 1 < kColumns; ++column) {
      int num_hidden = 0, num_known = 0;
      for (int k = 0; k < 9; ++k) {
        const int at = hidden[(row + k / 3 - 1) * kColumns + column + k % 3 - 1];
        num_hidden += at == 1 ? 1 : 0;
        num_known += at >= 0 ? 1 : 0;
      }
      const int x = column * kStepPx, y = row * kStepPx;
      const float *a = dry.pixel(x, y), *b = wet.pixel(x, y);
      if (num_known < 9) continue;
      if (num_hidden == 0) {
        ASSERT_TRUE(std::equal(a, a + 3, b)) << x << " " << y;
        ++num_same;
      } else if (num_hidden == 9) {
        ASSERT_FALSE(std::equal(a, a + 3, b)) << x << " " << y;
        ++num_changed;
        dry_green += a[1], dry_blue += a[2];
        wet_green += b[1], wet_blue += b[2];
      }
    }
  }
  EXPECT_GT(num_same, 4000);
  EXPECT_GT(num_changed, 300);
  // Yellow-brown.
  EXPECT_LT(wet_blue / wet_green, 0.75 * dry_blue / dry_green);
}

TEST(FluidLevel, ScopeStaysAboveTheDeepestPools) {
  for (const char* name : {"standard", "breathing", "loop", "procedure"}) {
    for (std::uint64_t seed = 1; seed <= 4; ++seed) {
      RenderOptions options = RenderOptions::FromPreset(*FindPreset(name));
      options.seconds = std::min(options.seconds, 60.0);
      options.events = PlaceEvents(options.preset.events, options.seconds);
      options.preset.colon.fluid = FluidLevel::kMaxShare;
      options.preset.colon.breathing.pressure = {seed % 2 == 0 ? 0.4 : 0.0, 7.0};
      const Colon colon(ColonStyleFor(options), seed);
      const ScopePath path(options.preset.path, colon.centreline(), options.events, options.seconds, seed);
      std::vector<double> level_mm;
      double nearest_mm = 1e9;
      for (double t = 0.0; t < options.seconds; t += 0.9) {
        colon.fluid().FindLevels(colon.mesh(), colon.style().breathing, t, &level_mm);
        const int ring = colon.mesh().FirstRingFrom(path.ArcMm(t));
        for (int i = std::max(ring - 4, 0); i < ring + 4; ++i) {
          nearest_mm = std::min(nearest_mm, colon.fluid().up().dot(path.WorldFromCam(t).translation) - level_mm[i]);
        }
      }
      EXPECT_GT(nearest_mm, 1.0) << name << " " << seed;
    }
  }
}

TEST(FluidLevel, PoolsFollowAWallThatMoves) {
  ColonStyle style;
  style.fluid = 0.3;
  style.breathing.amplitude = 0.15;
  style.breathing.wave_amplitude = 0.1;
  style.breathing.pressure = {0.4, 8.0};
  const Colon colon(style, 2);
  const double turn = 2.0 * std::numbers::pi / ColonMesh::kVerticesPerRing;
  std::vector<double> level_mm;
  for (double time_s = 0.0; time_s < 8.0; time_s += 0.7) {
    colon.fluid().FindLevels(colon.mesh(), style.breathing, time_s, &level_mm);
    ASSERT_EQ(level_mm.size(), static_cast<std::size_t>(colon.mesh().num_rings()));
    double deepest = 0.0;
    for (std::size_t i = 0; i < level_mm.size(); ++i) {
      const CurveFrame& frame = colon.mesh().ring(i).frame;
      const double gain = style.breathing.Gain(colon.mesh().ring(i).arc_mm, time_s);
      double lowest = 1e9;
      for (int j = 0; j < ColonMesh::kVerticesPerRing; ++j) {
        const Eigen::Vector3d out = std::cos(j * turn) * frame.normal + std::sin(j * turn) * frame.binormal;
        const Eigen::Vector3d point = frame.position + gain * colon.mesh().Radius(i, j) * out;
        lowest = std::min(lowest, colon.fluid().up().dot(point));
      }
      if (level_mm[i] == FluidLevel::kDry) continue;
      EXPECT_GT(level_mm[i], lowest) << time_s << " " << i;
      deepest = std::max(deepest, level_mm[i] - lowest);
    }
    // Somewhere a pool is as deep as it was asked for.
    EXPECT_NEAR(deepest, 0.3 * 22.0 * style.breathing.pressure.RadiusGain(time_s), 1e-6) << time_s;
  }
}

TEST(FluidLevel, RipplesAreSmallSlowAndDrawnFromTheSeed) {
  Rng rng(1);
  const Centreline centreline(Centreline::Shape{}, rng);
  const FluidLevel fluid(0.3, centreline, 5), again(0.3, centreline, 5), other(0.3, centreline, 6);
  double sum_x = 0.0, sum_y = 0.0, square = 0.0, change = 0.0, averaged = 0.0;
  int count = 0, num_other = 0, num_foam = 0;
  for (double x = 0.0; x < 200.0; x += 1.7) {
    for (double y = 0.0; y < 200.0; y += 1.9) {
      const Eigen::Vector3d point = x * fluid.level_x() + y * fluid.level_y();
      const LiquidSurface now = fluid.SurfaceAt(point, 3.0, 0.05f), later = fluid.SurfaceAt(point, 3.04, 0.05f);
      const LiquidSurface same = again.SurfaceAt(point, 3.0, 0.05f);
      ASSERT_EQ(now.slope_x, same.slope_x);
      ASSERT_EQ(now.foam, same.foam);
      // How high above the level a point is does not matter.
      ASSERT_NEAR(fluid.SurfaceAt(point + 30.0 * fluid.up(), 3.0, 0.05f).slope_y, now.slope_y, 1e-4f);
      num_other += now.slope_x != other.SurfaceAt(point, 3.0, 0.05f).slope_x ? 1 : 0;
      num_foam += now.foam > 0.0f ? 1 : 0;
      if (now.foam > 0.0f || later.foam > 0.0f) continue;
      ++count;
      sum_x += now.slope_x;
      sum_y += now.slope_y;
      square += now.slope_x * now.slope_x + now.slope_y * now.slope_y;
      change += std::pow(now.slope_x - later.slope_x, 2.0) + std::pow(now.slope_y - later.slope_y, 2.0);
      const LiquidSurface far = fluid.SurfaceAt(point, 3.0, 15.0f);
      if (far.foam == 0.0f) averaged += far.slope_x * far.slope_x + far.slope_y * far.slope_y;
    }
  }
  EXPECT_NEAR(sum_x / count, 0.0, 0.005);
  EXPECT_NEAR(sum_y / count, 0.0, 0.005);
  EXPECT_NEAR(std::sqrt(square / count), 0.06, 0.012);
  // From one frame to the next the ripples go on a little.
  EXPECT_GT(change, 1e-3 * square);
  EXPECT_LT(change, 0.3 * square);
  // A pixel as long as the ripples does not show them.
  EXPECT_LT(averaged, 0.05 * square);
  EXPECT_GT(num_other, count / 2);
  EXPECT_GT(num_foam, 20);
  EXPECT_LT(num_foam, count / 4);
}

TEST(LiquidLook, LightIsLostByTheLawOfBeerAndLambertAndMirroredByThatOfFresnel) {
  const LiquidSurface still;
  const LiquidLook none = LookInto(still, 0.0f, 1.0f, 1.0f), two = LookInto(still, 2.0f, 1.0f, 1.0f);
  const LiquidLook three = LookInto(still, 3.0f, 1.0f, 1.0f), five = LookInto(still, 5.0f, 1.0f, 1.0f);
  const LiquidLook deep = LookInto(still, 80.0f, 1.0f, 1.0f);
  for (int c = 0; c < 3; ++c) {
    EXPECT_NEAR(five.through[c] * none.through[c], two.through[c] * three.through[c], 1e-5f);
    EXPECT_LT(deep.through[c], 1e-3f);
    EXPECT_GT(deep.sample.rgb[c], five.sample.rgb[c]);
    // Water mirrors 2 % of light that falls straight on it, in and out.
    EXPECT_NEAR(none.through[c], 0.98f * 0.98f, 0.004f);
    EXPECT_LT(LookInto(still, 0.0f, 0.0f, 0.3f).through[c], 1e-6f);
    EXPECT_LT(LookInto(still, 0.0f, 0.2f, 0.3f).through[c], LookInto(still, 0.0f, 0.5f, 0.3f).through[c]);
  }
  // Yellow-brown: red more than green, green far more than blue.
  EXPECT_GT(deep.sample.rgb[0], 1.3f * deep.sample.rgb[1]);
  EXPECT_GT(deep.sample.rgb[1], 2.0f * deep.sample.rgb[2]);
  EXPECT_GT(five.through[0], five.through[1]);
  EXPECT_GT(five.through[1], five.through[2]);
}

}  // namespace
}  // namespace haustra::render
