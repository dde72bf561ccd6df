// The geometry of the colon: smooth frames, a lumen that can be passed, a closed end, twins that are alike.
#include "tools/render/colon.h"

#include <gtest/gtest.h>

#include <Eigen/Geometry>
#include <algorithm>
#include <cmath>
#include <numbers>

namespace haustra::render {
namespace {

constexpr double kPi = std::numbers::pi;

ColonStyle Style(double length_mm) {
  ColonStyle style;
  style.length_mm = length_mm;
  return style;
}

TEST(Centreline, FramesAreOrthonormalAndArcLengthIsLength) {
  for (const std::uint64_t seed : {1u, 2u, 3u}) {
    Rng rng(seed);
    const Centreline curve(Centreline::Shape{}, rng);
    double length = 0.0;
    for (double s = 0.0; s < curve.length_mm() - 0.1; s += 0.1) {
      const CurveFrame f = curve.At(s);
      length += (curve.At(s + 0.1).position - f.position).norm();
      Eigen::Matrix3d axes;
      axes << f.normal, f.binormal, f.tangent;
      ASSERT_LT((axes.transpose() * axes - Eigen::Matrix3d::Identity()).norm(), 1e-9);
      ASSERT_NEAR(axes.determinant(), 1.0, 1e-9);
      // The curve runs along its tangent.
      ASSERT_GT((curve.At(s + 0.1).position - f.position).normalized().dot(f.tangent), 0.9999);
    }
    EXPECT_NEAR(length, curve.length_mm(), 0.2);
  }
}

TEST(Centreline, KeepsAwayFromItself) {
  for (const std::uint64_t seed : {1u, 2u, 3u, 4u}) {
    Rng rng(seed);
    Centreline::Shape shape;
    shape.length_mm = 400.0;
    const Centreline curve(shape, rng);
    for (double a = 0.0; a < 400.0; a += 5.0) {
      for (double b = a + 110.0; b < 400.0; b += 5.0) {
        ASSERT_GT((curve.At(a).position - curve.At(b).position).norm(), 50.0) << seed << " " << a << " " << b;
      }
    }
  }
}

TEST(Centreline, FlexuresTurnAsFarAsTheySay) {
  for (const std::uint64_t seed : {1u, 2u, 3u, 4u}) {
    Rng rng(seed);
    Centreline::Shape shape;
    shape.length_mm = 1500.0;
    shape.flexures = {{0.2, 120.0, 45.0}, {0.6, 90.0, 40.0}};
    const Centreline curve(shape, rng);
    for (const Flexure& flexure : shape.flexures) {
      const double half = flexure.turn_deg * kPi / 180.0 * flexure.radius_mm;
      double turned = 0.0, sharpest = 0.0;
      const double middle = flexure.at_share * shape.length_mm;
      for (double s = middle - half; s < middle + half; s += 1.0) {
        const double angle = std::acos(std::min(1.0, curve.At(s).tangent.dot(curve.At(s + 1.0).tangent)));
        turned += angle;
        sharpest = std::max(sharpest, angle);
      }
      const double whole =
          std::acos(curve.At(middle - 0.7 * half).tangent.dot(curve.At(middle + 0.7 * half).tangent)) * 180.0 / kPi;
      EXPECT_NEAR(whole, flexure.turn_deg, 0.2 * flexure.turn_deg) << seed;
      EXPECT_GE(turned * 180.0 / kPi, 0.95 * flexure.turn_deg) << seed;
      EXPECT_NEAR(1.0 / sharpest, flexure.radius_mm, 3.0) << seed;
    }
    for (double a = 0.0; a < 1500.0; a += 10.0) {
      for (double b = a + 110.0; b < 1500.0; b += 10.0) {
        ASSERT_GT((curve.At(a).position - curve.At(b).position).norm(), 50.0) << seed << " " << a << " " << b;
      }
    }
  }
}

TEST(LumenShape, LeavesRoomForTheScopeAndHasFolds) {
  for (const std::uint64_t seed : {1u, 2u, 3u}) {
    const Colon colon(Style(200.0), seed);
    double narrowest = 1e9, widest = 0.0;
    for (double s = 0.0; s < 180.0; s += 0.5) {
      for (double a = -kPi; a < kPi; a += 0.05) {
        const double r = colon.lumen().Radius(s, a);
        narrowest = std::min(narrowest, r);
        widest = std::max(widest, r);
      }
    }
    EXPECT_GT(narrowest, 9.5) << seed;
    EXPECT_LT(narrowest, 15.0) << seed;
    EXPECT_GT(widest, 21.0) << seed;
    EXPECT_LT(widest, 30.0) << seed;
  }
}

TEST(LumenShape, IsContinuousAroundTheGirth) {
  const Colon colon(Style(120.0), 5);
  for (double s = 0.0; s < 100.0; s += 1.7) {
    EXPECT_NEAR(colon.lumen().Radius(s, -kPi + 1e-6), colon.lumen().Radius(s, kPi - 1e-6), 1e-2) << s;
    for (double a = 0.0; a < 2.0 * kPi; a += 0.01) {
      EXPECT_NEAR(colon.lumen().Radius(s, a), colon.lumen().Radius(s, a + 1e-4), 2e-2) << s << " " << a;
    }
  }
}

TEST(ColonMesh, NormalsPointIntoTheLumen) {
  const Colon colon(Style(120.0), 2);
  const ColonMesh& mesh = colon.mesh();
  for (int i = 2; i + 2 < mesh.num_rings(); i += 5) {
    for (int j = 0; j < ColonMesh::kVerticesPerRing; j += 7) {
      // One step along the normal leads to the inside: nearer to the axis, or forward from a fold's face.
      const Eigen::Vector3d at = mesh.Position(i, j, 1.0);
      const Eigen::Vector3d normal = mesh.Normal(i, j).cast<double>();
      const Eigen::Vector3d inward = mesh.ring(i).frame.position - at;
      EXPECT_NEAR(normal.norm(), 1.0, 1e-5);
      if (mesh.ring(i).arc_mm < 95.0) {
        EXPECT_GT(normal.dot(inward), 0.0) << i << " " << j;
      }
    }
  }
}

TEST(ColonMesh, EndsInAClosedDome) {
  const Colon colon(Style(120.0), 3);
  const ColonMesh& mesh = colon.mesh();
  const int last = mesh.num_rings() - 1;
  for (int j = 0; j < ColonMesh::kVerticesPerRing; ++j) EXPECT_LT(mesh.Radius(last, j), 0.2);
  EXPECT_NEAR(mesh.ring(last).arc_mm, 120.0, 1e-9);
}

TEST(ColonMesh, SurfaceCoordinateIsInvertible) {
  const Colon colon(Style(120.0), 4);
  const ColonMesh& mesh = colon.mesh();
  for (double arc = 1.0; arc < 119.0; arc += 2.3) {
    EXPECT_NEAR(mesh.ArcAtSurface(mesh.SurfaceAtArc(arc)), arc, 1e-6);
  }
  // Folds make the wall longer than the axis.
  EXPECT_GT(mesh.surface_length_mm(), 140.0);
}

TEST(ColonMesh, ClearanceIsTheDistanceToTheWall) {
  const Colon colon(Style(120.0), 4);
  const CurveFrame frame = colon.centreline().At(60.0);
  const double at_axis = colon.mesh().Clearance(frame.position, 1.0);
  EXPECT_GT(at_axis, 9.0);
  EXPECT_LT(at_axis, 26.0);
  EXPECT_LT(colon.mesh().Clearance(frame.position + 5.0 * frame.normal, 1.0), at_axis + 5.0);
  EXPECT_LT(colon.mesh().Clearance(frame.position, 0.9), at_axis);
}

TEST(ColonMesh, AnotherDaysWallDiffersByTheShareAndKeepsItsMucosa) {
  ColonStyle style = Style(160.0);
  const Colon before(style, 4);
  style.remodel = 0.05;
  style.remodel_seed = 9;
  const Colon after(style, 4), again(style, 4);
  style.remodel_seed = 10;
  const Colon another(style, 4);
  double sum2 = 0.0, farthest = 0.0, apart = 0.0;
  int count = 0;
  for (int i = 0; i < before.mesh().num_rings(); ++i) {
    EXPECT_EQ(after.mesh().ring(i).surface_mm, before.mesh().ring(i).surface_mm);
    for (int j = 0; j < ColonMesh::kVerticesPerRing; ++j) {
      const double radius = before.mesh().Radius(i, j);
      const double change = after.mesh().Radius(i, j) / radius - 1.0;
      sum2 += change * change;
      ++count;
      farthest = std::max(farthest, std::abs(change));
      apart = std::max(apart, std::abs(after.mesh().Radius(i, j) - another.mesh().Radius(i, j)) / radius);
      ASSERT_EQ(after.mesh().Radius(i, j), again.mesh().Radius(i, j));
      // The scope passes where it passed before.
      ASSERT_GE(after.mesh().Radius(i, j), std::min(radius, style.lumen.min_opening_mm) - 1e-5);
      if (j == 0) continue;
      const double step = after.mesh().Radius(i, j - 1) / before.mesh().Radius(i, j - 1) - 1.0 - change;
      ASSERT_LT(std::abs(step), 0.03) << "a crack in the wall at " << i << " " << j;
    }
  }
  EXPECT_GT(std::sqrt(sum2 / count), 0.015);
  EXPECT_GT(farthest, 0.04);
  EXPECT_LE(farthest, 0.05 + 1e-6);
  EXPECT_GT(apart, 0.03);
}

TEST(Breathing, AtRestTheWallStays) { EXPECT_EQ(Breathing{}.Gain(50.0, 3.0), 1.0); }

TEST(Breathing, StaysWithinItsAmplitude) {
  Breathing breathing;
  breathing.amplitude = 0.04;
  breathing.wave_amplitude = 0.03;
  double low = 2.0, high = 0.0;
  for (double t = 0.0; t < 20.0; t += 0.05) {
    for (double s = 0.0; s < 200.0; s += 5.0) {
      low = std::min(low, breathing.Gain(s, t));
      high = std::max(high, breathing.Gain(s, t));
    }
  }
  EXPECT_GE(low, breathing.MinGain());
  EXPECT_LT(low, 0.95);
  EXPECT_GT(high, 1.03);
  EXPECT_LE(high, 1.04 + 1e-12);
}

TEST(Breathing, RingTravelsAlongTheWall) {
  Breathing breathing;
  breathing.wave_amplitude = 0.12;
  double deepest = 1.0;
  for (double s = 0.0; s < 200.0; s += 1.0) {
    EXPECT_NEAR(breathing.Gain(s, 2.0), breathing.Gain(s - 3.0 * breathing.wave_speed_mm_per_s, 5.0), 1e-12);
    deepest = std::min(deepest, breathing.Gain(s, 2.0));
  }
  EXPECT_NEAR(deepest, 0.88, 0.005);
}

TEST(Breathing, TangentialMotionKeepsTheRadiusAndTheOrderOfTheRings) {
  const Colon colon(Style(120.0), 2);
  const ColonMesh& mesh = colon.mesh();
  Breathing breathing;
  breathing.tangential = Breathing::kMaxAmplitude;
  double farthest = 0.0;
  for (const double t : {0.0, 1.3, 4.1}) {
    for (int i = 0; i + 1 < mesh.num_rings(); ++i) {
      const WallMotion motion = breathing.Motion(mesh.ring(i).arc_mm, t);
      const WallMotion next = breathing.Motion(mesh.ring(i + 1).arc_mm, t);
      EXPECT_EQ(motion.gain, 1.0);
      const Eigen::Vector3d from_axis = mesh.Moved(i, 7, motion) - mesh.ring(i).frame.position;
      const double along = from_axis.dot(mesh.ring(i).frame.tangent);
      EXPECT_NEAR((from_axis - along * mesh.ring(i).frame.tangent).norm(), mesh.Radius(i, 7), 1e-6);
      EXPECT_GT(mesh.ring(i + 1).arc_mm + next.along_mm, mesh.ring(i).arc_mm + motion.along_mm);
      farthest = std::max(farthest, (mesh.Moved(i, 7, motion) - mesh.Position(i, 7, 1.0)).norm());
    }
  }
  EXPECT_GT(farthest, 0.15 * 22.0);
  EXPECT_LT(farthest, 1.8 * 0.15 * 22.0);
}

TEST(Breathing, WithoutTangentialMotionPlacesAreThoseOfTheGain) {
  const Colon colon(Style(120.0), 2);
  Breathing breathing;
  breathing.amplitude = 0.06;
  breathing.wave_amplitude = 0.12;
  for (int i = 0; i < colon.mesh().num_rings(); i += 9) {
    const WallMotion motion = breathing.Motion(colon.mesh().ring(i).arc_mm, 3.0);
    EXPECT_EQ(colon.mesh().Moved(i, 5, motion), colon.mesh().Position(i, 5, motion.gain));
    EXPECT_EQ(motion.gain, breathing.Gain(colon.mesh().ring(i).arc_mm, 3.0));
  }
}

TEST(TwinSegment, CopyHasTheShapeOfTheOriginal) {
  ColonStyle style = Style(240.0);
  style.twin.start_mm = 30.0;
  style.twin.offset_mm = 90.0;
  style.twin.length_mm = 40.0;
  const Colon colon(style, 6);
  double elsewhere = 0.0;
  for (double s = 36.0; s < 64.0; s += 0.7) {
    for (double a = 0.0; a < 6.2; a += 0.3) {
      EXPECT_NEAR(colon.lumen().Radius(s, a), colon.lumen().Radius(s + 90.0, a), 1e-9);
      elsewhere = std::max(elsewhere, std::abs(colon.lumen().Radius(s, a) - colon.lumen().Radius(s + 40.0, a)));
    }
  }
  EXPECT_GT(elsewhere, 2.0);  // the rest of the colon is not the same
  // The curve bends alike: relative poses inside the two segments agree.
  const CurveFrame a0 = colon.centreline().At(36.0), a1 = colon.centreline().At(62.0);
  const CurveFrame b0 = colon.centreline().At(126.0), b1 = colon.centreline().At(152.0);
  EXPECT_NEAR((a1.position - a0.position).dot(a0.normal), (b1.position - b0.position).dot(b0.normal), 0.02);
  EXPECT_NEAR((a1.position - a0.position).dot(a0.tangent), (b1.position - b0.position).dot(b0.tangent), 0.02);
  EXPECT_GT((a0.position - b0.position).norm(), 50.0);
}

TEST(Colon, SeedsGiveDifferentColons) {
  const Colon a(Style(120.0), 1), again(Style(120.0), 1), b(Style(120.0), 2);
  double difference = 0.0;
  for (double s = 10.0; s < 100.0; s += 3.0) {
    EXPECT_EQ(a.lumen().Radius(s, 1.0), again.lumen().Radius(s, 1.0));
    difference = std::max(difference, std::abs(a.lumen().Radius(s, 1.0) - b.lumen().Radius(s, 1.0)));
  }
  EXPECT_GT(difference, 1.0);
}

}  // namespace
}  // namespace haustra::render
