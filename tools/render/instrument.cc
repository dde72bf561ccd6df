#include "tools/render/instrument.h"

#include <Eigen/Geometry>
#include <algorithm>
#include <cmath>
#include <numbers>

#include "engine/geometry/rng.h"

namespace haustra::render {
namespace {

constexpr float kShaftRadiusMm = 1.2f, kJawRadiusMm = 0.5f, kJawLengthMm = 4.6f;
constexpr double kSlideS = 0.6;  // that it takes to come out
constexpr double kTurn = 2.0 * std::numbers::pi;

// Smallest t >= 0 at which t * ray is as far as the radius from a point; below 0: never.
float MeetBall(const Eigen::Vector3f& ray, const Eigen::Vector3f& centre, float radius) {
  const float along = ray.dot(centre);
  const float square = along * along - centre.squaredNorm() + radius * radius;
  return square < 0.0f ? -1.0f : along - std::sqrt(square);
}

float MeetCapsule(const Eigen::Vector3f& ray, const Capsule& part) {
  const Eigen::Vector3f axis = part.b - part.a;
  const float length = axis.norm();
  const Eigen::Vector3f u = axis / length;
  // What is left of ray and start without the axis: a circle in the plane.
  const Eigen::Vector3f ray_across = ray - ray.dot(u) * u, a_across = part.a - part.a.dot(u) * u;
  const float square = ray_across.squaredNorm(), along = ray_across.dot(a_across);
  if (square > 1e-12f) {
    const float root = along * along - square * (a_across.squaredNorm() - part.radius * part.radius);
    if (root < 0.0f) return -1.0f;
    const float t = (along - std::sqrt(root)) / square;
    const float place = t * ray.dot(u) - part.a.dot(u);
    if (place >= 0.0f && place <= length) return t;
    return MeetBall(ray, place < 0.0f ? part.a : part.b, part.radius);
  }
  return MeetBall(ray, ray.dot(part.a) < ray.dot(part.b) ? part.a : part.b, part.radius);
}

// Squared distance of two line segments (Ericson 2004, "Real-Time Collision Detection", closest points by clamping).
float SquaredDistance(const Eigen::Vector3f& p0, const Eigen::Vector3f& p1, const Capsule& part) {
  const Eigen::Vector3f d1 = p1 - p0, d2 = part.b - part.a, r = p0 - part.a;
  const float a = d1.squaredNorm(), e = d2.squaredNorm(), f = d2.dot(r), c = d1.dot(r), b = d1.dot(d2);
  const float denominator = a * e - b * b;
  float s = denominator > 1e-9f ? std::clamp((b * f - c * e) / denominator, 0.0f, 1.0f) : 0.0f;
  float t = (b * s + f) / e;
  if (t < 0.0f || t > 1.0f) {
    t = std::clamp(t, 0.0f, 1.0f);
    s = std::clamp((b * t - c) / a, 0.0f, 1.0f);
  }
  return (p0 + s * d1 - part.a - t * d2).squaredNorm();
}

}  // namespace

bool InstrumentShape::Meet(const Eigen::Vector3f& ray, InstrumentHit* hit) const {
  bool meets = false;
  for (int i = 0; i < num_parts; ++i) {
    const float range = MeetCapsule(ray, parts[i]);
    if (range <= 0.0f || (meets && range >= hit->range_mm)) continue;
    meets = true;
    const Eigen::Vector3f axis = parts[i].b - parts[i].a, point = range * ray;
    const float share = std::clamp((point - parts[i].a).dot(axis) / axis.squaredNorm(), 0.0f, 1.0f);
    hit->range_mm = range;
    hit->normal = (point - parts[i].a - share * axis).normalized();
    hit->along_mm = share * axis.norm();
    hit->is_shaft = i == 0;
  }
  return meets;
}

bool InstrumentShape::IsNear(const Eigen::Vector3f& ray, float margin_share) const {
  for (int i = 0; i < num_parts; ++i) {
    Capsule wide = parts[i];
    wide.radius += margin_share * std::max(wide.a.norm(), wide.b.norm());
    if (MeetCapsule(ray, wide) > 0.0f) return true;
  }
  return false;
}

bool InstrumentShape::IsBetween(const Eigen::Vector3f& from, const Eigen::Vector3f& to) const {
  for (int i = 0; i < num_parts; ++i) {
    if (SquaredDistance(from, to, parts[i]) < parts[i].radius * parts[i].radius) return true;
  }
  return false;
}

Instrument::Instrument(const std::vector<Event>& events, std::uint64_t seed) {
  Rng rng(seed, 0x7001);
  for (const Event& event : events) {
    if (event.kind == EventKind::kInstrument) uses_.push_back({event, rng.Uniform(0.0, kTurn)});
  }
}

InstrumentShape Instrument::At(double time_s) const {
  InstrumentShape shape;
  for (const Use& use : uses_) {
    const double since = time_s - use.event.start_s, left = use.event.duration_s - since;
    if (since <= 0.0 || left <= 0.0) continue;
    const double x = std::clamp(std::min(since, left) / kSlideS, 0.0, 1.0);
    const double out = x * x * (3.0 - 2.0 * x);
    // Forth and back, to the sides, and the jaws: each with a rhythm of its own.
    const double reach = 10.5 + 2.5 * std::sin(kTurn * 0.43 * since + use.phase_rad);
    const double side = 0.9 * std::sin(kTurn * 0.31 * since), up = 0.7 * std::sin(kTurn * 0.22 * since + 1.0);
    const double opening = 0.32 * (1.0 - std::cos(kTurn * 0.7 * since));  // rad, of each jaw
    const Eigen::Vector3d root(1.9, 4.1, -4.0);
    const Eigen::Vector3d direction = Eigen::Vector3d(-0.9 + side, -2.2 + up, 15.0).normalized();
    const Eigen::Vector3d tip = root + out * (reach + 4.0) * direction;
    const Eigen::Vector3d across = direction.cross(Eigen::Vector3d(0.8, 0.6, 0.0)).normalized();
    shape.num_parts = 3;
    shape.parts[0] = {root.cast<float>(), (tip + 1e-3 * direction).cast<float>(), kShaftRadiusMm};
    for (const int k : {0, 1}) {
      const double sign = k == 0 ? 1.0 : -1.0;
      const Eigen::Vector3d hinge = tip + sign * 0.45 * across + 0.6 * direction;
      const Eigen::Vector3d end =
          hinge + kJawLengthMm * (std::cos(opening) * direction + sign * std::sin(opening) * across);
      shape.parts[k + 1] = {hinge.cast<float>(), end.cast<float>(), kJawRadiusMm};
    }
  }
  return shape;
}

}  // namespace haustra::render
