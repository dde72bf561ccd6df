// Where the tip of the scope is at any time: along the centre line by a plan of advances and withdrawals, off it and
// looking around like a hand would, and thrown about by the events. A pure function of time. Lengths in mm. reentrant.
#pragma once

#include <vector>

#include "engine/geometry/rng.h"
#include "engine/geometry/se3.h"
#include "tools/render/centreline.h"
#include "tools/render/event_script.h"
#include "tools/render/lattice_noise.h"

namespace haustra::render {

struct PathStyle {
  // Places as shares of the reach that the scope visits in turn.
  std::vector<double> stops = {0.0, 1.0, 0.0};
  double speed_mm_per_s = 8.8;
  double pause_s = 0.8;         // at each turn, looking around
  double max_reach_mm = 260.0;  // longer sequences repeat the stops
  // How long the hand takes to make up the ground that a jump has lost. 0: at once, at 5 mm a second.
  double regain_s = 0.0;
  // Whether offset, gaze and roll by place are drawn anew after each turn, as on another way through. Then each way has
  // a roll of its own besides, up to this far from upright.
  bool has_fresh_passes = false;
  double pass_roll_deg = 0.0;
  double start_arc_mm = 32.0;
  double max_offset_mm = 4.0;  // from the centre line
  double gaze_deg = 16.0;      // by place: how far it looks away from straight ahead
  double tremble_deg = 6.0;    // by time
  // A bent tip that the hand turns: it looks at the wall, this far from straight ahead, and goes round the lumen.
  double tilt_deg = 0.0;
  double rounds = 0.0;       // in the whole sequence; more than one comes to where it began
  double back_off_mm = 0.0;  // from the centre line, away from the wall it looks at
};

class ScopePath {
 public:
  // How far beyond start_arc_mm a sequence of this length goes.
  static double ReachMm(const PathStyle& style, double duration_s);

  // Keeps a reference to the centre line.
  ScopePath(const PathStyle& style, const Centreline& centreline, const std::vector<Event>& events, double duration_s,
            std::uint64_t seed);

  SE3 WorldFromCam(double time_s) const;
  // Place along the centre line.
  double ArcMm(double time_s) const;
  // Exposure time of a frame: long while a blur event lasts.
  double ShutterS(double time_s) const;

 private:
  // The members draw from one generator in order.
  ScopePath(const PathStyle& style, const Centreline& centreline, const std::vector<Event>& events, double duration_s,
            std::uint64_t seed, Rng rng);

  // Wears off.
  struct Jolt {
    double start_s, duration_s, recovery_s, arc_mm;
    double kick;  // how far beyond yaw and pitch the scope is thrown for a moment, as a share of them
    double yaw_rad, pitch_rad;
    double Share(double time_s) const;
  };
  // Ground that is lost or won for good lies in the plan; this is how the view is thrown about meanwhile.
  struct Slip {
    double start_s, duration_s;
    double yaw_rad, pitch_rad, roll_rad;
  };
  struct Look {
    double time_s, yaw_rad, pitch_rad;
  };
  // From one way through the colon to the next. They fade into each other over half_s before and after.
  struct Turn {
    double time_s, half_s;
  };
  // Which way through it is, from 0 on, and how far it has faded into the next one.
  struct Pass {
    int index;
    double next_share;
  };
  void PlanArc(double duration_s);
  // What comes after a slip is the same motion from another place. Where it would leave the reach it waits at the end
  // of it, and goes on from there. Draws from a generator of its own, so that no other event is drawn anew.
  void PlanSlips(std::uint64_t seed);
  // The plan lies `arc_mm` farther after the event, within the reach.
  void ShiftPlan(const Event& event, double arc_mm);
  void PlanPasses(std::uint64_t seed);
  Pass PassAt(double time_s) const;
  // A function of the place, drawn anew for each pass.
  double AtPlace(const Wander& wander, double arc_mm, const Pass& pass) const;
  double PlannedArc(double time_s) const;
  // Ends of where slips and jumps may lead.
  double LowMm() const { return style_.start_arc_mm - 4.0; }
  double HighMm() const { return style_.start_arc_mm + reach_mm_ + 4.0; }

  PathStyle style_;
  const Centreline& centreline_;
  std::vector<Event> events_;
  double duration_s_;
  double reach_mm_;
  std::vector<double> planned_arc_mm_;  // every kPlanStepS, from -kPlanMarginS
  std::vector<Jolt> jolts_;
  std::vector<Slip> slips_;
  std::vector<Look> looks_;
  std::vector<Turn> turns_;            // in order; empty without fresh passes
  std::vector<double> pass_roll_deg_;  // one more than turns
  Wander offset_x_by_place_, offset_y_by_place_, yaw_by_place_, pitch_by_place_, roll_by_place_;
  Wander offset_x_, offset_y_, yaw_, pitch_, roll_, push_;
};

}  // namespace haustra::render
