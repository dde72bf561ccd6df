// Parameters of place recognition and relocalisation, with default, unit, range and reason. Plain
// data; the gates that all stages share (noise, similarity, scale tolerance) are those of engine/config.h.
#pragma once

#include <string>

namespace haustra {

// Which keyframes look alike at all.
struct RetrievalConfig {
  int max_descriptors = 256;         // strongest ones of each side that vote [16, 8000]
  int max_keyframes_per_query = 64;  // voted on; of more, those that the index ranks first [1, 100000]
  double max_angle_ratio = 0.85;     // of a vote [0.1, 1]
  int min_votes = 6;                 // fewer are chance [1, 1000]
  // exhaustive: by matching descriptors, needs no training; vocabulary: by visual words (vocabulary_retrieval.h), for
  // which the two limits of matching above mean nothing.
  std::string kind = "exhaustive";
  std::string vocabulary;  // file of the second kind; the engine is handed what is in it
};

// When two groups of keyframes show one piece of wall. Precision comes first: a false merge is worse than ten missed.
struct CommonAreaConfig {
  int group_size = 3;              // keyframe and its best covisible ones on the other side (paper: 1-to-3) [1, 3]
  int min_points = 30;             // a keyframe with fewer carries no proof [4, 8000]
  double max_angle_ratio = 0.85;   // of a brute-force match [0.1, 1]
  int min_matches = 15;            // of points, before any geometry [4, 8000]
  int ransac_iterations = 500;     // [10, 10000]
  int min_ransac_inliers = 12;     // [4, 8000]
  double min_match_share = 0.2;    // of the brute-force matches that agree; where walls are only alike, few do [0, 1]
  int min_inliers = 30;            // of points, after guided matching and the last refinement [4, 8000]
  double min_inlier_share = 0.6;   // of the guided matches that agree with the refined similarity [0, 1]
  double min_visible_share = 0.1;  // of the points that should be seen from both sides, those that are found [0, 1]
  // Share of the scope's window inside the ellipse around the inliers, in both keyframes [0, 1]. A compact patch far
  // away leaves open whether the scope was turned or moved aside: at 0.05 similarities were off by 1.5 to 2.9 degrees,
  // where their covariance said 0.3 to 0.4 (decisions/2026-11-26-a-patch-tells-no-similarity.md).
  double min_spread = 0.08;
  // Where not one keyframe but the poses of several tell the similarity (group_similarity.h). They bear witness for
  // each other: on living tissue 4 to 8 % of what should be visible is found.
  int min_group_poses = 3;                // keyframes that find a pose; all where there are fewer [1, 41]
  double min_group_visible_share = 0.04;  // in the place of min_visible_share [0, 1]
  // Starts from different keyframes must end in one similarity: what they differ by, over the three uncertainties
  // below. They did by 0.2 at most in true joins of tissue and of rendered walls, and by 1 where a young map had bent
  // and the join was false [0.01, 100].
  double max_group_disagreement = 0.4;
  double max_scale_ratio = 20.0;        // between two maps, each of unit median depth when it was founded [1, 1000]
  double max_view_angle_deg = 60.0;     // between the optical axes of the two keyframes [1, 180]
  double max_rotation_sigma_deg = 1.5;  // uncertainty of the similarity that the inliers leave [0.01, 90]
  double max_scale_sigma = 0.05;        // relative [0.001, 1]
  double max_position_sigma = 0.05;     // of the camera, over the median depth [0.001, 1]
  int confirming_keyframes = 5;         // neighbours of the new keyframe that are asked [1, 40]
  int min_confirming = 1;               // neighbours that must see the same area, when there are so many [0, 40]
  int min_confirming_inliers = 15;      // points for a neighbour's consent [4, 8000]
  double max_drift_share = 0.25;  // inside one map: what a loop corrects over the length of the way round [0.01, 1]
  double max_drift_scale = 1.6;   // the same for the scale, as a ratio [1, 10]
  double max_drift_deg = 30.0;    // the same for the rotation [1, 180]
  // Inside one map a wall is mapped once or twice: matches that are two points, over those that are one point already.
  // Where a colonoscopy goes on it was 0.2 to 0.4, and loops that were tried did harm; where a gallbladder comes back
  // it was 1.2 and more (decisions/2026-11-29-a-wall-is-mapped-once-or-twice.md) [0, 100].
  double min_doubled = 1.0;
};

struct RecognitionConfig {
  int max_candidates = 3;  // verified for one keyframe [1, 20]
  // Keyframes that see this part of the new one's points, or more, show nothing that its own neighbours do not know.
  // The others may hold its wall a second time, though they share points with it [0, 1].
  double max_shared_share = 0.2;
  double rival_share = 0.5;  // a rival place needs this share of the votes of the best to be heard [0, 1]
  // Two verified places of one map agree within it (place/rival_poses.h) [0.01, 10].
  double rival_agreement = 0.3;
};

struct RelocalisationConfig {
  int max_candidates = 6;         // keyframes tried for one frame [1, 20]
  int group_size = 4;             // keyframe and its best covisible ones whose points are matched [1, 20]
  double max_angle_ratio = 0.85;  // of a brute-force match [0.1, 1]
  int min_matches = 12;           // [4, 8000]
  int ransac_iterations = 1500;   // finds a pose that one match in six supports [10, 10000]
  int min_ransac_inliers = 10;    // [4, 8000]
  double min_match_share = 0.2;   // of the brute-force matches that agree; where walls are only alike, few do [0, 1]
  int min_inliers = 30;           // after guided matching [4, 8000]
  double min_inlier_share = 0.6;  // of the guided matches that agree with the pose [0, 1]
  double min_spread = 0.05;       // share of the scope's window inside the ellipse around the inliers [0, 1]
  double max_rotation_sigma_deg = 1.5;  // uncertainty of the pose [0.01, 90]
  double max_position_sigma = 0.05;     // over the median depth [0.001, 1]
};

struct PlaceConfig {
  RetrievalConfig retrieval;
  CommonAreaConfig common_area;
  RecognitionConfig recognition;
  RelocalisationConfig relocalisation;
};

}  // namespace haustra
