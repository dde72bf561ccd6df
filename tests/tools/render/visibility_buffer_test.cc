// What the rasteriser finds is compared with tracing the pixel's ray through every triangle of the mesh.
#include "tools/render/visibility_buffer.h"

#include <gtest/gtest.h>

#include <Eigen/Geometry>
#include <array>
#include <limits>

#include "tools/render/preset.h"
#include "tools/render/render_sequence.h"
#include "tools/render/sequence_model.h"

namespace haustra::render {
namespace {

// Distance along the ray to a triangle seen from its front, or infinity.
double Hit(const ProjectedMesh& mesh, std::uint32_t triangle, const Eigen::Vector3d& ray) {
  int corners[3];
  ProjectedMesh::Corners(triangle, corners);
  Eigen::Vector3d p[3];
  for (int k = 0; k < 3; ++k) p[k] = mesh.vertices[corners[k]].position.cast<double>();
  Eigen::Matrix3d system;
  system << p[1] - p[0], p[2] - p[0], -ray;
  const double determinant = system.determinant();
  if (std::abs(determinant) < 1e-14) return std::numeric_limits<double>::infinity();
  const Eigen::Vector3d solution = system.inverse() * -p[0];
  if (solution[0] < 0.0 || solution[1] < 0.0 || solution[0] + solution[1] > 1.0 || solution[2] <= 0.0) {
    return std::numeric_limits<double>::infinity();
  }
  const Eigen::Vector3d normal = (p[1] - p[0]).cross(p[2] - p[0]);
  const Eigen::Vector3d shading = mesh.vertices[corners[0]].normal.cast<double>();
  const double front = normal.dot(shading) > 0.0 ? 1.0 : -1.0;
  return front * normal.dot(ray) < 0.0 ? solution[2] : std::numeric_limits<double>::infinity();
}

TEST(VisibilityBuffer, FindsWhatRayTracingFinds) {
  RenderOptions options = RenderOptions::FromPreset(*FindPreset("clear"));
  options.seed = 8;
  const Colon colon(ColonStyleFor(options), options.seed);
  const ScopePath path(options.preset.path, colon.centreline(), {}, options.seconds, options.seed);
  const auto camera = CameraModel::Create(CalibrationFor(720, 540, 25.0));
  ASSERT_TRUE(camera.ok());
  VisibilityBuffer buffer(720, 540);
  ProjectedMesh mesh;
  Rng rng(4);
  int num_same = 0, num_compared = 0;
  for (const double t : {1.0, 9.0}) {
    mesh.Project(colon, *camera, std::array{ExposureMoment{t, path.ArcMm(t), path.WorldFromCam(t), false, {}}});
    buffer.Rasterise(mesh);
    for (int k = 0; k < 40; ++k) {
      const int i = 100 + static_cast<int>(rng.UniformInt(1240)), j = 100 + static_cast<int>(rng.UniformInt(880));
      Eigen::Vector3d ray;
      ASSERT_TRUE(camera->Unproject(Eigen::Vector2d(0.5 * (i - 0.5), 0.5 * (j - 0.5)), &ray));
      double nearest = std::numeric_limits<double>::infinity();
      const auto num_triangles = static_cast<std::uint32_t>(2 * ProjectedMesh::kM * (mesh.num_rings() - 1));
      for (std::uint32_t triangle = 0; triangle < num_triangles; ++triangle) {
        nearest = std::min(nearest, Hit(mesh, triangle, ray));
      }
      ASSERT_NE(buffer.triangle(i, j), VisibilityBuffer::kNothing) << i << " " << j;
      ++num_compared;
      if (std::abs(buffer.inverse_range(i, j) * nearest - 1.0) < 0.01) ++num_same;
    }
  }
  // A sample on the very crest of a fold may fall to the other side.
  EXPECT_GE(num_same, num_compared - 1);
}

TEST(VisibilityBuffer, LeavesNoHolesInTheWall) {
  RenderOptions options = RenderOptions::FromPreset(*FindPreset("standard"));  // the blind end closes the view
  options.seed = 2;
  const Colon colon(ColonStyleFor(options), options.seed);
  const ScopePath path(options.preset.path, colon.centreline(), {}, options.seconds, options.seed);
  const auto camera = CameraModel::Create(CalibrationFor(720, 540, 25.0));
  VisibilityBuffer buffer(720, 540);
  ProjectedMesh mesh;
  mesh.Project(colon, *camera, std::array{ExposureMoment{10.0, path.ArcMm(10.0), path.WorldFromCam(10.0), false, {}}});
  buffer.Rasterise(mesh);
  int num_holes = 0;
  for (int j = 0; j < 1080; ++j) {
    for (int i = 0; i < 1440; ++i) num_holes += buffer.triangle(i, j) == VisibilityBuffer::kNothing ? 1 : 0;
  }
  EXPECT_EQ(num_holes, 0);
}

}  // namespace
}  // namespace haustra::render
