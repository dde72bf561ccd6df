#include "tools/render/projected_mesh.h"

#include <Eigen/Geometry>
#include <algorithm>

namespace haustra::render {
namespace {

// What lies farther back can be seen only by a camera that looks back; what lies farther ahead is too dark to see.
constexpr double kBehindMm = 45.0;
constexpr double kAheadMm = 170.0;
// Each step leaves the share of the picture by which it moves while it is read out: a hundredth of a pixel at the end.
constexpr int kRowSteps = 4;

}  // namespace

void ProjectedMesh::Project(const Colon& colon, const CameraModel& camera, std::span<const ExposureMoment> rows_seen) {
  const ColonMesh& mesh = colon.mesh();
  const ExposureMoment& middle = rows_seen[rows_seen.size() / 2];
  const int begin = mesh.FirstRingFrom(middle.arc_mm - kBehindMm);
  const int end = mesh.FirstRingFrom(middle.arc_mm + kAheadMm);
  const SE3 cam_from_world = middle.world_from_cam.Inverse();
  const Eigen::Matrix3d rotation = cam_from_world.matrix3();
  const Eigen::Matrix3f rotation_f = rotation.cast<float>();
  const Breathing& breathing = colon.style().breathing;
  const Eigen::Quaterniond& world_from_middle = middle.world_from_cam.rotation;
  std::vector<SE3> row_from_world;
  if (rows_seen.size() > 1) {
    for (const ExposureMoment& row : rows_seen) row_from_world.push_back(row.world_from_cam.Inverse());
  }

  first_ring = begin;
  rings.resize(std::max(end - begin, 0));
  vertices.resize(rings.size() * kM);
  for (int i = 0; i < num_rings(); ++i) {
    const ColonMesh::Ring& ring = mesh.ring(begin + i);
    rings[i].axis = (rotation * ring.frame.tangent).cast<float>();
    rings[i].surface_mm = static_cast<float>(ring.surface_mm);
    const WallMotion motion = breathing.Motion(ring.arc_mm, middle.time_s);
    Eigen::Matrix3f turned = rotation_f;
    if (motion.around_rad != 0.0) {
      turned = (rotation * Eigen::AngleAxisd(motion.around_rad, ring.frame.tangent).toRotationMatrix()).cast<float>();
    }
    for (int j = 0; j < kM; ++j) {
      Eigen::Vector3d position = rotation * mesh.Moved(begin + i, j, motion) + cam_from_world.translation;
      Vertex& vertex = vertices[std::size_t(i) * kM + j];
      vertex.normal = turned * mesh.Normal(begin + i, j);
      vertex.radius_mm = static_cast<float>(motion.gain * mesh.Radius(begin + i, j));
      vertex.openness = mesh.Openness(begin + i, j);
      Eigen::Vector2d pixel;
      // The half space behind the camera is cheap to reject before the model is asked.
      vertex.in_front = position.z() > 0.0 && camera.Project(position, &pixel);
      int row_seen = -1;
      // Where a point is seen depends on the row that sees it, and the row on where it is seen.
      for (int step = 0; step < kRowSteps && vertex.in_front && !row_from_world.empty(); ++step) {
        const double row = std::clamp(pixel.y(), 0.0, static_cast<double>(rows_seen.size()) - 1.001);
        row_seen = static_cast<int>(row);
        const double share = row - row_seen;
        const ExposureMoment &above = rows_seen[row_seen], &below = rows_seen[row_seen + 1];
        const double time_s = above.time_s + share * (below.time_s - above.time_s);
        const Eigen::Vector3d in_world =
            mesh.Moved(begin + i, j, breathing.is_active() ? breathing.Motion(ring.arc_mm, time_s) : motion);
        position =
            (1.0 - share) * (row_from_world[row_seen] * in_world) + share * (row_from_world[row_seen + 1] * in_world);
        vertex.in_front = position.z() > 0.0 && camera.Project(position, &pixel);
      }
      if (row_seen >= 0) {
        vertex.normal =
            (row_from_world[row_seen].rotation * world_from_middle * vertex.normal.cast<double>()).cast<float>();
      }
      vertex.position = position.cast<float>();
      if (!vertex.in_front) continue;
      vertex.x_px = static_cast<float>(pixel.x());
      vertex.y_px = static_cast<float>(pixel.y());
      vertex.inverse_range = static_cast<float>(1.0 / position.norm());
    }
  }
}

}  // namespace haustra::render
