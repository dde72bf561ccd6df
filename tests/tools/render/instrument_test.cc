// The instrument against marching along rays: where it is met, what it hides and shades, and when it is out.
#include "tools/render/instrument.h"

#include <gtest/gtest.h>

#include <Eigen/Geometry>
#include <algorithm>
#include <cmath>
#include <memory>

#include "engine/geometry/rng.h"
#include "tools/render/sequence_model.h"

namespace haustra::render {
namespace {

const std::vector<Event> kUse = {{EventKind::kInstrument, 1.0, 4.0}};

float Distance(const Eigen::Vector3f& point, const Capsule& part) {
  float nearest = 1e9f;
  for (int i = 0; i <= 2000; ++i) {
    nearest = std::min(nearest, (part.a + (i / 2000.0f) * (part.b - part.a) - point).norm());
  }
  return nearest;
}

bool IsInside(const Eigen::Vector3f& point, const InstrumentShape& shape, float slack) {
  return std::any_of(shape.parts.begin(), shape.parts.begin() + shape.num_parts,
                     [&](const Capsule& part) { return Distance(point, part) < part.radius + slack; });
}

TEST(Instrument, IsOutWhileItsEventLasts) {
  const Instrument instrument(kUse, 1);
  EXPECT_EQ(instrument.At(0.99).num_parts, 0);
  EXPECT_EQ(instrument.At(5.01).num_parts, 0);
  EXPECT_EQ(Instrument({{EventKind::kRedout, 1.0, 4.0}}, 1).At(3.0).num_parts, 0);
  // It slides out and back in, and the jaws open and close.
  EXPECT_LT(instrument.At(1.01).parts[0].b.z(), 0.0f);
  EXPECT_LT(instrument.At(4.99).parts[0].b.z(), 0.0f);
  float narrowest = 1e9f, widest = 0.0f, nearest = 1e9f, farthest = 0.0f;
  for (double t = 1.7; t < 4.3; t += 0.05) {
    const InstrumentShape shape = instrument.At(t);
    ASSERT_EQ(shape.num_parts, 3);
    EXPECT_GT(shape.parts[0].b.z(), 5.0f);
    const float gap = (shape.parts[1].b - shape.parts[2].b).norm();
    narrowest = std::min(narrowest, gap);
    widest = std::max(widest, gap);
    nearest = std::min(nearest, shape.parts[0].b.z());
    farthest = std::max(farthest, shape.parts[0].b.z());
  }
  EXPECT_LT(narrowest, 1.5f);
  EXPECT_GT(widest, 5.0f);
  EXPECT_GT(farthest, nearest + 3.0f);
}

TEST(Instrument, RaysMeetItWhereTheyEnterIt) {
  const InstrumentShape shape = Instrument(kUse, 1).At(3.0);
  Rng rng(3);
  int num_met = 0, num_missed = 0;
  for (int k = 0; k < 150; ++k) {
    const Eigen::Vector3f ray =
        Eigen::Vector3d(rng.Uniform(-0.4, 0.6), rng.Uniform(-0.3, 0.7), 1.0).normalized().cast<float>();
    InstrumentHit hit;
    const bool meets = shape.Meet(ray, &hit);
    if (!meets) {
      ++num_missed;
      for (float t = 0.5f; t < 25.0f; t += 0.2f) ASSERT_FALSE(IsInside(t * ray, shape, -0.02f)) << k;
      continue;
    }
    ++num_met;
    EXPECT_TRUE(shape.IsNear(ray, 0.0f));
    EXPECT_TRUE(IsInside((hit.range_mm + 0.02f) * ray, shape, 0.01f)) << k;
    for (float t = 0.5f; t < hit.range_mm - 0.05f; t += 0.2f) ASSERT_FALSE(IsInside(t * ray, shape, 0.0f)) << k;
    EXPECT_NEAR(hit.normal.norm(), 1.0f, 1e-4f);
    EXPECT_LT(hit.normal.dot(ray), 1e-3f);
  }
  EXPECT_GT(num_met, 20);
  EXPECT_GT(num_missed, 20);
}

TEST(Instrument, StandsBetweenPointsWhoseLineMeetsIt) {
  const InstrumentShape shape = Instrument(kUse, 1).At(3.0);
  Rng rng(5);
  int num_between = 0, num_free = 0;
  for (int k = 0; k < 100; ++k) {
    const Eigen::Vector3f from = Eigen::Vector3d(rng.Uniform(-9, 9), rng.Uniform(-9, 9), 20.0).cast<float>();
    const Eigen::Vector3f to = Eigen::Vector3d(rng.Uniform(-3, 3), rng.Uniform(-3, 3), 0.0).cast<float>();
    bool enters = false, comes_near = false;
    for (float s = 0.0f; s <= 1.0f; s += 0.005f) {
      enters = enters || IsInside(from + s * (to - from), shape, 0.0f);
      comes_near = comes_near || IsInside(from + s * (to - from), shape, 0.06f);
    }
    const bool is_between = shape.IsBetween(from, to);
    if (enters) {
      EXPECT_TRUE(is_between) << k;
    }
    if (!comes_near) {
      EXPECT_FALSE(is_between) << k;
    }
    num_between += is_between ? 1 : 0;
    num_free += is_between ? 0 : 1;
  }
  EXPECT_GT(num_between, 10);
  EXPECT_GT(num_free, 10);
}

struct Taken {
  std::unique_ptr<SequenceModel> model;
  LinearImage light{240, 180};
};
Taken Take(const std::vector<Event>& events) {
  RenderOptions options = RenderOptions::FromPreset(*FindPreset("clear"));
  options.preset.path.start_arc_mm = 14.0;
  options.preset.blind_end_mm = 30.0;
  options.seconds = 5.0;
  options.width_px = 240;
  options.height_px = 180;
  options.num_threads = 2;
  options.events = events;
  Taken taken;
  taken.model = std::move(*SequenceModel::Create(options));
  FrameRenderer renderer(taken.model->colon(), taken.model->mucosa(), taken.model->camera(), taken.model->window());
  taken.model->Expose(3.0, &renderer, &taken.light);
  return taken;
}

TEST(Instrument, HidesAndShadesTheWallAndLeavesTheRest) {
  const Taken with = Take(kUse), without = Take({});
  // The path of the scope is the same.
  EXPECT_EQ(with.model->path().WorldFromCam(3.0).translation, without.model->path().WorldFromCam(3.0).translation);
  const InstrumentShape shape = Instrument(kUse, 1).At(3.0);
  int num_hidden = 0, num_shaded = 0, num_same = 0, num_brighter = 0, num_coloured = 0;
  for (int y = 0; y < 180; ++y) {
    for (int x = 0; x < 240; ++x) {
      if (with.model->window().coverage(x, y) < 1.0f) continue;
      Eigen::Vector3d ray;
      ASSERT_TRUE(with.model->camera().Unproject(Eigen::Vector2d(x, y), &ray));
      InstrumentHit hit;
      const bool is_on_it = shape.Meet(ray.normalized().cast<float>(), &hit);
      const bool is_near = shape.IsNear(ray.normalized().cast<float>(), 0.03f);
      const float *a = with.light.pixel(x, y), *b = without.light.pixel(x, y);
      const bool is_same = a[0] == b[0] && a[1] == b[1] && a[2] == b[2];
      if (is_on_it) {
        num_hidden += is_same ? 0 : 1;
        num_coloured += a[0] > 1.6f * a[2] + 0.02f ? 1 : 0;
      } else if (!is_near) {
        num_same += is_same ? 1 : 0;
        num_shaded += a[1] < 0.95f * b[1] ? 1 : 0;
        num_brighter += a[1] > 1.0001f * b[1] ? 1 : 0;
      }
    }
  }
  EXPECT_GT(num_hidden, 500);
  EXPECT_LT(num_coloured, 10);  // metal has no colour; its edge shows some wall
  EXPECT_GT(num_shaded, 300);
  EXPECT_GT(num_same, 10000);
  EXPECT_EQ(num_brighter, 0);
}

}  // namespace
}  // namespace haustra::render
