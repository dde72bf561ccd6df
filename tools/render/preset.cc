#include "tools/render/preset.h"

#include <algorithm>

namespace haustra::render {
namespace {

MucosaStyle LivingMucosa() {
  MucosaStyle style;
  style.vessels = 0.9f;
  style.detail = 0.5f;
  style.veins.trees_per_cm2 = 0.03;
  style.veins.min_trunk_width_mm = 0.4;
  style.veins.max_trunk_width_mm = 0.75;
  style.veins.min_opacity = 0.25;
  style.veins.max_opacity = 0.55;
  return style;
}

MucosaStyle SiliconeMucosa() {
  MucosaStyle style;
  style.base_rgb = {0.62f, 0.33f, 0.23f};
  style.vessels = 0.16f;
  style.detail = 0.13f;
  style.mottle = 0.4f;
  style.relief = 0.75f;
  style.wetness = 1.15f;
  style.arteries.trees_per_cm2 = 0.06;
  style.veins.trees_per_cm2 = 0.01;
  return style;
}

std::vector<Preset> MakePresets() {
  std::vector<Preset> presets;
  Preset standard;
  standard.name = "standard";
  standard.summary = "out to the blind end and back, good texture, one short occlusion";
  standard.blind_end_mm = 48.0;
  standard.mucosa = LivingMucosa();
  standard.events = {{EventKind::kRedout, 0.66, 0.9}};
  presets.push_back(standard);

  Preset clear = standard;
  clear.name = "clear";
  clear.summary = "like standard, with nothing in the way";
  clear.events.clear();
  presets.push_back(clear);

  Preset losses = standard;
  losses.name = "losses";
  losses.summary = "five losses: occlusion, jump, water jet, motion blur, water film; every place is seen again";
  losses.seconds = 40.0;
  losses.blind_end_mm = 125.0;
  losses.mucosa.vessels = 0.7f;
  losses.mucosa.detail = 0.35f;
  losses.path.stops = {0.0, 1.0, 0.45, 0.9, 0.0};
  losses.events = {{EventKind::kRedout, 0.20, 1.4},
                   {EventKind::kJump, 0.425, 0.44},
                   {EventKind::kBubbles, 0.55, 1.4},
                   {EventKind::kBlur, 0.713, 1.0},
                   {EventKind::kWater, 0.87, 1.4}};
  presets.push_back(losses);

  Preset breathing = standard;
  breathing.name = "breathing";
  breathing.summary = "the wall breathes by 4 % and a slow wave runs along it; occlusion and debris";
  breathing.seconds = 25.0;
  breathing.blind_end_mm = 125.0;
  breathing.colon.breathing.amplitude = 0.04;
  breathing.colon.breathing.wave_amplitude = 0.03;
  breathing.path.stops = {0.0, 0.8, 0.3, 1.0, 0.1};
  breathing.events = {{EventKind::kRedout, 0.34, 1.2}, {EventKind::kDebris, 0.72, 1.4}};
  presets.push_back(breathing);

  Preset silicone = standard;
  silicone.name = "silicone";
  silicone.summary = "a silicone phantom: little texture, wet highlights, 675x540 at 30 Hz; one occlusion";
  silicone.seconds = 15.0;
  silicone.rate_hz = 30.0;
  silicone.width_px = 675;
  silicone.blind_end_mm = 125.0;
  silicone.mucosa = SiliconeMucosa();
  silicone.events = {{EventKind::kRedout, 0.44, 1.1}};
  presets.push_back(silicone);

  Preset twins = standard;
  twins.name = "twins";
  twins.summary = "two different places that look the same, for place recognition";
  twins.seconds = 30.0;
  twins.blind_end_mm = 125.0;
  twins.twin_length_mm = 46.0;
  twins.events = {{EventKind::kRedout, 0.30, 1.0}, {EventKind::kRedout, 0.62, 1.0}};
  presets.push_back(twins);

  Preset loop = clear;
  loop.name = "loop";
  loop.summary = "a bent tip turned once and a quarter around the lumen: a loop along the wall, nothing in the way";
  loop.seconds = 30.0;
  loop.blind_end_mm = 125.0;
  loop.path.speed_mm_per_s = 1.2;
  loop.path.gaze_deg = 6.0;
  loop.path.tilt_deg = 80.0;
  loop.path.rounds = 1.25;
  loop.path.back_off_mm = 6.0;
  presets.push_back(loop);

  Preset procedure = losses;
  procedure.name = "procedure";
  procedure.summary = "1.5 m of colon with its flexures, in and out with many turns in 22 minutes; nothing in the way";
  procedure.seconds = 1320.0;
  procedure.blind_end_mm = 48.0;
  procedure.events.clear();
  procedure.colon.flexures = {{0.13, 120.0, 45.0}, {0.27, 90.0, 45.0}, {0.52, 110.0, 45.0}, {0.76, 100.0, 45.0}};
  // Advanced with loss of ground, withdrawn with a second look at every part.
  procedure.path.stops = {0.00, 0.10, 0.07, 0.20, 0.16, 0.30, 0.27, 0.42, 0.37, 0.55, 0.50, 0.66,
                          0.62, 0.78, 0.74, 0.90, 0.85, 1.00, 0.88, 0.92, 0.78, 0.82, 0.66, 0.70,
                          0.54, 0.58, 0.42, 0.46, 0.30, 0.34, 0.18, 0.22, 0.08, 0.11, 0.00};
  procedure.path.speed_mm_per_s = 3.6;
  procedure.path.pause_s = 2.0;
  procedure.path.max_reach_mm = 1500.0;
  procedure.path.regain_s = 25.0;
  procedure.path.has_fresh_passes = true;
  procedure.path.pass_roll_deg = 40.0;
  presets.push_back(procedure);
  return presets;
}

}  // namespace

const std::vector<Preset>& Presets() {
  static const std::vector<Preset> presets = MakePresets();
  return presets;
}

Result<Preset> FindPreset(std::string_view name) {
  std::string known;
  for (const Preset& preset : Presets()) {
    if (preset.name == name) return preset;
    known += (known.empty() ? "" : ", ") + std::string(preset.name);
  }
  return InvalidArgument("no preset '" + std::string(name) + "'; there are " + known);
}

CameraCalibration CalibrationFor(int width_px, int height_px, double rate_hz) {
  CameraCalibration calibration;
  calibration.kind = CameraModelKind::kKannalaBrandt;
  calibration.width_px = width_px;
  calibration.height_px = height_px;
  calibration.rate_hz = rate_hz;
  // The same field of view at every size. The principal point is off the middle, as it is in real scopes.
  const double scale = std::max(width_px / 720.0, height_px / 540.0);
  calibration.fx = 394.6 * scale;
  calibration.fy = 394.1 * scale;
  calibration.cx = 0.5 * (width_px - 1) + 3.1 * scale;
  calibration.cy = 0.5 * (height_px - 1) - 2.2 * scale;
  calibration.coefficients = {-0.038, 0.0071, -0.0027, 0.00042};
  return calibration;
}

}  // namespace haustra::render
