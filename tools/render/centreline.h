// Centre line of the colon: a smooth space curve with a frame that follows it without twisting about the tangent
// (Bishop 1975, "There is more than one way to frame a curve"). Arc length in mm, world frame. reentrant.
#pragma once

#include <Eigen/Core>
#include <vector>

#include "engine/geometry/rng.h"
#include "tools/render/twin_segment.h"

namespace haustra::render {

struct CurveFrame {
  Eigen::Vector3d position;  // mm
  Eigen::Vector3d tangent;   // towards the blind end; (normal, binormal, tangent) is right-handed
  Eigen::Vector3d normal;
  Eigen::Vector3d binormal;
};

// A sharp bend, as between two parts of the colon.
struct Flexure {
  double at_share = 0.0;  // of the length
  double turn_deg = 90.0;
  double radius_mm = 45.0;  // where it is sharpest
};

class Centreline {
 public:
  struct Shape {
    double length_mm = 300.0;
    double max_curvature_per_mm = 1.0 / 65.0;
    double clearance_mm = 56.0;
    TwinSegment twin;
    std::vector<Flexure> flexures;
  };
  // A curve that keeps clearance_mm between parts that are not neighbours: random bends are drawn again, with less and
  // less curvature, until they do. The bends of the twin segment are repeated. A flexure bends one way, drawn, and
  // takes the place of the random bends there.
  Centreline(const Shape& shape, Rng& rng);

  double length_mm() const { return length_mm_; }
  // Clamped to the ends.
  CurveFrame At(double arc_mm) const;

 private:
  bool Build(const Shape& shape, double max_curvature, Rng& rng);

  double length_mm_;
  std::vector<CurveFrame> samples_;  // every kStepMm
};

}  // namespace haustra::render
