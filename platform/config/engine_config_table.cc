#include "platform/config/engine_config_table.h"

#include <cmath>
#include <utility>

#include "platform/config/memory_profiles.h"
#include "platform/realtime/realtime_threads.h"

namespace haustra {
namespace {

// Nothing is reloaded while running yet: the engine takes its configuration at the start.
constexpr ConfigReload kRestart = ConfigReload::kRestart;

using Fields = std::vector<ConfigField>;

template <auto kMember>
ConfigField Feature(const char* key, ConfigRange range, const char* unit, const char* description) {
  return BindField<&EngineConfig::features, kMember>(std::string("features.") + key, range, unit, description,
                                                     kRestart);
}
void AddFeatures(Fields* out) {
  using C = FeatureConfig;
  out->push_back(Feature<&C::max>("max", {100, 8000}, "features", "features of a frame"));
  out->push_back(Feature<&C::max_detected>("max_detected", {100, 8000}, "features",
                                           "of them, those that are detected; the others are followed"));
  out->push_back(Feature<&C::are_followed>("are_followed", {}, "",
                                           "features that the detector loses are followed by optical flow"));
  out->push_back(
      Feature<&C::contrast_threshold>("contrast_threshold", {0, 0.2}, "",
                                      "difference of Gaussians of intensities in [0, 1] below which there is "
                                      "no feature; 0: the extractor's own floor"));
  out->push_back(Feature<&C::edge_threshold>("edge_threshold", {2, 50}, "", "largest ratio of principal curvatures"));
  out->push_back(Feature<&C::reflection_threshold>("reflection_threshold", {1, 256}, "grey",
                                                   "value from which a pixel is a specular reflection; 256: off"));
  out->push_back(Feature<&C::border_threshold>("border_threshold", {0, 128}, "grey",
                                               "value up to which a dark pixel at the border is outside the scope"));
  out->push_back(Feature<&C::mask_dilation_px>("mask_dilation_px", {0, 32}, "px",
                                               "safe distance around masked pixels in the finest octave"));
  out->push_back(Feature<&C::root_sift>("root_sift", {}, "", "square roots of the L1-normalised descriptor"));
  out->push_back(Feature<&C::upright_dark>("upright_dark", {}, "",
                                           "dark blobs are described upright, bright ones by their orientation"));
  out->push_back(Feature<&C::finds_overlay>("finds_overlay", {}, "",
                                            "leave out what stands still in the picture while the scene moves"));
}

template <auto kMember>
ConfigField Noise(const char* key, ConfigRange range, const char* unit, const char* description) {
  return BindField<&EngineConfig::noise, kMember>(std::string("noise.") + key, range, unit, description, kRestart);
}
void AddNoise(Fields* out) {
  using C = NoiseConfig;
  out->push_back(Noise<&C::k>("k", {0, 10}, "px per px", "standard deviation of an observation by SIFT scale"));
  out->push_back(Noise<&C::sigma_0_px>("sigma_0_px", {0, 20}, "px", "standard deviation of an observation at scale 0"));
  out->push_back(Noise<&C::is_measured>("measured", {}, "", "both are followed on the running map, near these values"));
}

template <auto kMember>
ConfigField Matching(const char* key, ConfigRange range, const char* unit, const char* description) {
  return BindField<&EngineConfig::matching, kMember>(std::string("matching.") + key, range, unit, description,
                                                     kRestart);
}
void AddMatching(Fields* out) {
  using C = MatchingConfig;
  out->push_back(Matching<&C::min_similarity>("min_similarity", {0, 1}, "cosine",
                                              "below it two descriptors show different things"));
  out->push_back(Matching<&C::guided_ratio>("guided_ratio", {0.1, 1}, "", "ratio of angles in guided search"));
  out->push_back(Matching<&C::brute_force_ratio>("brute_force_ratio", {0.1, 1}, "",
                                                 "ratio of angles in search without a prediction"));
  out->push_back(Matching<&C::scale_tolerance>("scale_tolerance", {1.1, 4}, "",
                                               "factor by which a keypoint's scale may differ from its prediction"));
  out->push_back(Matching<&C::max_view_angle_deg>("max_view_angle_deg", {10, 90}, "deg",
                                                  "between a point's mean viewing direction and the current ray"));
}

template <auto kMember>
ConfigField Initialisation(const char* key, ConfigRange range, const char* unit, const char* description) {
  return BindField<&EngineConfig::initialisation, kMember>(std::string("initialisation.") + key, range, unit,
                                                           description, kRestart);
}
void AddInitialisation(Fields* out) {
  using C = InitialisationConfig;
  out->push_back(Initialisation<&C::brute_force_ratio>("brute_force_ratio", {0.1, 1}, "",
                                                       "ratio of angles between the two views"));
  out->push_back(Initialisation<&C::max_disparity_deg>("max_disparity_deg", {0.1, 180}, "deg",
                                                       "between the matches of the two views, along each axis"));
  out->push_back(
      Initialisation<&C::min_matches>("min_matches", {10, 8000}, "matches", "below it the reference frame is renewed"));
  out->push_back(
      Initialisation<&C::min_points>("min_points", {10, 8000}, "points", "triangulated points of a new map"));
  out->push_back(Initialisation<&C::noise_k>("noise_k", {0.05, 10}, "",
                                             "sigma of a feature over its scale, between two views near in time"));
  out->push_back(Initialisation<&C::noise_sigma_0_px>("noise_sigma_0_px", {0, 10}, "px",
                                                      "sigma of the finest feature, between two views near in time"));
  out->push_back(Initialisation<&C::min_parallax_sigmas>("min_parallax_sigmas", {1, 100}, "",
                                                         "the same in sigmas of the noise above: either is enough"));
  out->push_back(Initialisation<&C::min_parallax_deg>("min_parallax_deg", {0.05, 30}, "deg", "median over the points"));
  out->push_back(Initialisation<&C::max_direction_sigma_deg>(
      "max_direction_sigma_deg", {0.1, 90}, "deg", "of the direction of travel, with the noise that all matches show"));
  out->push_back(Initialisation<&C::min_gap_ms>("min_gap_ms", {0, 10000}, "ms", "between the two views"));
  out->push_back(Initialisation<&C::min_inlier_share>("min_inlier_share", {0, 1}, "",
                                                      "inliers of the epipolar geometry over matches"));
  out->push_back(Initialisation<&C::min_spread>(
      "min_spread", {0, 1}, "", "area of the ellipse fitted to the points over that of the scope's window"));
  out->push_back(Initialisation<&C::max_unexplained_ms>(
      "max_unexplained_ms", {0, 60000}, "ms",
      "without a motion that explains the matches, then the reference is renewed"));
  out->push_back(Initialisation<&C::kept_views>("kept_views", {2, 1000}, "views",
                                                "after the reference: they are placed when the map stands"));
}

template <auto kMember>
ConfigField Tracking(const char* key, ConfigRange range, const char* unit, const char* description) {
  return BindField<&EngineConfig::tracking, kMember>(std::string("tracking.") + key, range, unit, description,
                                                     kRestart);
}
void AddTracking(Fields* out) {
  using C = TrackingConfig;
  out->push_back(Tracking<&C::motion_radius_deg>("motion_radius_deg", {0.1, 45}, "deg",
                                                 "search radius around the constant-velocity prediction"));
  out->push_back(Tracking<&C::wide_radius_factor>("wide_radius_factor", {1, 10}, "",
                                                  "radius of the second try when the first finds too few"));
  out->push_back(Tracking<&C::min_motion_matches>("min_motion_matches", {5, 1000}, "matches",
                                                  "below it: second try, then brute force"));
  out->push_back(Tracking<&C::min_inliers>("min_inliers", {6, 1000}, "points", "a pose with fewer is not a pose"));
  out->push_back(Tracking<&C::min_detected>("min_detected", {0, 1000}, "points",
                                            "of them, detected in the frame and not only followed into it"));
  out->push_back(Tracking<&C::min_seasoned>("min_seasoned", {0, 1000}, "points",
                                            "of a tracked pose, known when the map was last seen well"));
  out->push_back(Tracking<&C::min_recovery_inliers>("min_recovery_inliers", {6, 1000}, "points",
                                                    "a pose found by brute force needs as many"));
  out->push_back(Tracking<&C::brute_force_recovery>("brute_force_recovery", {}, "",
                                                    "off: a frame that guided search cannot place is lost"));
  out->push_back(
      Tracking<&C::max_jump_depth_ratio>("max_jump_depth_ratio", {0.01, 10}, "",
                                         "motion in one frame over the median depth above which it is inconsistent"));
  out->push_back(Tracking<&C::max_jump_deg>("max_jump_deg", {1, 180}, "deg",
                                            "rotation in one frame above which it is inconsistent"));
}

template <auto kMember>
ConfigField Keyframe(const char* key, ConfigRange range, const char* unit, const char* description) {
  return BindField<&EngineConfig::keyframes, kMember>(std::string("keyframes.") + key, range, unit, description,
                                                      kRestart);
}
void AddKeyframes(Fields* out) {
  using C = KeyframeConfig;
  out->push_back(Keyframe<&C::min_tracked_ratio>(
      "min_tracked_ratio", {0, 1}, "",
      "tracked points over those of the reference keyframe; fewer asks for a keyframe"));
  out->push_back(Keyframe<&C::min_spacing_ms>("min_spacing_ms", {0, 60000}, "ms", "between two keyframes"));
  out->push_back(Keyframe<&C::max_spacing_ms>("max_spacing_ms", {1, 600000}, "ms",
                                              "after these a keyframe is made if the scope moved at all"));
  out->push_back(
      Keyframe<&C::min_parallax_deg>("min_parallax_deg", {0, 90}, "deg",
                                     "motion since the last keyframe, seen from the median point, that asks for one"));
  out->push_back(Keyframe<&C::low_inliers>("low_inliers", {0, 10000}, "points",
                                           "fewer tracked points ask for a keyframe at once"));
}

template <auto kMember>
ConfigField Mapping(const char* key, ConfigRange range, const char* unit, const char* description) {
  return BindField<&EngineConfig::mapping, kMember>(std::string("mapping.") + key, range, unit, description, kRestart);
}
void AddMapping(Fields* out) {
  using C = MappingConfig;
  out->push_back(Mapping<&C::triangulation_neighbours>("triangulation_neighbours", {1, 40}, "keyframes",
                                                       "best covisible keyframes that a new one is matched with"));
  out->push_back(Mapping<&C::triangulation_ratio>("triangulation_ratio", {0.1, 1}, "",
                                                  "ratio of angles of a match that makes a new point"));
  out->push_back(Mapping<&C::min_parallax_sigmas>("min_parallax_sigmas", {0.5, 20}, "",
                                                  "of a new point, in sigmas of its observations"));
  out->push_back(Mapping<&C::min_parallax_deg>("min_parallax_deg", {0.01, 30}, "deg", "of a new point, at least"));
  out->push_back(Mapping<&C::min_baseline_depth_ratio>("min_baseline_depth_ratio", {0, 1}, "",
                                                       "baseline over median depth of a pair that makes new points"));
  out->push_back(Mapping<&C::link_neighbours>("link_neighbours", {0, 40}, "keyframes",
                                              "that a new one is matched with by appearance alone; 0: none"));
  out->push_back(Mapping<&C::link_window_keyframes>("link_window_keyframes", {2, 60}, "keyframes",
                                                    "adjusted when they are linked, before the guided search"));
  out->push_back(Mapping<&C::link_ratio>("link_ratio", {0.1, 1}, "", "ratio of angles of such a match"));
  out->push_back(
      Mapping<&C::relief_keyframes>("relief_keyframes", {0, 60}, "keyframes",
                                    "up to which a map is asked whether near and far are reversed; 0: none"));
  out->push_back(Mapping<&C::surface_spread>(
      "surface_spread", {0.05, 5}, "", "relative, of the inverse depth of a point about that of the wall near it"));
  out->push_back(Mapping<&C::fuse_neighbours>("fuse_neighbours", {1, 60}, "keyframes",
                                              "whose points are searched in the new one and back"));
  out->push_back(
      Mapping<&C::window_keyframes>("window_keyframes", {2, 60}, "keyframes", "optimised by local bundle adjustment"));
  out->push_back(Mapping<&C::fixed_keyframes>("fixed_keyframes", {0, 60}, "keyframes",
                                              "older ring that holds the gauge of local bundle adjustment"));
  out->push_back(
      Mapping<&C::min_shared_points>("min_shared_points", {1, 1000}, "points", "that make two keyframes neighbours"));
  out->push_back(Mapping<&C::bundle_iterations>("bundle_iterations", {1, 100}, "iterations",
                                                "most steps of one local bundle adjustment"));
  out->push_back(Mapping<&C::max_bundle_ms>("max_bundle_ms", {1, 10000}, "ms",
                                            "time of one local bundle adjustment, real-time mode only"));
  out->push_back(Mapping<&C::point_trial_keyframes>("point_trial_keyframes", {1, 1000}, "keyframes",
                                                    "made after a point, before it is judged by its observations"));
  out->push_back(Mapping<&C::min_lasting_observations>("min_lasting_observations", {2, 40}, "observations",
                                                       "a point with fewer after its trial is culled"));
  out->push_back(Mapping<&C::redundant_share>("redundant_share", {0.5, 1}, "",
                                              "share of its points seen elsewhere at which a keyframe is culled"));
  out->push_back(Mapping<&C::min_map_keyframes>("min_map_keyframes", {2, 100}, "keyframes",
                                                "a map with fewer is dropped when it is lost"));
}

template <auto kMember>
ConfigField Retrieval(const char* key, ConfigRange range, const char* unit, const char* description) {
  return BindField<&EngineConfig::place, &PlaceConfig::retrieval, kMember>(std::string("retrieval.") + key, range, unit,
                                                                           description, kRestart);
}
void AddRetrieval(Fields* out) {
  using C = RetrievalConfig;
  out->push_back(Retrieval<&C::max_descriptors>("max_descriptors", {16, 8000}, "descriptors",
                                                "strongest ones of each side that vote"));
  out->push_back(Retrieval<&C::max_keyframes_per_query>("max_keyframes_per_query", {1, 100000}, "keyframes",
                                                        "voted on; of more, those that the index ranks first"));
  out->push_back(Retrieval<&C::max_angle_ratio>("max_angle_ratio", {0.1, 1}, "", "of a vote"));
  out->push_back(Retrieval<&C::min_votes>("min_votes", {1, 1000}, "votes", "fewer are chance"));
  out->push_back(BindChoice<&EngineConfig::place, &PlaceConfig::retrieval, &C::kind>(
      "retrieval.kind", {"exhaustive", "vocabulary"},
      "how keyframes that look alike are found: by matching descriptors, or by visual words", kRestart));
  out->push_back(BindText<&EngineConfig::place, &PlaceConfig::retrieval, &C::vocabulary>(
      "retrieval.vocabulary",
      "file with the visual words (haustra vocabulary), relative to the folder that the program runs in", kRestart));
}

template <auto kMember>
ConfigField Area(const char* key, ConfigRange range, const char* unit, const char* description) {
  return BindField<&EngineConfig::place, &PlaceConfig::common_area, kMember>(std::string("common_area.") + key, range,
                                                                             unit, description, kRestart);
}
void AddCommonArea(Fields* out) {
  using C = CommonAreaConfig;
  out->push_back(Area<&C::group_size>("group_size", {1, 3}, "",
                                      "keyframe and its best covisible ones on the other side (paper: 1-to-3)"));
  out->push_back(Area<&C::min_points>("min_points", {4, 8000}, "points", "a keyframe with fewer carries no proof"));
  out->push_back(Area<&C::max_angle_ratio>("max_angle_ratio", {0.1, 1}, "", "of a brute-force match"));
  out->push_back(Area<&C::min_matches>("min_matches", {4, 8000}, "matches", "of points, before any geometry"));
  out->push_back(Area<&C::ransac_iterations>("ransac_iterations", {10, 10000}, "iterations", "samples tried at most"));
  out->push_back(Area<&C::min_ransac_inliers>("min_ransac_inliers", {4, 8000}, "points",
                                              "points that the best sample must gather"));
  out->push_back(Area<&C::min_match_share>(
      "min_match_share", {0, 1}, "", "of the brute-force matches that agree; where walls are only alike, few do"));
  out->push_back(Area<&C::min_inliers>("min_inliers", {4, 8000}, "points",
                                       "of points, after guided matching and the last refinement"));
  out->push_back(Area<&C::min_inlier_share>("min_inlier_share", {0, 1}, "",
                                            "of the guided matches that agree with the refined similarity"));
  out->push_back(Area<&C::min_visible_share>(
      "min_visible_share", {0, 1}, "", "of the points that should be seen from both sides, those that are found"));
  out->push_back(
      Area<&C::min_spread>("min_spread", {0, 1}, "",
                           "share of the scope's window inside the ellipse around the inliers, in both keyframes"));
  out->push_back(Area<&C::min_group_poses>("min_group_poses", {1, 41}, "keyframes",
                                           "that find a pose where several tell the similarity"));
  out->push_back(Area<&C::min_group_visible_share>("min_group_visible_share", {0, 1}, "", "min_visible_share, there"));
  out->push_back(
      Area<&C::max_group_disagreement>("max_group_disagreement", {0.01, 100}, "",
                                       "of the similarities that different keyframes lead to, over max_..._sigma"));
  out->push_back(Area<&C::max_scale_ratio>("max_scale_ratio", {1, 1000}, "",
                                           "between two maps, each of unit median depth when it was founded"));
  out->push_back(Area<&C::max_view_angle_deg>("max_view_angle_deg", {1, 180}, "deg",
                                              "between the optical axes of the two keyframes"));
  out->push_back(Area<&C::max_rotation_sigma_deg>("max_rotation_sigma_deg", {0.01, 90}, "deg",
                                                  "uncertainty of the similarity that the inliers leave"));
  out->push_back(Area<&C::max_scale_sigma>("max_scale_sigma", {0.001, 1}, "", "relative"));
  out->push_back(
      Area<&C::max_position_sigma>("max_position_sigma", {0.001, 1}, "", "of the camera, over the median depth"));
  out->push_back(Area<&C::confirming_keyframes>("confirming_keyframes", {1, 40}, "keyframes",
                                                "neighbours of the new keyframe that are asked"));
  out->push_back(Area<&C::min_confirming>("min_confirming", {0, 40}, "",
                                          "neighbours that must see the same area, when there are so many"));
  out->push_back(Area<&C::min_confirming_inliers>("min_confirming_inliers", {4, 8000}, "points",
                                                  "points for a neighbour's consent"));
  out->push_back(Area<&C::max_drift_share>("max_drift_share", {0.01, 1}, "",
                                           "inside one map: what a loop corrects over the length of the way round"));
  out->push_back(Area<&C::max_drift_scale>("max_drift_scale", {1, 10}, "", "the same for the scale, as a ratio"));
  out->push_back(Area<&C::max_drift_deg>("max_drift_deg", {1, 180}, "deg", "the same for the rotation"));
  out->push_back(Area<&C::min_doubled>("min_doubled", {0, 100}, "",
                                       "inside one map: matches that are two points, over those that are one already"));
}

template <auto kMember>
ConfigField Recognition(const char* key, ConfigRange range, const char* unit, const char* description) {
  return BindField<&EngineConfig::place, &PlaceConfig::recognition, kMember>(std::string("recognition.") + key, range,
                                                                             unit, description, kRestart);
}
void AddRecognition(Fields* out) {
  using C = RecognitionConfig;
  out->push_back(Recognition<&C::max_candidates>("max_candidates", {1, 20}, "keyframes", "verified for one keyframe"));
  out->push_back(Recognition<&C::max_shared_share>(
      "max_shared_share", {0, 1}, "", "of its points: keyframes that share so many with it are not asked"));
  out->push_back(Recognition<&C::rival_share>("rival_share", {0, 1}, "",
                                              "a rival place needs this share of the votes of the best to be heard"));
  out->push_back(Recognition<&C::rival_agreement>(
      "rival_agreement", {0.01, 10}, "",
      "poses by two verified places of one map: positions over the median depth, angles in radians"));
}

template <auto kMember>
ConfigField Relocalising(const char* key, ConfigRange range, const char* unit, const char* description) {
  return BindField<&EngineConfig::place, &PlaceConfig::relocalisation, kMember>(std::string("relocalisation.") + key,
                                                                                range, unit, description, kRestart);
}
void AddRelocalisation(Fields* out) {
  using C = RelocalisationConfig;
  out->push_back(
      Relocalising<&C::max_candidates>("max_candidates", {1, 20}, "keyframes", "keyframes tried for one frame"));
  out->push_back(Relocalising<&C::group_size>("group_size", {1, 20}, "",
                                              "keyframe and its best covisible ones whose points are matched"));
  out->push_back(Relocalising<&C::max_angle_ratio>("max_angle_ratio", {0.1, 1}, "", "of a brute-force match"));
  out->push_back(
      Relocalising<&C::min_matches>("min_matches", {4, 8000}, "matches", "brute-force matches before any geometry"));
  out->push_back(
      Relocalising<&C::ransac_iterations>("ransac_iterations", {10, 10000}, "iterations", "samples tried at most"));
  out->push_back(Relocalising<&C::min_ransac_inliers>("min_ransac_inliers", {4, 8000}, "points",
                                                      "points that the best sample must gather"));
  out->push_back(Relocalising<&C::min_match_share>(
      "min_match_share", {0, 1}, "", "of the brute-force matches that agree; where walls are only alike, few do"));
  out->push_back(Relocalising<&C::min_inliers>("min_inliers", {4, 8000}, "points", "after guided matching"));
  out->push_back(Relocalising<&C::min_inlier_share>("min_inlier_share", {0, 1}, "",
                                                    "of the guided matches that agree with the pose"));
  out->push_back(Relocalising<&C::min_spread>("min_spread", {0, 1}, "",
                                              "share of the scope's window inside the ellipse around the inliers"));
  out->push_back(
      Relocalising<&C::max_rotation_sigma_deg>("max_rotation_sigma_deg", {0.01, 90}, "deg", "uncertainty of the pose"));
  out->push_back(Relocalising<&C::max_position_sigma>("max_position_sigma", {0.001, 1}, "", "over the median depth"));
}

template <auto kMember>
ConfigField Merge(const char* key, ConfigRange range, const char* unit, const char* description) {
  return BindField<&EngineConfig::merging, kMember>(std::string("merging.") + key, range, unit, description, kRestart);
}
void AddMerging(Fields* out) {
  using C = MergingConfig;
  out->push_back(Merge<&C::enabled>("enabled", {0, 1}, "", "off: every loss leaves a map of its own"));
  out->push_back(Merge<&C::window_keyframes>("window_keyframes", {2, 30}, "keyframes",
                                             "of each side of the seam that are fused and welded"));
  out->push_back(Merge<&C::fixed_keyframes>("fixed_keyframes", {0, 60}, "keyframes",
                                            "older ring that holds the gauge of the weld"));
  out->push_back(
      Merge<&C::weld_iterations>("weld_iterations", {1, 100}, "iterations", "of the bundle adjustment over the seam"));
  out->push_back(
      Merge<&C::graph_iterations>("graph_iterations", {1, 200}, "iterations", "of the pose graph behind the seam"));
  out->push_back(
      Merge<&C::graph_min_shared>("graph_min_shared", {1, 1000}, "points", "points of an edge of the essential graph"));
  out->push_back(Merge<&C::graph_max_edges>("graph_max_edges", {0, 60}, "edges",
                                            "strongest ones of each keyframe, beside the one that keeps it connected"));
  out->push_back(Merge<&C::graph_max_nodes>("graph_max_nodes", {10, 10000}, "nodes",
                                            "in a larger map neighbouring keyframes share one and move in one piece"));
  out->push_back(Merge<&C::settling_rounds>("settling_rounds", {0, 100}, "rounds",
                                            "of bundle adjustment around the seam while the mapper is idle, at most"));
  out->push_back(Merge<&C::settling_iterations>("settling_iterations", {1, 100}, "iterations", "of each round"));
  out->push_back(Merge<&C::settling_keyframes>("settling_keyframes", {2, 1000}, "keyframes",
                                               "nearest ones by covisibility that settle together"));
  out->push_back(Merge<&C::settling_milliseconds>("settling_milliseconds", {1, 10000}, "ms",
                                                  "real-time mode only: end of each round, best state kept"));
  out->push_back(Merge<&C::slice_milliseconds>("slice_milliseconds", {1, 1000}, "ms",
                                               "real-time mode only: of a join between two keyframes that wait"));
  out->push_back(Merge<&C::max_milliseconds>("max_milliseconds", {1, 10000}, "ms",
                                             "real-time mode only: of all slices of a join, best state kept"));
}

template <auto kMember>
ConfigField Depth(const char* key, ConfigRange range, const char* unit, const char* description) {
  return BindField<&EngineConfig::depth, kMember>(std::string("depth.") + key, range, unit, description, kRestart);
}
void AddDepth(Fields* out) {
  using C = DepthConfig;
  out->push_back(Depth<&C::enabled>("enabled", {}, "", "search the depth of keyframes in the background and keep it"));
  out->push_back(Depth<&C::step_px>("step_px", {1, 8}, "px", "from one cell of the depth to the next"));
  out->push_back(Depth<&C::iterations>("iterations", {1, 20}, "iterations", "of the search"));
  out->push_back(Depth<&C::max_sources>("max_sources", {1, 12}, "keyframes", "that one is compared with"));
  out->push_back(Depth<&C::kept_pictures>("kept_pictures", {4, 200}, "pictures", "of the newest keyframes"));
  out->push_back(Depth<&C::newer_keyframes>("newer_keyframes", {0, 100}, "keyframes",
                                            "that come after one before its depth is searched"));
}

template <auto kMember>
ConfigField Memory(const char* key, ConfigRange range, const char* unit, const char* description) {
  return BindField<&EngineConfig::memory, kMember>(std::string("memory.") + key, range, unit, description, kRestart);
}
void AddMemory(Fields* out) {
  using C = MemoryConfig;
  out->push_back(BindChoice<&EngineConfig::memory, &C::profile>(
      "memory.profile", MemoryProfileNames(), "sets every key of this section that is not given itself", kRestart));
  out->push_back(Memory<&C::max_keyframes>("max_keyframes", {16, 100000}, "keyframes", "of all maps"));
  out->push_back(Memory<&C::max_map_points>("max_map_points", {1000, 10000000}, "points", "of all maps"));
  out->push_back(Memory<&C::max_maps>("max_maps", {2, 10000}, "maps", "of the atlas"));
  out->push_back(Memory<&C::max_keyframe_ids>("max_keyframe_ids", {100, 10000000}, "keyframes",
                                              "of one run: loaded keyframes, and all made, culled ones too"));
  out->push_back(Memory<&C::max_local_points>("max_local_points", {500, 100000}, "points", "of a local map snapshot"));
  out->push_back(
      Memory<&C::max_proposals>("max_proposals", {2, 32}, "", "keyframes and maps that wait for the mapper"));
  out->push_back(Memory<&C::spare_feature_sets>("spare_feature_sets", {16, 1000}, "sets", "beside the keyframes'"));
  out->push_back(Memory<&C::max_map_events>("max_map_events", {16, 100000}, "events", "not yet read by the session"));
  out->push_back(Memory<&C::max_marks>("max_marks", {0, 32}, "marks", "that a doctor may set, over all maps"));
  out->push_back(Memory<&C::max_late_poses>("max_late_poses", {16, 100000}, "poses", "not yet read by the session"));
  out->push_back(Memory<&C::small_map_keyframes>("small_map_keyframes", {2, 1000}, "keyframes",
                                                 "an inactive map up to this size may go as a whole to make room"));
  out->push_back(Memory<&C::max_host_mb>("max_host_mb", {0, 1000000}, "MB", "limit of the host's plan, 0: none"));
  out->push_back(Memory<&C::max_device_mb>("max_device_mb", {0, 1000000}, "MB", "limit of the device's plan, 0: none"));
}

template <auto kMember>
ConfigField Scheduler(const char* key, ConfigRange range, const char* unit, const char* description) {
  return BindField<&EngineConfig::scheduler, kMember>(std::string("scheduler.") + key, range, unit, description,
                                                      kRestart);
}
void AddScheduler(Fields* out) {
  using C = SchedulerConfig;
  out->push_back(Scheduler<&C::degrade>("degrade", {}, "", "off: every frame gets everything, however late it is"));
  out->push_back(
      Scheduler<&C::deadline_ms>("deadline_ms", {0, 1000}, "ms", "from capture to pose; 0: the period of the frames"));
  out->push_back(Scheduler<&C::reserve_ms>("reserve_ms", {0, 100}, "ms",
                                           "of it, kept for what comes after the last wait for the device"));
  out->push_back(Scheduler<&C::quantile>("quantile", {0.5, 1}, "",
                                         "of the last durations of a stage: the time that it is expected to take"));
  out->push_back(Scheduler<&C::retry_ms>("retry_ms", {1, 100000}, "ms",
                                         "until a refused stage is tried again; more when that fails"));
  out->push_back(Scheduler<&C::reduced_share>("reduced_share", {0.1, 1}, "",
                                              "of features and of local points, on the rungs that have fewer"));
  out->push_back(Scheduler<&C::reduced_min_scale_px>("reduced_min_scale_px", {0, 10}, "px",
                                                     "features finer than this are not looked for on that rung"));
  out->push_back(Scheduler<&C::lost_time_ms>("lost_time_ms", {0, 1000}, "ms",
                                             "for all features of a frame that is lost, even beyond its deadline"));
  out->push_back(
      Scheduler<&C::max_predicted_ms>("max_predicted_ms", {0, 10000}, "ms", "without a measurement, then lost"));
  out->push_back(Scheduler<&C::background_gap>("background_gap", {}, "",
                                               "mapping asks an accelerator for nothing while a frame is due"));
}

template <auto kMember>
ConfigField RealTime(const char* key, ConfigRange range, const char* unit, const char* description) {
  return BindField<&EngineConfig::rt, kMember>(std::string("rt.") + key, range, unit, description, kRestart);
}
template <auto kMember>
ConfigField RealTimeText(const char* key, const char* description) {
  return BindText<&EngineConfig::rt, kMember>(std::string("rt.") + key, description, kRestart);
}
void AddRealTime(Fields* out) {
  using C = RealTimeConfig;
  out->push_back(RealTime<&C::enabled>("enabled", {}, "", "off: real-time mode with ordinary scheduling"));
  out->push_back(RealTime<&C::require>("require", {}, "", "on: no start unless all of this section was granted"));
  out->push_back(RealTime<&C::capture_priority>("capture_priority", {0, 99}, "", "of SCHED_FIFO; 0: ordinary"));
  out->push_back(RealTime<&C::tracking_priority>("tracking_priority", {0, 99}, "", "of SCHED_FIFO; 0: ordinary"));
  out->push_back(RealTime<&C::mapping_priority>("mapping_priority", {0, 99}, "", "of SCHED_FIFO; 0: ordinary"));
  out->push_back(RealTime<&C::merging_priority>("merging_priority", {0, 99}, "",
                                                "of SCHED_FIFO; 0: ordinary; this thread recognises places"));
  out->push_back(RealTimeText<&C::capture_cpus>("capture_cpus", "processors, as in 3 or 0,2-5; empty: all"));
  out->push_back(RealTimeText<&C::tracking_cpus>("tracking_cpus", "processors; empty: all"));
  out->push_back(RealTimeText<&C::mapping_cpus>("mapping_cpus", "processors; empty: all"));
  out->push_back(RealTimeText<&C::merging_cpus>("merging_cpus", "processors; empty: all"));
  out->push_back(RealTime<&C::lock_memory>("lock_memory", {}, "", "no page leaves the memory, all are there at once"));
  out->push_back(RealTime<&C::stack_prefault_kb>("stack_prefault_kb", {0, 1024}, "kB",
                                                 "of each thread's stack, touched before its first frame"));
  out->push_back(RealTime<&C::heap_prefault_mb>(
      "heap_prefault_mb", {0, 4096}, "MB", "of the heap, touched before the first frame, with lock_memory: solvers"));
}

}  // namespace

std::vector<ConfigField> EngineConfigFields() {
  Fields fields;
  fields.push_back(
      BindField<&EngineConfig::seed>("seed", {0, 9007199254740991.0}, "", "start of every random sequence", kRestart));
  AddFeatures(&fields);
  AddNoise(&fields);
  AddMatching(&fields);
  AddInitialisation(&fields);
  AddTracking(&fields);
  AddKeyframes(&fields);
  AddMapping(&fields);
  AddRetrieval(&fields);
  AddCommonArea(&fields);
  AddRecognition(&fields);
  AddRelocalisation(&fields);
  AddMerging(&fields);
  AddDepth(&fields);
  AddMemory(&fields);
  AddScheduler(&fields);
  AddRealTime(&fields);
  return fields;
}

Status CheckEngineConfig(const EngineConfig& config) {
  if (config.keyframes.min_spacing_ms > config.keyframes.max_spacing_ms) {
    return FailedPrecondition(
        "keyframes.min_spacing_ms (" + std::to_string(std::lround(config.keyframes.min_spacing_ms)) +
        ") is above keyframes.max_spacing_ms (" + std::to_string(std::lround(config.keyframes.max_spacing_ms)) + ")");
  }
  if (config.initialisation.min_points > config.features.max) {
    return FailedPrecondition("initialisation.min_points (" + std::to_string(config.initialisation.min_points) +
                              ") is above features.max (" + std::to_string(config.features.max) +
                              "): no map could ever start");
  }
  if (config.noise.k == 0.0 && config.noise.sigma_0_px == 0.0) {
    return FailedPrecondition("noise.k and noise.sigma_0_px are both 0: an observation must have some noise");
  }
  const RetrievalConfig& retrieval = config.place.retrieval;
  if (retrieval.kind == "vocabulary" && retrieval.vocabulary.empty()) {
    return FailedPrecondition(
        "retrieval.kind is vocabulary, but retrieval.vocabulary names no file; 'haustra vocabulary' makes one");
  }
  if (config.memory.max_keyframe_ids < config.memory.max_keyframes) {
    return FailedPrecondition("memory.max_keyframe_ids (" + std::to_string(config.memory.max_keyframe_ids) +
                              ") is below memory.max_keyframes (" + std::to_string(config.memory.max_keyframes) + ")");
  }
  return CheckRealTimeConfig(config.rt);
}

Result<ConfigStore<EngineConfig>> LoadEngineConfig(const std::string& path,
                                                   const std::vector<std::string>& assignments) {
  return LoadConfig<EngineConfig>(EngineConfigFields(), std::identity(), path, assignments);
}

}  // namespace haustra
