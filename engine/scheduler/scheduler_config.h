// How a frame keeps its deadline. Real-time mode only: sequential mode has no
// deadline. Plain data.
#pragma once

namespace haustra {

struct SchedulerConfig {
  bool degrade = true;       // off: every frame gets everything, however late it is (for comparison)
  double deadline_ms = 0.0;  // from the capture of a frame to its pose; 0: the period of the frames [0, 1000]
  // What comes after the last wait for the device: the pose, its publication, and a wake-up on a busy machine [0, 100].
  double reserve_ms = 2.0;
  // Of the last durations of a stage (frame_budget.h): the time that it is expected to take. Of 64 durations, 0.98 is
  // the second largest: one outlier changes nothing, two do [0.5, 1].
  double quantile = 0.98;
  // For so long a stage that was refused is not tried again. Twice as long each time that it is still as slow, up to
  // sixteen times: a try costs its frame a rung [1, 100000].
  double retry_ms = 1000.0;
  double reduced_share = 0.5;  // of features and of local points, on the rungs that have fewer [0.1, 1]
  // On the rung that has fewer features: finer ones are not looked for. 1.8 leaves out the enlarged picture, which
  // takes the CPU device two thirds of its time [0, 10].
  double reduced_min_scale_px = 1.8;
  // A frame that is lost, or nearly so, may take this long for all its features, even beyond its deadline: it has no
  // pose that could be late. Two or three frames of a camera, in which a scope hardly moves on; 0: it keeps its
  // deadline [0, 1000].
  double lost_time_ms = 100.0;
  double max_predicted_ms = 200.0;  // without a measurement: a scope does not keep its course longer [0, 10000]
  bool background_gap = true;       // mapping asks an accelerator for nothing while a frame is due
};

// Of what is found of a map with all its points and all features: the share that is when the ladder leaves some out.
inline double SearchedShare(const SchedulerConfig& config, bool has_fewer_points, bool has_fewer_features) {
  return (has_fewer_points ? config.reduced_share : 1.0) * (has_fewer_features ? config.reduced_share : 1.0);
}

}  // namespace haustra
