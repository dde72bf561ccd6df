// An instrument that comes out of the scope's channel: a shaft and two jaws that open and close. It moves on its own,
// hides the wall behind it, throws shadows on it, and is sharp. Camera coordinates, mm. Immutable; reentrant.
#pragma once

#include <Eigen/Core>
#include <array>
#include <cstdint>
#include <vector>

#include "tools/render/event_script.h"

namespace haustra::render {

// All points closer than the radius to the line from a to b.
struct Capsule {
  Eigen::Vector3f a = Eigen::Vector3f::Zero(), b = Eigen::Vector3f::Zero();
  float radius = 0.0f;
};

struct InstrumentHit {
  float range_mm = 0.0f;
  Eigen::Vector3f normal;  // unit, outwards
  float along_mm = 0.0f;   // from the part's a
  bool is_shaft = false;
};

// The instrument at one instant; no parts: it is not out.
struct InstrumentShape {
  int num_parts = 0;
  std::array<Capsule, 3> parts;  // the shaft, the jaws

  // Where a unit ray from the camera meets it first. False: nowhere.
  bool Meet(const Eigen::Vector3f& ray, InstrumentHit* hit) const;
  // Whether a ray passes as near as this share of the distance: never false where Meet is true.
  bool IsNear(const Eigen::Vector3f& ray, float margin_share) const;
  // Whether it stands between two points.
  bool IsBetween(const Eigen::Vector3f& from, const Eigen::Vector3f& to) const;
};

class Instrument {
 public:
  Instrument(const std::vector<Event>& events, std::uint64_t seed);

  InstrumentShape At(double time_s) const;

 private:
  struct Use {
    Event event;
    double phase_rad;
  };
  std::vector<Use> uses_;
};

}  // namespace haustra::render
