#include "tools/render/projected_mesh.h"

#include <algorithm>

namespace haustra::render {
namespace {

// What lies farther back can be seen only by a camera that looks back; what lies farther ahead is too dark to see.
constexpr double kBehindMm = 45.0;
constexpr double kAheadMm = 170.0;

}  // namespace

void ProjectedMesh::Project(const Colon& colon, const CameraModel& camera, const SE3& world_from_cam,
                            double camera_arc_mm, double time_s) {
  const ColonMesh& mesh = colon.mesh();
  const int begin = mesh.FirstRingFrom(camera_arc_mm - kBehindMm);
  const int end = mesh.FirstRingFrom(camera_arc_mm + kAheadMm);
  const SE3 cam_from_world = world_from_cam.Inverse();
  const Eigen::Matrix3d rotation = cam_from_world.matrix3();
  const Eigen::Matrix3f rotation_f = rotation.cast<float>();

  rings.resize(std::max(end - begin, 0));
  vertices.resize(rings.size() * kM);
  for (int i = 0; i < num_rings(); ++i) {
    const ColonMesh::Ring& ring = mesh.ring(begin + i);
    rings[i].axis = (rotation * ring.frame.tangent).cast<float>();
    rings[i].surface_mm = static_cast<float>(ring.surface_mm);
    const double gain = colon.style().breathing.Gain(ring.arc_mm, time_s);
    for (int j = 0; j < kM; ++j) {
      const Eigen::Vector3d position = rotation * mesh.Position(begin + i, j, gain) + cam_from_world.translation;
      Vertex& vertex = vertices[std::size_t(i) * kM + j];
      vertex.position = position.cast<float>();
      vertex.normal = rotation_f * mesh.Normal(begin + i, j);
      vertex.radius_mm = static_cast<float>(gain * mesh.Radius(begin + i, j));
      vertex.openness = mesh.Openness(begin + i, j);
      Eigen::Vector2d pixel;
      // The half space behind the camera is cheap to reject before the model is asked.
      vertex.in_front = position.z() > 0.0 && camera.Project(position, &pixel);
      if (!vertex.in_front) continue;
      vertex.x_px = static_cast<float>(pixel.x());
      vertex.y_px = static_cast<float>(pixel.y());
      vertex.inverse_range = static_cast<float>(1.0 / position.norm());
    }
  }
}

}  // namespace haustra::render
