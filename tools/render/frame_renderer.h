// One picture of the scene in linear light: visibility, exact ray against triangle, filtered mucosa, lighting; edges
// are smoothed with 2 x 2 samples. thread-bound(its owner): holds the scratch memory of one thread (about 40 MB at
// 720x540).
#pragma once

#include <Eigen/Core>
#include <limits>
#include <span>
#include <vector>

#include "engine/camera/camera_model.h"
#include "tools/render/colon.h"
#include "tools/render/exposure_moment.h"
#include "tools/render/lighting.h"
#include "tools/render/linear_image.h"
#include "tools/render/mucosa_texture.h"
#include "tools/render/projected_mesh.h"
#include "tools/render/seen_wall.h"
#include "tools/render/visibility_buffer.h"
#include "tools/render/window_mask.h"

namespace haustra::render {

class FrameRenderer {
 public:
  // Keeps references: all must outlive the renderer.
  FrameRenderer(const Colon& colon, const MucosaTexture& mucosa, const CameraModel& camera, const WindowMask& window);

  // Adds weight * radiance to the image, which has the camera's size. rows_seen: one moment for the whole picture, or
  // one for each of its rows.
  void Accumulate(std::span<const ExposureMoment> rows_seen, float weight, LinearImage* image);

  // How far away the nearest thing is along the rays of the cells of step_px x step_px pixels (CellCentrePx of
  // engine/surface/depth_map.h), mm, row by row; 0: nothing within reach, or outside the window. Instruments count.
  // 0 as well where the ray meets liquid, however thin: what is seen there is not the wall alone.
  // normals: where not null, of that thing, unit, in the camera, facing it; zero where the range is 0.
  void MeasureRange(const ExposureMoment& moment, int step_px, std::vector<float>* range_mm,
                    std::vector<Eigen::Vector3f>* normals = nullptr);

  // Notes what the picture shows of the wall, inside the window and behind neither an instrument nor liquid.
  void FindSeenWall(const ExposureMoment& moment, SeenWall* seen);

 private:
  // What a ray meets before the wall.
  struct Liquid {
    float range_mm = std::numeric_limits<float>::infinity();
    Eigen::Vector2f shore_slope = Eigen::Vector2f::Zero();  // of the surface, by the wall beside it
  };
  void Project(std::span<const ExposureMoment> rows_seen);
  // How far along a unit ray the liquid begins before the wall at wall_mm, which is met in the quads of that ring of
  // mesh_; infinity: nowhere.
  float LiquidMm(int ring, const Eigen::Vector3f& ray, float wall_mm, const ExposureMoment& moment) const;
  // How long a pixel is on the surface so far away, where a unit ray rises by so much a mm.
  float LiquidFootprintMm(float range_mm, float rise) const;
  // Radiance along a unit ray that meets `triangle`, and how far away that is. The liquid that is met before is only
  // told, and the wall below it is lit as if that were clear.
  float ShadeRay(std::uint32_t triangle, const Eigen::Vector3f& ray, const ExposureMoment& moment, float rgb[3],
                 Liquid* liquid) const;
  // Of the surface beside a wall that a ray meets under it.
  Eigen::Vector2f ShoreSlope(const SurfacePoint& wall, const Eigen::Vector3f& ray, float liquid_mm,
                             const ExposureMoment& moment) const;
  // Puts liquid over what is seen at far_mm.
  void CoverWithLiquid(const Liquid& liquid, const Eigen::Vector3f& ray, float far_mm, const ExposureMoment& moment,
                       float rgb[3]) const;
  void ShadePixel(int x, int y, const ExposureMoment& moment, float rgb[3]) const;

  const Colon& colon_;
  const MucosaTexture& mucosa_;
  const CameraModel& camera_;
  const WindowMask& window_;
  std::vector<Eigen::Vector3f> rays_;             // unit, of the pixel centres
  std::vector<Eigen::Vector3f> ray_dx_, ray_dy_;  // change to the next pixel
  ProjectedMesh mesh_;
  VisibilityBuffer visibility_;
  std::vector<double> liquid_level_mm_;  // of the colon's rings; empty without liquid
};

}  // namespace haustra::render
