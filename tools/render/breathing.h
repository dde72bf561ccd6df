// How the wall moves: its radius swells with breathing and a slow ring of contraction travels along it (peristalsis).
#pragma once

#include <cmath>
#include <numbers>

namespace haustra::render {

struct Breathing {
  double amplitude = 0.0;  // share of the radius, [0, 0.1]
  double rate_hz = 0.27;
  double wave_amplitude = 0.0;   // depth of the contraction, share of the radius, [0, 0.1]
  double wave_length_mm = 90.0;  // from ring to ring
  double wave_speed_mm_per_s = 9.0;

  bool is_active() const { return amplitude > 0.0 || wave_amplitude > 0.0; }
  // Factor on the wall's radius; 1 at rest.
  double Gain(double arc_mm, double time_s) const {
    if (!is_active()) return 1.0;
    constexpr double kTurn = 2.0 * std::numbers::pi;
    // The breath reaches the near wall a little before the far one.
    const double breath = std::sin(kTurn * rate_hz * time_s - arc_mm / 120.0);
    const double ring = std::cos(kTurn * (arc_mm + wave_speed_mm_per_s * time_s) / wave_length_mm);
    return 1.0 + amplitude * breath - wave_amplitude * std::exp(5.0 * (ring - 1.0));
  }
  // Smallest gain at any place and time.
  double MinGain() const { return 1.0 - amplitude - wave_amplitude; }
};

}  // namespace haustra::render
