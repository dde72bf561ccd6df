#include "tools/render/lighting.h"

#include <Eigen/Geometry>
#include <algorithm>
#include <array>
#include <cmath>

namespace haustra::render {
namespace {

struct Lamp {
  float x, y;  // beside the lens
  float power;
};
constexpr std::array<Lamp, 3> kLamps = {{{-2.9f, -0.9f, 0.38f}, {2.9f, -0.7f, 0.38f}, {0.3f, 2.7f, 0.24f}}};
constexpr float kReferenceMm2 = 20.0f * 20.0f;
constexpr float kWaterReflectance = 0.025f;  // Fresnel at normal incidence
// Lamps are small and bright: their image in the film outshines the tissue by more than an even lobe would.
constexpr float kGlint = 2.6f;
constexpr float kFilmRoughness2 = 0.0022f;  // squared GGX alpha of the film itself
constexpr float kInterreflection = 0.085f;
constexpr float kMetalAlbedo = 0.06f, kMetalGlint = 0.35f, kCoilPitchMm = 0.55f;
constexpr std::array<float, 3> kLampColour = {1.0f, 0.97f, 0.91f};

}  // namespace

void Shade(const SurfacePoint& p, const MucosaSample& mucosa, const InstrumentShape& instrument, float rgb[3]) {
  const float range = p.position.norm();
  const Eigen::Vector3f to_camera = p.position * (-1.0f / range);

  Eigen::Vector3f normal = p.normal - mucosa.slope_u * p.along - (mucosa.slope_v * p.girth_stretch) * p.around;
  normal.normalize();
  // Relief moves the soft light less than the mirror of the film: light diffuses below the surface.
  const Eigen::Vector3f soft_normal = (0.6f * p.normal + 0.4f * normal).normalized();
  const float ndv = std::max(normal.dot(to_camera), 0.08f);

  // Slopes that the pixel averages away widen the lobe.
  const float roughness2 = kFilmRoughness2 + 0.006f * std::min(p.footprint_mm * 4.0f, 1.0f);
  float diffuse = 0.0f, specular = 0.0f, around = 0.0f;
  for (const Lamp& lamp : kLamps) {
    const Eigen::Vector3f to_lamp(lamp.x - p.position.x(), lamp.y - p.position.y(), -p.position.z());
    const float inverse_distance2 = 1.0f / std::max(to_lamp.squaredNorm(), 4.0f);
    const Eigen::Vector3f direction = to_lamp * std::sqrt(inverse_distance2);
    // Lamps shine forward, weaker to the sides.
    const float forward = std::max(-direction.z(), 0.0f);
    const float irradiance = lamp.power * kReferenceMm2 * inverse_distance2 * (0.18f + 0.82f * forward);
    const float ndl = soft_normal.dot(direction);
    around += irradiance;
    if (instrument.num_parts > 0 && instrument.IsBetween(p.position, {lamp.x, lamp.y, 0.0f})) continue;
    diffuse += irradiance * std::max((ndl + 0.10f) * (1.0f / 1.10f), 0.0f);

    const float mirror_ndl = normal.dot(direction);
    if (mirror_ndl <= 0.0f) continue;
    const Eigen::Vector3f half = (direction + to_camera).normalized();
    const float ndh = std::max(normal.dot(half), 0.0f);
    const float hdv = std::max(half.dot(to_camera), 0.0f);
    const float denominator = ndh * ndh * (roughness2 - 1.0f) + 1.0f;
    const float distribution = roughness2 / (denominator * denominator);
    const float grazing = 1.0f - hdv, grazing2 = grazing * grazing;
    const float fresnel = kWaterReflectance + (1.0f - kWaterReflectance) * grazing2 * grazing2 * grazing;
    specular += irradiance * distribution * fresnel * mirror_ndl / (4.0f * std::max(ndv * mirror_ndl, 0.1f));
  }
  const float ambient = kInterreflection * around * p.openness;
  const float soft = diffuse * (0.35f + 0.65f * p.openness);
  const float wet = kGlint * specular * mucosa.wetness * mucosa.wetness;
  for (int c = 0; c < 3; ++c) {
    // Light between the walls has met red tissue more than once.
    const float tinted = ambient * (0.35f + 1.1f * mucosa.rgb[c]);
    rgb[c] = kLampColour[c] * (mucosa.rgb[c] * (soft + tinted) + wet);
  }
}

void ShadeInstrument(const Eigen::Vector3f& ray, const InstrumentHit& hit, float rgb[3]) {
  const Eigen::Vector3f position = hit.range_mm * ray;
  // The wire of the shaft is wound: dark grooves between bright turns.
  const float groove = hit.is_shaft ? 0.5f + 0.5f * std::cos(hit.along_mm * (6.2831853f / kCoilPitchMm)) : 1.0f;
  const float albedo = kMetalAlbedo * (0.35f + 0.65f * groove);
  float diffuse = 0.0f, specular = 0.0f;
  for (const Lamp& lamp : kLamps) {
    const Eigen::Vector3f to_lamp(lamp.x - position.x(), lamp.y - position.y(), -position.z());
    const float inverse_distance2 = 1.0f / std::max(to_lamp.squaredNorm(), 4.0f);
    const Eigen::Vector3f direction = to_lamp * std::sqrt(inverse_distance2);
    const float forward = std::max(-direction.z(), 0.0f);
    const float irradiance = lamp.power * kReferenceMm2 * inverse_distance2 * (0.18f + 0.82f * forward);
    const float ndl = std::max(hit.normal.dot(direction), 0.0f);
    const float ndh = std::max(hit.normal.dot((direction - ray).normalized()), 0.0f);
    diffuse += irradiance * ndl;
    specular += irradiance * ndl * std::pow(ndh, 40.0f);
  }
  for (int c = 0; c < 3; ++c) rgb[c] = kLampColour[c] * (albedo * diffuse + kMetalGlint * groove * specular);
}

}  // namespace haustra::render
