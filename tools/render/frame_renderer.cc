#include "tools/render/frame_renderer.h"

#include <Eigen/Geometry>
#include <algorithm>
#include <cmath>
#include <limits>

#include "engine/surface/depth_map.h"
#include "tools/render/blood.h"
#include "tools/render/lighting.h"
#include "tools/render/liquid_look.h"
#include "tools/render/narrow_band.h"

namespace haustra::render {
namespace {

// Samples of one pixel whose ranges differ by more than this share see different walls.
constexpr float kEdgeRatio = 1.05f;
// Where the liquid on the wall is thinner than so many pixels it ends nearby.
constexpr float kShorePx = 8.0f;
// What lies far down the lumen fades out before the rendered part of the wall ends: from so far on it is black.
constexpr float kBlackMm = 165.0f, kFadeMm = 50.0f;

float FadeAt(float range_mm) { return std::clamp((kBlackMm - range_mm) * (1.0f / kFadeMm), 0.0f, 1.0f); }

}  // namespace

FrameRenderer::FrameRenderer(const Colon& colon, const MucosaTexture& mucosa, const CameraModel& camera,
                             const WindowMask& window)
    : colon_(colon),
      mucosa_(mucosa),
      camera_(camera),
      window_(window),
      visibility_(camera.width_px(), camera.height_px()) {
  const int width = camera.width_px(), height = camera.height_px();
  const auto ray_at = [&](double x, double y) {
    Eigen::Vector3d ray;
    if (!camera.Unproject(Eigen::Vector2d(x, y), &ray)) ray = Eigen::Vector3d::UnitZ();
    return ray;
  };
  rays_.reserve(std::size_t(width) * height);
  for (int y = 0; y < height; ++y) {
    for (int x = 0; x < width; ++x) {
      rays_.push_back(ray_at(x, y).cast<float>());
      ray_dx_.push_back((ray_at(x + 0.5, y) - ray_at(x - 0.5, y)).cast<float>());
      ray_dy_.push_back((ray_at(x, y + 0.5) - ray_at(x, y - 0.5)).cast<float>());
    }
  }
}

void FrameRenderer::Project(std::span<const ExposureMoment> rows_seen) {
  mesh_.Project(colon_, camera_, rows_seen);
  visibility_.Rasterise(mesh_);
  if (!colon_.fluid().is_active()) return;
  const double time_s = rows_seen[rows_seen.size() / 2].time_s;
  colon_.fluid().FindLevels(colon_.mesh(), colon_.style().breathing, time_s, &liquid_level_mm_);
}

float FrameRenderer::LiquidMm(int ring, const Eigen::Vector3f& ray, float wall_mm, const ExposureMoment& moment) const {
  constexpr float kNowhere = std::numeric_limits<float>::infinity();
  if (liquid_level_mm_.empty()) return kNowhere;
  // A quad at the shore has one ring in the liquid; no quad has its rings in two pools.
  const std::size_t first = mesh_.first_ring + ring;
  const double level_mm = std::max(liquid_level_mm_[first], liquid_level_mm_[first + 1]);
  if (level_mm == FluidLevel::kDry) return kNowhere;
  const Eigen::Vector3d& up = colon_.fluid().up();
  const auto camera_mm = static_cast<float>(up.dot(moment.world_from_cam.translation) - level_mm);
  const auto rise = static_cast<float>((moment.world_from_cam.rotation * ray.cast<double>()).dot(up));
  // From below it is never seen: a ray that seems to is one at the edge of a crest (ShadeRay says why).
  if (camera_mm <= 0.0f || camera_mm + rise * wall_mm >= 0.0f) return kNowhere;
  // The wall is under the liquid and nothing stands before it: the ray has come through the surface of this pool.
  return camera_mm / -rise;
}

float FrameRenderer::LiquidFootprintMm(float range_mm, float rise) const {
  return range_mm / static_cast<float>(camera_.focal_px()) / std::max(-rise, 0.05f);
}

void FrameRenderer::Accumulate(std::span<const ExposureMoment> rows_seen, float weight, LinearImage* image) {
  Project(rows_seen);
  for (int y = 0; y < image->height; ++y) {
    const ExposureMoment& moment = rows_seen.size() > 1 ? rows_seen[y] : rows_seen.front();
    for (int x = 0; x < image->width; ++x) {
      if (window_.coverage(x, y) <= 0.0f) continue;
      float rgb[3];
      ShadePixel(x, y, moment, rgb);
      float* out = image->pixel(x, y);
      for (int c = 0; c < 3; ++c) out[c] += weight * rgb[c];
    }
  }
}

void FrameRenderer::MeasureRange(const ExposureMoment& moment, int step_px, std::vector<float>* range_mm,
                                 std::vector<Eigen::Vector3f>* normals) {
  Project(std::span(&moment, 1));
  const int width = camera_.width_px() / step_px, height = camera_.height_px() / step_px;
  range_mm->assign(std::size_t(width) * height, 0.0f);
  if (normals != nullptr) normals->assign(range_mm->size(), Eigen::Vector3f::Zero());
  for (int row = 0; row < height; ++row) {
    for (int column = 0; column < width; ++column) {
      const double x = CellCentrePx(column, step_px), y = CellCentrePx(row, step_px);
      Eigen::Vector3d bearing;
      if (window_.coverage(static_cast<int>(x), static_cast<int>(y)) < 1.0f) continue;
      if (!camera_.Unproject({x, y}, &bearing)) continue;
      const Eigen::Vector3f ray = bearing.cast<float>();
      float range = std::numeric_limits<float>::infinity(), liquid = range;
      Eigen::Vector3f normal = Eigen::Vector3f::Zero();
      // The sample that lies nearest: of two a pixel, half a pixel apart.
      const int sample_x = static_cast<int>(std::lround(2.0 * x + 0.5));
      const int sample_y = static_cast<int>(std::lround(2.0 * y + 0.5));
      const std::uint32_t triangle = visibility_.triangle(sample_x, sample_y);
      if (triangle != VisibilityBuffer::kNothing) {
        int corners[3];
        ProjectedMesh::Corners(triangle, corners);
        const Eigen::Vector3f& a = mesh_.vertices[corners[0]].position;
        normal = (mesh_.vertices[corners[1]].position - a).cross(mesh_.vertices[corners[2]].position - a);
        const float along = normal.dot(ray), met = normal.dot(a);
        // At the edge of the wall the ray may miss the triangle of the sample beside it; the plane is then no wall.
        const float beside = 1.0f / visibility_.inverse_range(sample_x, sample_y);
        if (std::abs(along) > 1e-12f && std::abs(met / along - beside) < 0.1f * beside) range = met / along;
        liquid = LiquidMm(static_cast<int>(triangle >> 1) / ProjectedMesh::kM, ray, range, moment);
      }
      InstrumentHit hit;
      if (moment.instrument.Meet(ray, &hit) && hit.range_mm < range) {
        range = hit.range_mm;
        normal = hit.normal;
      }
      if (!(range < kBlackMm) || liquid < range) continue;
      const std::size_t cell = std::size_t(row) * width + column;
      (*range_mm)[cell] = range;
      if (normals != nullptr) (*normals)[cell] = (normal.dot(ray) > 0.0f ? -normal : normal).normalized();
    }
  }
}

void FrameRenderer::FindSeenWall(const ExposureMoment& moment, SeenWall* seen) {
  Project(std::span(&moment, 1));
  const Eigen::Matrix3d world_from_cam = moment.world_from_cam.matrix3();
  for (int y = 0; y < camera_.height_px(); ++y) {
    for (int x = 0; x < camera_.width_px(); ++x) {
      if (window_.coverage(x, y) < 1.0f) continue;
      const Eigen::Vector3f& ray = rays_[std::size_t(y) * camera_.width_px() + x];
      const Eigen::Vector3d ray_in_world = world_from_cam * ray.cast<double>();
      InstrumentHit hit;
      const bool has_hit = moment.instrument.Meet(ray, &hit);
      for (int k = 0; k < 4; ++k) {
        const int i = 2 * x + (k & 1), j = 2 * y + (k >> 1);
        const std::uint32_t triangle = visibility_.triangle(i, j);
        if (triangle == VisibilityBuffer::kNothing) continue;
        const double range_mm = 1.0 / visibility_.inverse_range(i, j);
        if (has_hit && hit.range_mm < range_mm) continue;
        const int quad = static_cast<int>(triangle >> 1), ring = quad / ProjectedMesh::kM;
        const float liquid_mm = LiquidMm(ring, ray, static_cast<float>(range_mm), moment);
        if (liquid_mm < static_cast<float>(range_mm)) continue;
        seen->Note(mesh_.first_ring + ring, quad % ProjectedMesh::kM, range_mm, ray_in_world);
      }
    }
  }
}

void FrameRenderer::ShadePixel(int x, int y, const ExposureMoment& moment, float rgb[3]) const {
  const std::size_t index = std::size_t(y) * camera_.width_px() + x;
  float nearest = 0.0f, farthest = 1e9f;
  for (int k = 0; k < 4; ++k) {
    const float inverse_range = visibility_.inverse_range(2 * x + (k & 1), 2 * y + (k >> 1));
    nearest = std::max(nearest, inverse_range);
    farthest = std::min(farthest, inverse_range);
  }
  const InstrumentShape& instrument = moment.instrument;
  const bool is_near_instrument =
      instrument.num_parts > 0 && instrument.IsNear(rays_[index], 1.5f / static_cast<float>(camera_.focal_px()));
  if (nearest <= farthest * kEdgeRatio && !is_near_instrument) {
    const std::uint32_t triangle = visibility_.triangle(2 * x, 2 * y);
    if (triangle == VisibilityBuffer::kNothing) {
      rgb[0] = rgb[1] = rgb[2] = 0.0f;
      return;
    }
    Liquid liquid;
    const float wall_mm = ShadeRay(triangle, rays_[index], moment, rgb, &liquid);
    if (liquid.range_mm >= wall_mm) return;
    // The bright line along the shore may be thinner than a pixel.
    if (wall_mm - liquid.range_mm > kShorePx * wall_mm / static_cast<float>(camera_.focal_px())) {
      CoverWithLiquid(liquid, rays_[index], wall_mm, moment, rgb);
      return;
    }
  }
  rgb[0] = rgb[1] = rgb[2] = 0.0f;
  for (int k = 0; k < 4; ++k) {
    const std::uint32_t triangle = visibility_.triangle(2 * x + (k & 1), 2 * y + (k >> 1));
    if (triangle == VisibilityBuffer::kNothing && !is_near_instrument) continue;
    const float dx = (k & 1) != 0 ? 0.25f : -0.25f, dy = (k >> 1) != 0 ? 0.25f : -0.25f;
    const Eigen::Vector3f ray = (rays_[index] + dx * ray_dx_[index] + dy * ray_dy_[index]).normalized();
    float sample[3] = {0.0f, 0.0f, 0.0f};
    float far_mm = std::numeric_limits<float>::infinity();
    Liquid liquid;
    if (triangle != VisibilityBuffer::kNothing) far_mm = ShadeRay(triangle, ray, moment, sample, &liquid);
    InstrumentHit hit;
    if (is_near_instrument && instrument.Meet(ray, &hit) && hit.range_mm < far_mm) {
      ShadeInstrument(ray, hit, sample);
      far_mm = hit.range_mm;
    }
    if (liquid.range_mm < far_mm) CoverWithLiquid(liquid, ray, far_mm, moment, sample);
    for (int c = 0; c < 3; ++c) rgb[c] += 0.25f * sample[c];
  }
}

float FrameRenderer::ShadeRay(std::uint32_t triangle, const Eigen::Vector3f& ray, const ExposureMoment& moment,
                              float rgb[3], Liquid* liquid) const {
  int corners[3];
  ProjectedMesh::Corners(triangle, corners);
  const ProjectedMesh::Vertex& a = mesh_.vertices[corners[0]];
  const ProjectedMesh::Vertex& b = mesh_.vertices[corners[1]];
  const ProjectedMesh::Vertex& c = mesh_.vertices[corners[2]];

  // Ray against the triangle's plane (Moller and Trumbore 1997); the ray starts at the camera.
  const Eigen::Vector3f edge_b = b.position - a.position, edge_c = c.position - a.position;
  const Eigen::Vector3f p = ray.cross(edge_c);
  const Eigen::Vector3f q = edge_b.cross(a.position);  // (-a) x edge_b
  const float determinant = edge_b.dot(p);
  const float inverse = std::abs(determinant) > 1e-12f ? 1.0f / determinant : 0.0f;
  // The fisheye lets a sample lie a little outside of the triangle it was given to; not more than that.
  const float wb = std::clamp(-a.position.dot(p) * inverse, -0.5f, 1.5f);
  const float wc = std::clamp(ray.dot(q) * inverse, -0.5f, 1.5f);
  const float wa = 1.0f - wb - wc;

  const int quad = static_cast<int>(triangle >> 1);
  const int ring = quad / ProjectedMesh::kM, j = quad % ProjectedMesh::kM;
  const bool is_upper = (triangle & 1) != 0;  // corners (0, 0), (1, 1), (0, 1) of the quad, else (0, 0), (1, 0), (1, 1)
  const float across = is_upper ? wb : wb + wc;
  const float around = is_upper ? wb + wc : wc;

  SurfacePoint point;
  point.position = wa * a.position + wb * b.position + wc * c.position;
  point.normal = (wa * a.normal + wb * b.normal + wc * c.normal).normalized();
  point.openness = wa * a.openness + wb * b.openness + wc * c.openness;
  const Eigen::Vector3f& axis = mesh_.rings[ring].axis;
  const Eigen::Vector3f along = axis - axis.dot(point.normal) * point.normal;
  const float along_norm = along.norm();
  point.along = along_norm > 1e-3f ? Eigen::Vector3f(along / along_norm) : point.normal.unitOrthogonal();
  point.around = point.normal.cross(point.along);

  constexpr float kTextureRadiusMm = MucosaTexture::kGirthMm / 6.2831853f;
  const float radius = wa * a.radius_mm + wb * b.radius_mm + wc * c.radius_mm;
  point.girth_stretch = kTextureRadiusMm / std::max(radius, 1.0f);

  const float range = point.position.norm();
  const float facing = std::max(-point.normal.dot(ray), 0.04f);
  Footprint footprint;
  const float surface_0 = mesh_.rings[ring].surface_mm, surface_1 = mesh_.rings[ring + 1].surface_mm;
  footprint.u_mm = surface_0 + across * (surface_1 - surface_0);
  footprint.v_mm = (static_cast<float>(j) + around) * (MucosaTexture::kGirthMm / ProjectedMesh::kM);
  footprint.minor_mm = range / static_cast<float>(camera_.focal_px());
  const float lean_u = ray.dot(point.along), lean_v = ray.dot(point.around);
  const float lean = std::max(std::sqrt(lean_u * lean_u + lean_v * lean_v), 1e-6f);
  const float extent = footprint.minor_mm / facing;
  const float extent_u = extent * lean_u / lean, extent_v = extent * lean_v / lean * point.girth_stretch;
  footprint.major_mm = std::max(std::sqrt(extent_u * extent_u + extent_v * extent_v), 1e-6f);
  footprint.major_u = extent_u / footprint.major_mm;
  footprint.major_v = extent_v / footprint.major_mm;
  point.footprint_mm = footprint.minor_mm;

  MucosaSample mucosa = mucosa_.Sample(footprint);
  if (moment.blood_share > 0.0f) CoverWithBlood(moment.blood_share, &mucosa);
  if (moment.is_narrow_band) ShowInNarrowBand(&mucosa);
  liquid->range_mm = LiquidMm(ring, ray, range, moment);
  if (liquid->range_mm < range) {
    mucosa.wetness = 0.0f;  // no air touches it
    liquid->shore_slope = ShoreSlope(point, ray, liquid->range_mm, moment);
  }
  Shade(point, mucosa, moment.instrument, rgb);
  const float fade = FadeAt(range);
  for (int k = 0; k < 3; ++k) rgb[k] *= fade;
  return range;
}

Eigen::Vector2f FrameRenderer::ShoreSlope(const SurfacePoint& wall, const Eigen::Vector3f& ray, float liquid_mm,
                                          const ExposureMoment& moment) const {
  const FluidLevel& fluid = colon_.fluid();
  const Eigen::Quaterniond cam_from_world = moment.world_from_cam.rotation.conjugate();
  const Eigen::Vector3f up = (cam_from_world * fluid.up()).cast<float>();
  const Eigen::Vector3f through = wall.position - liquid_mm * ray;
  // The wall goes on to the shore as a plane.
  const float facing_up = up.dot(wall.normal);
  const Eigen::Vector3f level = wall.normal - facing_up * up;
  const float steep = level.norm();
  if (steep < 1e-3f) return Eigen::Vector2f::Zero();
  const Eigen::Vector3f to_shore = level / -steep;
  const float depth_mm = -up.dot(through);
  const float to_shore_mm = to_shore.dot(through) + depth_mm * std::max(facing_up, 0.0f) / steep;
  const float slope =
      MeniscusSlope(steep / std::max(facing_up, 1e-3f), to_shore_mm, LiquidFootprintMm(liquid_mm, up.dot(ray)));
  return slope * Eigen::Vector2f(to_shore.dot((cam_from_world * fluid.level_x()).cast<float>()),
                                 to_shore.dot((cam_from_world * fluid.level_y()).cast<float>()));
}

void FrameRenderer::CoverWithLiquid(const Liquid& liquid, const Eigen::Vector3f& ray, float far_mm,
                                    const ExposureMoment& moment, float rgb[3]) const {
  const FluidLevel& fluid = colon_.fluid();
  const Eigen::Quaterniond cam_from_world = moment.world_from_cam.rotation.conjugate();
  SurfacePoint point;
  point.position = liquid.range_mm * ray;
  point.normal = (cam_from_world * fluid.up()).cast<float>();
  point.along = (cam_from_world * fluid.level_x()).cast<float>();
  point.around = (cam_from_world * fluid.level_y()).cast<float>();
  point.footprint_mm = liquid.range_mm / static_cast<float>(camera_.focal_px());
  const float rise = point.normal.dot(ray);
  LiquidSurface surface = fluid.SurfaceAt(moment.world_from_cam * point.position.cast<double>(), moment.time_s,
                                          LiquidFootprintMm(liquid.range_mm, rise));
  surface.slope_x += liquid.shore_slope.x();
  surface.slope_y += liquid.shore_slope.y();
  const Eigen::Vector3f normal = point.normal - surface.slope_x * point.along - surface.slope_y * point.around;
  LiquidLook look = LookInto(surface, far_mm - liquid.range_mm, -normal.normalized().dot(ray), -rise);
  if (moment.is_narrow_band) {
    ShowInNarrowBand(&look.sample);
    ShowInNarrowBand(&look.through);
  }
  float liquid_rgb[3];
  Shade(point, look.sample, moment.instrument, liquid_rgb);
  const float fade = FadeAt(liquid.range_mm);
  for (int c = 0; c < 3; ++c) rgb[c] = look.through[c] * rgb[c] + fade * liquid_rgb[c];
}

}  // namespace haustra::render
