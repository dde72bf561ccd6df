// A stretch of the colon that is repeated farther along, so that two different places look the same: the hard case for
// place recognition. Arc length in mm.
#pragma once

namespace haustra::render {

struct TwinSegment {
  double start_mm = 0.0;
  double offset_mm = 0.0;
  double length_mm = 0.0;  // 0: no twin

  bool is_active() const { return length_mm > 0.0; }
  // How far the place at `arc_mm` is a copy of the one at arc_mm - offset_mm: 0 not at all, 1 wholly.
  double Weight(double arc_mm) const {
    if (!is_active()) return 0.0;
    const double begin = arc_mm - (start_mm + offset_mm), end = start_mm + offset_mm + length_mm - arc_mm;
    const double inside = (begin < end ? begin : end) / kRampMm + 0.5;
    if (inside <= 0.0) return 0.0;
    if (inside >= 1.0) return 1.0;
    return inside * inside * (3.0 - 2.0 * inside);
  }
  // The property `of` (a function of arc length) with the copy blended in.
  template <typename Function>
  double Blend(double arc_mm, Function&& of) const {
    const double w = Weight(arc_mm);
    if (w <= 0.0) return of(arc_mm);
    if (w >= 1.0) return of(arc_mm - offset_mm);
    return (1.0 - w) * of(arc_mm) + w * of(arc_mm - offset_mm);
  }

 private:
  static constexpr double kRampMm = 8.0;
};

}  // namespace haustra::render
