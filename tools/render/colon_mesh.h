// The wall of the colon as rings of vertices along the centre line, closed by a dome (the cecum). The mesh is the exact
// geometry of the scene: what a pixel shows is where its ray meets these triangles. World frame, mm. At rest; whoever
// wants it deformed says how. Immutable; reentrant.
#pragma once

#include <Eigen/Core>
#include <cmath>
#include <cstdint>
#include <vector>

#include "tools/render/breathing.h"
#include "tools/render/centreline.h"
#include "tools/render/lumen_shape.h"

namespace haustra::render {

class ColonMesh {
 public:
  static constexpr int kVerticesPerRing = 192;

  struct Ring {
    double arc_mm = 0.0;      // of the centre line
    double surface_mm = 0.0;  // along the wall, up and down the folds (mean over the ring): the texture's coordinate
    CurveFrame frame;
  };

  // The dome begins at length - dome_mm of the centre line.
  ColonMesh(const Centreline& centreline, const LumenShape& shape, double dome_mm);

  // Changes the radius by up to `share` of it, smoothly from place to place, drawn from the seed. Where the wall is
  // wider than min_radius_mm it stays so. Texture coordinates stay what they are: the mucosa goes with the wall.
  void Remodel(double share, std::uint64_t seed, double min_radius_mm);

  int num_rings() const { return static_cast<int>(rings_.size()); }
  const Ring& ring(int i) const { return rings_[i]; }
  // Index of the first ring at or beyond an arc length, at most num_rings().
  int FirstRingFrom(double arc_mm) const;
  double surface_length_mm() const { return rings_.back().surface_mm; }
  // Where the dome begins, and how long a way it is from the pole to there.
  double dome_surface_mm() const { return rings_[dome_ring_].surface_mm; }
  double dome_reach_mm() const { return surface_length_mm() - dome_surface_mm(); }
  // From one coordinate to the other, linear between rings, clamped to the ends.
  double SurfaceAtArc(double arc_mm) const;
  double ArcAtSurface(double surface_mm) const;

  // Position with the wall's radius scaled by `gain` (1: at rest).
  Eigen::Vector3d Position(int ring, int vertex, double gain) const {
    const CurveFrame& frame = rings_[ring].frame;
    const double r = gain * radius_[Index(ring, vertex)];
    return frame.position + r * (cosine_[vertex] * frame.normal + sine_[vertex] * frame.binormal);
  }
  // Position with the wall moved.
  Eigen::Vector3d Moved(int ring, int vertex, const WallMotion& motion) const {
    if (!motion.is_tangential()) return Position(ring, vertex, motion.gain);
    const CurveFrame& frame = rings_[ring].frame;
    const double r = motion.gain * radius_[Index(ring, vertex)];
    const double turn_c = std::cos(motion.around_rad), turn_s = std::sin(motion.around_rad);
    const double c = cosine_[vertex] * turn_c - sine_[vertex] * turn_s;
    const double s = sine_[vertex] * turn_c + cosine_[vertex] * turn_s;
    return frame.position + motion.along_mm * frame.tangent + r * (c * frame.normal + s * frame.binormal);
  }
  // Unit normal at rest, into the lumen.
  const Eigen::Vector3f& Normal(int ring, int vertex) const { return normal_[Index(ring, vertex)]; }
  // Share of light from all around that reaches the vertex: below 1 in the clefts behind folds.
  float Openness(int ring, int vertex) const { return openness_[Index(ring, vertex)]; }
  double Radius(int ring, int vertex) const { return radius_[Index(ring, vertex)]; }

  // Smallest distance from a point to a vertex of the rings within 60 mm of it, the wall scaled by `gain`.
  double Clearance(const Eigen::Vector3d& point_in_world, double gain) const;

 private:
  int Index(int ring, int vertex) const { return ring * kVerticesPerRing + vertex; }
  void MeasureSurface();
  void ComputeNormals();
  void ComputeOpenness();

  int dome_ring_ = 0;
  std::vector<Ring> rings_;
  std::vector<float> radius_;
  std::vector<Eigen::Vector3f> normal_;
  std::vector<float> openness_;
  std::vector<double> cosine_, sine_;
};

}  // namespace haustra::render
