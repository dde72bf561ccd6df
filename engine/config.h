// Every parameter of the engine, with default, unit, range and reason. platform/config binds them to the keys of the
// configuration file (section.name); the presets in config/ say where and why they differ. Plain data.
#pragma once

#include <cstdint>
#include <string>

#include "engine/depth/depth_config.h"
#include "engine/merging/merging_config.h"
#include "engine/place/place_config.h"
#include "engine/scheduler/scheduler_config.h"
#include "hal/core/status.h"
#include "hal/realtime_config.h"

namespace haustra {

// What the extractor is asked for; the device keeps these for its life (hal/vision_device.h).
struct FeatureConfig {
  int max = 2400;  // a frame, detected and followed ones together [100, 8000]
  // Of them, those that are detected, the paper's operating point [100, 8000]; never more than max.
  int max_detected = 2000;
  // While the scope is tracked or a map is made, features of the last frame that the detector loses are followed, as
  // far as there is room. Before tracking is lost on living tissue the detector finds few of its features again from
  // frame to frame, optical flow several times as many (kernels/decisions/2026-11-24-all-features-are-followed.md).
  bool are_followed = true;
  double contrast_threshold = 0.0;  // |DoG| on intensities in [0, 1]; 0: the extractor's own floor [0, 0.2]
  double edge_threshold = 10.0;     // ratio of principal curvatures, Lowe 2004 section 4.1 [2, 50]
  int reflection_threshold = 245;   // grey value from which a pixel is a specular reflection [1, 256]; 256: off
  int border_threshold = 12;        // grey value up to which a dark border pixel is outside the scope [0, 128]
  int mask_dilation_px = 4;         // safe distance around masked pixels in the finest octave [0, 32]
  bool root_sift = true;            // Arandjelovic and Zisserman 2012; a tenth more inliers, on living tissue, too
  // Dark blobs upright, bright ones by their orientation (kernels/decisions/2026-11-23-features-on-living-tissue.md).
  bool upright_dark = true;
  // What stands still in the picture while the scene moves (text, dirt, the edge of the window) is found and left out
  // (tracking/static_overlay.h).
  bool finds_overlay = true;

  int num_detected() const { return max_detected < max ? max_detected : max; }
};

// Standard deviation of an observation: sigma = k * scale + sigma_0, in pixels, with the SIFT scale of the keypoint.
// The form is the paper's (Section III-F; its values: rigid phantom k 1, sigma_0 0, living tissue k 2, sigma_0 5), the
// values are measured: observations of map points against their true projections in a rendered colon have 0.9 px at
// scale 1, 1.2 at 4, 1.7 at 10, so that coarse keypoints deserve far more weight than k 1 gives them. What it is
// worth (engine/decisions; tools/benchmarks/ablation.py, variants linear_noise and paper_noise): much where walls are
// rigid, nothing where they breathe.
struct NoiseConfig {
  double k = 0.15;          // [0, 10]
  double sigma_0_px = 0.9;  // [0, 20]
  // Both are the start and the bounds of what is measured on the running map (tracking/noise_meter.h). Off: they stay.
  bool is_measured = true;
};

// Ratios are of angles (hal/vision_device.h).
struct MatchingConfig {
  // Cosine; below it two descriptors show different things [0, 1]. Of RootSIFT; half of the false best matches and one
  // true one in twenty have less. Without root_sift 0.80 says the same.
  double min_similarity = 0.90;
  double guided_ratio = 0.9;         // guided search: geometry already excludes most impostors [0.1, 1]
  double brute_force_ratio = 0.85;   // search without a prediction [0.1, 1]
  double scale_tolerance = 1.8;      // factor by which a keypoint's scale may differ from its prediction [1.1, 4]
  double max_view_angle_deg = 60.0;  // between the point's mean viewing direction and the current ray [10, 90]
};

struct InitialisationConfig {
  double brute_force_ratio = 0.85;  // [0.1, 1]; the two-view geometry sorts out what is false
  // Between the two views; the baseline is short (paper, Section III-D) [0.1, 180].
  double max_disparity_deg = 18.0;
  int min_matches = 35;  // below it the reference frame is renewed [10, 8000]
  // Triangulated points [10, 8000]. Maps that begin with fewer on real tissue are lost within seconds, or drift.
  int min_points = 50;
  // The two views are near in time: nothing has deformed between them, and only the localisation of the features is
  // noise (sigma = noise_k * scale + noise_sigma_0_px). With the noise of mapping, small motions would vanish in the
  // tolerance. Without the constant part, half of the true matches of a real, compressed video fall outside it: fine
  // features are no better located than the camera model and the compression allow, and a scene that is hard to see is
  // founded late or never.
  double noise_k = 0.35;          // [0.05, 10]
  double noise_sigma_0_px = 0.3;  // [0, 10]
  // What the best pure rotation leaves of the matches' motion, median: the share that only depth can explain. Either is
  // enough: an angle, or so many sigmas of the noise above, which sharp and large pictures reach sooner. Low on
  // purpose: of two views of living tissue the nearer ones tell the motion better, as long as it is certain (next
  // entry; tracking/decisions/2026-11-23-certain-foundings.md).
  double min_parallax_deg = 0.4;     // [0.05, 30]
  double min_parallax_sigmas = 4.0;  // [1, 100]
  // Of the direction in which the scope travelled between the views, one standard deviation. Counts the noise of all
  // matches twice: on living tissue they disagree because the wall moves, and many matches move with it.
  double max_direction_sigma_deg = 5.0;  // [0.1, 90]
  // Between the two views [0, 10000]. Bubbles and a film of water found maps when it is shorter, for as long as they
  // drift together (tracking/decisions/2026-11-29-a-least-time-between-founding-views.md).
  double min_gap_ms = 140.0;
  double min_inlier_share = 0.5;  // inliers of the epipolar geometry over matches [0, 1]
  // Area of the ellipse fitted to the points over that of the scope's window [0, 1]. The paper accepts 0.59 and rejects
  // 0.35 of the image; texture that covers a part of the window only must do, too.
  double min_spread = 0.30;
  // Without a motion that explains the matches: the reference is no good (blur, bubbles) and is renewed [0, 60000].
  double max_unexplained_ms = 320.0;
  // Views after the reference that are kept: they are placed when the map stands, and the next reference is one of
  // them. When there is no room for more, every second one goes [2, 1000].
  int kept_views = 40;
};

struct TrackingConfig {
  double motion_radius_deg = 2.4;   // search radius around the constant-velocity prediction [0.1, 45]
  double wide_radius_factor = 3.0;  // second try when the first finds too few [1, 10]
  int min_motion_matches = 15;      // below it: second try, then brute force [5, 1000]
  int min_inliers = 15;             // a pose with fewer is not a pose [6, 1000]
  // Of them, those that were detected in the frame and not only followed into it [0, 1000]: enough where the pose
  // before was sure and min_inliers of the points are established; else all must be. What is followed slides together
  // with what comes before the wall, so detected features have to agree; but on living tissue the detector finds few of
  // its features again (tracking/decisions/2026-11-26-followed-features-hold-a-sure-pose.md).
  int min_detected = 5;
  // Points that were established when the map was last seen well: a tracked pose shows so many of them, or a tenth of
  // those that should be in view where that is less. What came before the wall shows next to none
  // (tracking/decisions/2026-11-28-debris-is-no-wall.md) [0, 1000]; 0: none are asked for.
  int min_seasoned = 8;
  int min_recovery_inliers = 20;     // a pose found by brute force needs more [6, 1000]
  bool brute_force_recovery = true;  // off: a frame that guided search cannot place is lost (for comparison)
  double max_jump_depth_ratio =
      0.5;                     // tracked motion in one frame over the median depth: more is inconsistent [0.01, 10]
  double max_jump_deg = 25.0;  // rotation in one frame [1, 180]
};

struct KeyframeConfig {
  double min_tracked_ratio =
      0.80;  // tracked points over those of the reference keyframe: fewer asks for a keyframe [0, 1]
  double min_spacing_ms = 100.0;   // [0, 60000]
  double max_spacing_ms = 1000.0;  // a keyframe if the scope moved at all [1, 600000]
  double min_parallax_deg = 3.0;  // motion since the last keyframe seen from the median point that asks for one [0, 90]
  int low_inliers = 60;           // fewer tracked points than this ask for a keyframe at once [0, 10000]
};

struct MappingConfig {
  int triangulation_neighbours = 8;   // best covisible keyframes a new one is matched with [1, 40]
  double triangulation_ratio = 0.85;  // [0.1, 1]
  // Of a new point, in sigmas of its observations. Of points with less, those are taken whose noise happens to widen
  // the angle: they come out too near, each generation nearer than the last, and the scale of the map collapses [0.5,
  // 20].
  double min_parallax_sigmas = 3.0;
  double min_parallax_deg = 0.5;           // never less: beyond noise there is motion of the wall [0.01, 30]
  double min_baseline_depth_ratio = 0.01;  // [0, 1]; 0.05: less drift on pulled tissue, less exact on rigid walls
  // Covisible keyframes a new one is matched with by appearance alone (mapping/track_linker.h); 0: off [0, 40].
  // Without, the scale of a young map runs away on real tissue; beyond six little is gained.
  int link_neighbours = 6;
  // Adjusted before anything is searched where the poses put it [2, 60]. With ten, a map in three of a slow laparoscopy
  // still loses its scale.
  int link_window_keyframes = 20;
  // A map of up to so many keyframes is asked whether it is the mirror of what is seen (mapping/relief_check.h); 0:
  // none is [0, 60]. The founding cannot tell, pairs a few keyframes apart can. Older maps hold too much to be built
  // anew.
  int relief_keyframes = 14;
  double link_ratio = 0.8;  // as in foundings: nothing but the epipolar geometry of the matches guards them [0.1, 1]
  // Of the inverse depth of a point, relative, about that of the wall around it. In reconstructions of real colons all
  // depths of a view differ by a third; steps of folds are wider [0.05, 5].
  double surface_spread = 0.4;
  int fuse_neighbours = 12;    // keyframes whose points are searched in the new one and back [1, 60]
  int window_keyframes = 35;   // optimised by local bundle adjustment [2, 60]
  int fixed_keyframes = 20;    // older ring that holds the gauge [0, 60]
  int min_shared_points = 15;  // to be a covisible neighbour [1, 1000]
  int bundle_iterations = 10;  // [1, 100]
  int max_bundle_ms = 150;     // real-time mode only; sequential mode counts iterations [1, 10000]
  // A point of two views only has no witness for its depth, and living walls give many false ones: it has to be found
  // again soon.
  int point_trial_keyframes = 3;     // made after a point, before it is judged by its observations [1, 1000]
  int min_lasting_observations = 3;  // a point with fewer after its trial is culled [2, 40]
  // A keyframe whose points are seen so much elsewhere is culled [0.5, 1].
  // 0.8: with 0.7 a loop is missed (decisions/2026-11-25-keyframes-that-maps-need.md in engine/mapping).
  double redundant_share = 0.80;
  int min_map_keyframes = 4;  // a map with fewer is dropped when it is lost [2, 100]
};

// Capacities, fixed at start-up. Defaults are those of the profile medium; platform/config/memory_profiles.cc has the
// others and the reasons. What happens when a pool is full: engine/atlas/atlas.h, engine/mapping/evictor.h and
// mapper.h, engine/tracking/tracker.h (feature sets, proposals), engine/tracking/tracking_link.h (replies),
// engine/atlas/local_map.h (snapshots), engine/place/place_excerpt.h (place recognition). Fixed by the layout of the
// data, not by the configuration: observations of a point (kMaxObservations), keyframes of a snapshot
// (kMaxLocalKeyframes), marks (kMaxMarks).
struct MemoryConfig {
  std::string profile = "medium";  // small, medium, large: sets all keys of this section that are not given
  int max_keyframes = 1500;        // over all maps (paper: 1 196 after a whole procedure) [16, 100000]
  int max_map_points = 180000;     // over all maps (paper: 129 538) [1000, 10000000]
  int max_maps = 256;              // [2, 10000]
  int max_keyframe_ids = 40000;    // of one run: loaded keyframes, and all made, culled ones too [100, 10000000]
  int max_local_points = 8000;     // of a snapshot [500, 100000]
  // The tracker asks for a keyframe only when the mapper is idle, but for one in need; more would be stale work [2,
  // 32].
  int max_proposals = 3;
  // Beside those of the keyframes and of an initialisation: current and last frame, proposals, sets of culled keyframes
  // that a snapshot may still name [16, 1000].
  int spare_feature_sets = 32;
  int max_map_events = 1024;  // not yet read by the session; newer ones are lost then [16, 100000]
  // Of a doctor, over all maps; when there is no room the next one is refused [0, 32].
  int max_marks = 32;
  int max_late_poses = 1024;      // likewise; a lost one leaves its frame without a pose [16, 100000]
  int small_map_keyframes = 8;    // an inactive map up to this size may go as a whole [2, 1000]
  double max_host_mb = 1800.0;    // of the plan, 0: no limit [0, 1000000]
  double max_device_mb = 1000.0;  // likewise [0, 1000000]
};

struct EngineConfig {
  FeatureConfig features;
  NoiseConfig noise;
  MatchingConfig matching;
  InitialisationConfig initialisation;
  TrackingConfig tracking;
  KeyframeConfig keyframes;
  MappingConfig mapping;
  PlaceConfig place;
  MergingConfig merging;
  DepthConfig depth;
  MemoryConfig memory;
  SchedulerConfig scheduler;
  RealTimeConfig rt;  // the platform reads it; here so that a program has one configuration
  std::uint64_t seed = 1;
};

}  // namespace haustra
