// Parameters of merging and loop closing, with default, unit, range and reason. Plain data.
#pragma once

namespace haustra {

struct MergingConfig {
  bool enabled = true;        // off: every loss leaves a map of its own
  int window_keyframes = 8;   // of each side of the seam that are fused and welded [2, 30]
  int fixed_keyframes = 16;   // older ring that holds the gauge of the weld [0, 60]
  int weld_iterations = 15;   // [1, 100]
  int graph_iterations = 30;  // [1, 200]
  int graph_min_shared = 30;  // points of an edge of the essential graph [1, 1000]
  int graph_max_edges = 6;    // strongest ones of each keyframe, beside the one that keeps it connected [0, 60]
  // Of the essential graph, beside the keyframes at the seam. In a larger map neighbours share a node and move in one
  // piece, so the time of a join does not grow with the map [10, 10000].
  int graph_max_nodes = 256;
  // After the seam is welded, whenever the mapper is idle: bundle adjustment of the map around it, in slices.
  int settling_rounds = 6;          // at most; ends when nothing is gained any more [0, 100]
  int settling_iterations = 6;      // of each [1, 100]
  int settling_keyframes = 200;     // nearest ones by covisibility; their cube bounds an iteration [2, 1000]
  int settling_milliseconds = 150;  // of each, real-time mode only [1, 10000]
  // Real-time mode only: of a slice of a join. Then keyframes have their turn; a join takes some ten slices [1, 1000].
  int slice_milliseconds = 20;
  // Real-time mode only: all slices of a join together. Keyframes do not wait for it; a tracker that goes on for longer
  // has left the place [1, 10000].
  int max_milliseconds = 1500;
};

}  // namespace haustra
