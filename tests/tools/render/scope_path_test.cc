// The tip moves like a hand moves it, stays clear of the wall, and the events do what they say.
#include "tools/render/scope_path.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <numbers>

#include "tools/render/colon.h"
#include "tools/render/preset.h"
#include "tools/render/render_sequence.h"
#include "tools/render/revisits.h"
#include "tools/render/sequence_model.h"

namespace haustra::render {
namespace {

constexpr double kDegree = std::numbers::pi / 180.0;

struct Journey {
  explicit Journey(const RenderOptions& sequence)
      : options(sequence),
        colon(ColonStyleFor(sequence), sequence.seed),
        path(sequence.preset.path, colon.centreline(), sequence.events, sequence.seconds, sequence.seed) {}
  RenderOptions options;
  Colon colon;
  ScopePath path;
};

bool IsDuring(const std::vector<Event>& events, double t) {
  return std::any_of(events.begin(), events.end(),
                     [&](const Event& e) { return t > e.start_s - 0.1 && t < e.start_s + e.duration_s + 0.1; });
}

class EveryPreset : public testing::TestWithParam<std::string> {};

TEST_P(EveryPreset, KeepsClearOfTheWall) {
  for (const std::uint64_t seed : {1u, 5u}) {
    RenderOptions options = RenderOptions::FromPreset(*FindPreset(GetParam()));
    options.seed = seed;
    const Journey journey(options);
    const double gain = options.preset.colon.breathing.MinGain();
    for (double t = 0.0; t < options.seconds; t += 0.5) {
      const double clearance = journey.colon.mesh().Clearance(journey.path.WorldFromCam(t).translation, gain);
      EXPECT_GT(clearance, 3.0) << "seed " << seed << " at " << t << " s";
      EXPECT_LT(clearance, 30.0) << "seed " << seed << " at " << t << " s: not in the lumen";
    }
  }
}

TEST_P(EveryPreset, MeetsNoWallThatMovesAsFarAsItMay) {
  RenderOptions options = RenderOptions::FromPreset(*FindPreset(GetParam()));
  const Journey journey(options);
  const double gain = 1.0 - 2.0 * Breathing::kMaxAmplitude;
  for (double t = 0.0; t < options.seconds; t += 0.5) {
    const double clearance = journey.colon.mesh().Clearance(journey.path.WorldFromCam(t).translation, gain);
    EXPECT_GT(clearance, 1.0) << t << " s";
  }
}

TEST_P(EveryPreset, MovesLikeAHandBetweenEvents) {
  RenderOptions options = RenderOptions::FromPreset(*FindPreset(GetParam()));
  options.seed = 3;
  const Journey journey(options);
  const double dt = 1.0 / options.rate_hz;
  std::vector<double> speeds;
  for (double t = 0.0; t + dt < options.seconds; t += dt) {
    const SE3 a = journey.path.WorldFromCam(t), b = journey.path.WorldFromCam(t + dt);
    if (IsDuring(options.events, t)) continue;
    speeds.push_back((a.translation - b.translation).norm() / dt);
    EXPECT_LT(speeds.back(), 45.0) << "mm/s at " << t << " s";
    EXPECT_LT(RotationAngle(a.rotation, b.rotation) / dt, 60.0 * kDegree) << "rad/s at " << t << " s";
  }
  std::nth_element(speeds.begin(), speeds.begin() + speeds.size() / 2, speeds.end());
  // One that looks around turns rather than moves.
  EXPECT_GT(speeds[speeds.size() / 2],
            options.preset.path.rounds > 0.0 ? 2.0 : std::min(4.0, 0.8 * options.preset.path.speed_mm_per_s));
  EXPECT_LT(speeds[speeds.size() / 2], 15.0);
}

TEST_P(EveryPreset, SeesPlacesAgain) {
  RenderOptions options = RenderOptions::FromPreset(*FindPreset(GetParam()));
  const Journey journey(options);
  std::vector<SE3> poses;
  for (int i = 0; i < options.num_frames(); ++i) poses.push_back(journey.path.WorldFromCam(i / options.rate_hz));
  const auto revisits =
      FindRevisits(poses, options.rate_hz, FrameSpans(options.events, options.rate_hz, options.num_frames()));
  EXPECT_GE(revisits.size(), 3u);
}

INSTANTIATE_TEST_SUITE_P(Presets, EveryPreset, testing::ValuesIn([] {
                           std::vector<std::string> names;
                           for (const Preset& preset : Presets()) names.emplace_back(preset.name);
                           return names;
                         }()),
                         [](const auto& test) { return test.param; });

TEST(ScopePath, StandardGoesOutAndComesBack) {
  RenderOptions options = RenderOptions::FromPreset(*FindPreset("standard"));
  options.events.clear();
  const Journey journey(options);
  const double start = journey.path.ArcMm(0.0), middle = journey.path.ArcMm(10.0), end = journey.path.ArcMm(20.0);
  EXPECT_GT(middle - start, 60.0);
  EXPECT_LT(std::abs(end - start), 12.0);
}

TEST(ScopePath, LoopLooksAtTheWallAllTheWayRound) {
  RenderOptions options = RenderOptions::FromPreset(*FindPreset("loop"));
  const Journey journey(options);
  const double round_s = options.seconds / options.preset.path.rounds;
  const SE3 start = journey.path.WorldFromCam(0.0);
  const Eigen::Vector3d ahead = journey.colon.centreline().At(journey.path.ArcMm(0.0)).tangent;
  const Eigen::Vector3d axis = start.rotation * Eigen::Vector3d::UnitZ();
  EXPECT_LT(std::abs(axis.dot(ahead)), std::sin(30.0 * kDegree));
  const SE3 half = journey.path.WorldFromCam(0.5 * round_s), whole = journey.path.WorldFromCam(round_s);
  EXPECT_LT(axis.dot(half.rotation * Eigen::Vector3d::UnitZ()), std::cos(110.0 * kDegree));
  EXPECT_LT(RotationAngle(start.rotation, whole.rotation), 30.0 * kDegree);
  EXPECT_LT((start.translation - whole.translation).norm(), 15.0);
}

TEST(ScopePath, JumpIsFastAndWearsOff) {
  RenderOptions options = RenderOptions::FromPreset(*FindPreset("clear"));
  options.seconds = 30.0;
  const Journey calm(options);
  options.events = {{EventKind::kJump, 8.0, 0.44}};
  const Journey thrown(options);
  const auto apart_mm = [&](double t) {
    return (calm.path.WorldFromCam(t).translation - thrown.path.WorldFromCam(t).translation).norm();
  };
  EXPECT_LT(apart_mm(7.9), 0.5);
  EXPECT_GT(apart_mm(8.5), 15.0);
  EXPECT_LT(apart_mm(20.0), 0.5);
}

// The greatest angle between two looks at one place, on the way out and on the way back.
double GazeApartDeg(const RenderOptions& options) {
  const Journey journey(options);
  double greatest = 0.0;
  for (double out_s = 2.0; out_s < 0.4 * options.seconds; out_s += 0.5) {
    const double arc = journey.path.ArcMm(out_s);
    double back_s = 0.6 * options.seconds;
    for (double t = back_s; t < options.seconds; t += 0.1) {
      if (std::abs(journey.path.ArcMm(t) - arc) < std::abs(journey.path.ArcMm(back_s) - arc)) back_s = t;
    }
    greatest = std::max(
        greatest, RotationAngle(journey.path.WorldFromCam(out_s).rotation, journey.path.WorldFromCam(back_s).rotation));
  }
  return greatest / kDegree;
}

TEST(ScopePath, AnotherWayThroughLooksAnotherWay) {
  RenderOptions options = RenderOptions::FromPreset(*FindPreset("clear"));
  options.seconds = 40.0;
  options.preset.path.tremble_deg = 0.0;
  const double same = GazeApartDeg(options);
  options.preset.path.has_fresh_passes = true;
  const double fresh = GazeApartDeg(options);
  EXPECT_LT(same, 20.0);  // roll by time
  EXPECT_GT(fresh, same + 10.0);
  options.preset.path.pass_roll_deg = 90.0;
  EXPECT_GT(GazeApartDeg(options), fresh + 10.0);
}

TEST(ScopePath, SlipIsForGoodAndTheSameMotionGoesOn) {
  RenderOptions options = RenderOptions::FromPreset(*FindPreset("clear"));
  options.seconds = 40.0;
  int num_outwards = 0, num_inwards = 0;
  for (std::uint64_t seed = 1; seed <= 8; ++seed) {
    options.seed = seed;
    options.events = {};
    const Journey calm(options);
    options.events = {{EventKind::kSlip, 12.0, 0.3}};
    const Journey slipped(options);
    const auto farther_mm = [&](double t) { return slipped.path.ArcMm(t) - calm.path.ArcMm(t); };
    const SE3 before = slipped.path.WorldFromCam(11.99), calm_before = calm.path.WorldFromCam(11.99);
    EXPECT_EQ(before.translation, calm_before.translation);
    EXPECT_EQ(RotationAngle(before.rotation, calm_before.rotation), 0.0);
    const double slip_mm = farther_mm(12.31);
    EXPECT_GE(std::abs(slip_mm), 20.0 - 1e-9) << "seed " << seed;
    EXPECT_LE(std::abs(slip_mm), 45.0 + 1e-9) << "seed " << seed;
    for (double t = 12.4; t < 13.5; t += 0.1) EXPECT_NEAR(farther_mm(t), slip_mm, 1e-9);
    // What the far end of the reach holds back is not made up either.
    const double held_mm = slip_mm > 0.0 ? farther_mm(24.0) : slip_mm;
    EXPECT_LE(held_mm, slip_mm + 1e-9);
    for (double t = 24.0; t < 30.0; t += 0.5) EXPECT_NEAR(farther_mm(t), held_mm, 1e-9) << "seed " << seed;
    (slip_mm < 0.0 ? num_outwards : num_inwards) += 1;
  }
  EXPECT_GE(num_outwards, 2);
  EXPECT_GE(num_inwards, 1);
}

TEST(ScopePath, ManySlipsLeaveTheScopeInTheLumenAndMovingLikeAHand) {
  for (const char* preset : {"losses", "loop", "twins"}) {
    RenderOptions options = RenderOptions::FromPreset(*FindPreset(preset));
    options.events.clear();
    options.seed = 2;
    const double dt = 0.02;
    const auto acceleration = [&](const Journey& journey, double t) {
      return std::abs(journey.path.ArcMm(t - dt) - 2.0 * journey.path.ArcMm(t) + journey.path.ArcMm(t + dt)) /
             (dt * dt);
    };
    double calm_acceleration = 0.0;
    const Journey calm(options);
    for (double t = dt; t < options.seconds; t += dt)
      calm_acceleration = std::max(calm_acceleration, acceleration(calm, t));
    for (int k = 0; k < 6; ++k) options.events.push_back({EventKind::kSlip, 0.16 * (k + 0.5) * options.seconds, 0.3});
    const Journey journey(options);
    const double low = options.preset.path.start_arc_mm - 8.0;
    const double high = low + ScopePath::ReachMm(options.preset.path, options.seconds) + 16.0;
    for (double t = dt; t < options.seconds; t += dt) {
      const SE3 pose = journey.path.WorldFromCam(t);
      const double speed = (journey.path.ArcMm(t + dt) - journey.path.ArcMm(t)) / dt;
      EXPECT_GT(journey.colon.mesh().Clearance(pose.translation, 1.0), 2.5) << preset << ' ' << t << " s";
      EXPECT_LT(journey.colon.mesh().Clearance(pose.translation, 1.0), 30.0) << preset << ' ' << t << " s";
      EXPECT_GT(journey.path.ArcMm(t), low) << preset << ' ' << t << " s";
      EXPECT_LT(journey.path.ArcMm(t), high) << preset << ' ' << t << " s";
      // The steepest part of a slip of 45 mm in 0.3 s, and the hand.
      EXPECT_LT(std::abs(speed), 15.0 / 8.0 * 45.0 / 0.3 + 30.0) << preset << ' ' << t << " s";
      if (IsDuring(options.events, t)) continue;
      EXPECT_LT(std::abs(speed), 25.0) << preset << ' ' << t << " s";
      EXPECT_LT(acceleration(journey, t), calm_acceleration + 20.0) << preset << ' ' << t << " s";
    }
  }
}

TEST(ScopePath, SlippedScopeWaitsAtTheEndOfItsReachUntilTheMotionTurnsBack) {
  RenderOptions options = RenderOptions::FromPreset(*FindPreset("clear"));
  options.seconds = 60.0;  // in, out to where it began after half of the time, and the same again
  const double start = options.preset.path.start_arc_mm;
  for (std::uint64_t seed = 1; seed <= 4; ++seed) {
    options.seed = seed;
    options.events = {};
    const Journey calm(options);
    options.events = {{EventKind::kSlip, 20.0, 0.3}};
    const Journey slipped(options);
    const auto farther_mm = [&](double t) { return slipped.path.ArcMm(t) - calm.path.ArcMm(t); };
    for (double t = 0.0; t < options.seconds; t += 0.1) EXPECT_GT(slipped.path.ArcMm(t), start - 7.0) << t << " s";
    const double slip_mm = farther_mm(20.5), later_mm = farther_mm(34.0);
    if (slip_mm < 0.0) {
      EXPECT_GT(later_mm, slip_mm + 10.0) << "seed " << seed;
    }
    for (double t = 34.0; t < 40.0; t += 0.5) EXPECT_NEAR(farther_mm(t), later_mm, 1e-9) << "seed " << seed;
  }
}

TEST(ScopePath, SlipWithoutRoomLosesNoGround) {
  RenderOptions options = RenderOptions::FromPreset(*FindPreset("clear"));
  options.seconds = 1.0;  // less reach than a slip needs
  const Journey calm(options);
  options.events = {{EventKind::kSlip, 1e12, 1.0}, {EventKind::kSlip, 0.5, 1e-6}, {EventKind::kSlip, 0.2, 0.3}};
  const Journey slipped(options);
  for (double t = 0.0; t < 1.0; t += 0.01) EXPECT_NEAR(slipped.path.ArcMm(t), calm.path.ArcMm(t), 1e-9) << t;
  // The view is thrown about all the same.
  EXPECT_GT(RotationAngle(slipped.path.WorldFromCam(0.35).rotation, calm.path.WorldFromCam(0.35).rotation),
            5.0 * kDegree);
}

TEST(ScopePath, GroundThatAJumpHasLostIsMadeUpByHand) {
  RenderOptions options = RenderOptions::FromPreset(*FindPreset("clear"));
  options.seconds = 60.0;
  const Journey calm(options);
  options.events = {{EventKind::kJump, 20.0, 0.44}};
  options.preset.path.regain_s = 25.0;
  const Journey thrown(options);
  const auto behind_mm = [&](double t) { return calm.path.ArcMm(t) - thrown.path.ArcMm(t); };
  EXPECT_NEAR(behind_mm(19.9), 0.0, 1e-9);
  const double lost = behind_mm(20.5);
  EXPECT_GT(std::abs(lost), 15.0);
  EXPECT_GT(behind_mm(28.0) / lost, 0.6);
  EXPECT_NEAR(behind_mm(46.0), 0.0, 1e-9);
}

TEST(ScopePath, AnotherProcedureIsInTheSameColon) {
  RenderOptions options = RenderOptions::FromPreset(*FindPreset("standard"));
  options.width_px = 96, options.height_px = 72;
  options.seconds = 4.0;
  const auto first = SequenceModel::Create(options);
  options.path_seed = 5;
  const auto second = SequenceModel::Create(options);
  ASSERT_TRUE(first.ok() && second.ok());
  const ColonMesh &a = (*first)->colon().mesh(), &b = (*second)->colon().mesh();
  ASSERT_EQ(a.num_rings(), b.num_rings());
  for (int i = 0; i < a.num_rings(); i += 7) EXPECT_EQ(a.Position(i, 3, 1.0), b.Position(i, 3, 1.0));
  double apart = 0.0;
  for (double t = 0.0; t < options.seconds; t += 0.5) {
    const SE3 one = (*first)->path().WorldFromCam(t), other = (*second)->path().WorldFromCam(t);
    apart = std::max(apart, RotationAngle(one.rotation, other.rotation));
  }
  EXPECT_GT(apart, 10.0 * kDegree);
}

TEST(ScopePath, TheProcedureIsAColonOfFullLength) {
  const RenderOptions options = RenderOptions::FromPreset(*FindPreset("procedure"));
  const Journey journey(options);
  EXPECT_GT(journey.colon.style().length_mm, 1400.0);
  double farthest = 0.0;
  for (double t = 0.0; t < options.seconds; t += 1.0) farthest = std::max(farthest, journey.path.ArcMm(t));
  EXPECT_GT(farthest, 1250.0);
  EXPECT_NEAR(journey.path.ArcMm(options.seconds), journey.path.ArcMm(0.0), 40.0);
}

TEST(ScopePath, ShutterIsLongOnlyInABlurEvent) {
  RenderOptions options = RenderOptions::FromPreset(*FindPreset("clear"));
  options.events = {{EventKind::kBlur, 5.0, 1.0}};
  const Journey journey(options);
  EXPECT_LT(journey.path.ShutterS(4.9), 0.005);
  EXPECT_GT(journey.path.ShutterS(5.5), 0.02);
  EXPECT_LT(journey.path.ShutterS(6.1), 0.005);
}

TEST(ScopePath, LongSequencesRepeatTheirStopsInsteadOfGoingOnForEver) {
  PathStyle style;
  EXPECT_LE(ScopePath::ReachMm(style, 600.0), style.max_reach_mm + 1e-9);
  EXPECT_GT(ScopePath::ReachMm(style, 600.0), 0.5 * style.max_reach_mm);
  EXPECT_NEAR(ScopePath::ReachMm(style, 20.0), 0.5 * style.speed_mm_per_s * (20.0 - style.pause_s), 1e-9);
}

}  // namespace
}  // namespace haustra::render
