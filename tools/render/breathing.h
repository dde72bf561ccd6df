// How the wall moves: its radius swells with breathing, a slow ring of contraction travels along it (peristalsis), it
// slides and turns along itself, and the whole lumen narrows and widens with the pressure of the air in it.
#pragma once

#include <cmath>
#include <numbers>

#include "tools/render/pressure_curve.h"

namespace haustra::render {

// Where the wall at one place is, against rest.
struct WallMotion {
  double gain = 1.0;        // on the radius
  double along_mm = 0.0;    // along the tangent of the centre line
  double around_rad = 0.0;  // about it

  bool is_tangential() const { return along_mm != 0.0 || around_rad != 0.0; }
};

struct Breathing {
  static constexpr double kMaxAmplitude = 0.15;
  static constexpr double kUsualRadiusMm = 22.0;

  double amplitude = 0.0;  // share of the radius, [0, kMaxAmplitude]
  double rate_hz = 0.27;
  double wave_amplitude = 0.0;   // depth of the contraction, share of the radius, [0, kMaxAmplitude]
  double wave_length_mm = 90.0;  // from ring to ring
  double wave_speed_mm_per_s = 9.0;
  // How far the wall slides along the lumen with the rings, and about it with the breath: share of the usual radius,
  // [0, kMaxAmplitude]. The wall is stretched and squeezed by this times 2 pi 22 / 90, and never folds over.
  double tangential = 0.0;
  PressureCurve pressure;

  bool is_active() const {
    return amplitude > 0.0 || wave_amplitude > 0.0 || tangential > 0.0 || pressure.collapse > 0.0;
  }
  // Factor on the wall's radius; 1 at rest.
  double Gain(double arc_mm, double time_s) const {
    if (!is_active()) return 1.0;
    // The breath reaches the near wall a little before the far one.
    const double breath = std::sin(BreathPhase(arc_mm, time_s));
    const double ring = std::cos(RingPhase(arc_mm, time_s));
    return (1.0 + amplitude * breath - wave_amplitude * std::exp(5.0 * (ring - 1.0))) * pressure.RadiusGain(time_s);
  }
  WallMotion Motion(double arc_mm, double time_s) const {
    WallMotion motion;
    motion.gain = Gain(arc_mm, time_s);
    if (tangential > 0.0) {
      motion.along_mm = tangential * kUsualRadiusMm * std::sin(RingPhase(arc_mm, time_s));
      motion.around_rad = tangential * std::cos(BreathPhase(arc_mm, time_s));
    }
    return motion;
  }
  // Smallest gain at any place and time.
  double MinGain() const { return (1.0 - amplitude - wave_amplitude) * (1.0 - pressure.collapse); }

 private:
  static constexpr double kTurn = 2.0 * std::numbers::pi;
  double BreathPhase(double arc_mm, double time_s) const { return kTurn * rate_hz * time_s - arc_mm / 120.0; }
  double RingPhase(double arc_mm, double time_s) const {
    return kTurn * (arc_mm + wave_speed_mm_per_s * time_s) / wave_length_mm;
  }
};

}  // namespace haustra::render
