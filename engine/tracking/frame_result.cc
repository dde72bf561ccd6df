#include "engine/tracking/frame_result.h"

namespace haustra {

std::string_view ToString(TrackingState state) {
  switch (state) {
    case TrackingState::kInitialising: return "initialising";
    case TrackingState::kTracking: return "tracking";
    case TrackingState::kLost: return "lost";
  }
  return "unknown";
}

std::string_view ToString(TrackingReason reason) {
  switch (reason) {
    case TrackingReason::kTracked: return "tracked";
    case TrackingReason::kRecovered: return "recovered";
    case TrackingReason::kRelocalised: return "relocalised";
    case TrackingReason::kPredicted: return "predicted";
    case TrackingReason::kDamagedFrame: return "damaged_frame";
    case TrackingReason::kFewFeatures: return "few_features";
    case TrackingReason::kFewMatches: return "few_matches";
    case TrackingReason::kFewInliers: return "few_inliers";
    case TrackingReason::kWeakEvidence: return "weak_evidence";
    case TrackingReason::kInconsistentMotion: return "inconsistent_motion";
    case TrackingReason::kDeniedByFlow: return "denied_by_flow";
    case TrackingReason::kFirstView: return "first_view";
    case TrackingReason::kLowParallax: return "low_parallax";
    case TrackingReason::kNoEpipolarGeometry: return "no_epipolar_geometry";
    case TrackingReason::kUncertainMotion: return "uncertain_motion";
    case TrackingReason::kLowSpread: return "low_spread";
    case TrackingReason::kMapProposed: return "map_proposed";
    case TrackingReason::kAwaitingMap: return "awaiting_map";
    case TrackingReason::kNoTime: return "no_time";
  }
  return "unknown";
}

std::string_view ToString(SearchOutcome outcome) {
  switch (outcome) {
    case SearchOutcome::kNotSearched: return "not_searched";
    case SearchOutcome::kFound: return "found";
    case SearchOutcome::kNoAnswer: return "no_answer";
    case SearchOutcome::kFewMatches: return "few_matches";
    case SearchOutcome::kNoPose: return "no_pose";
    case SearchOutcome::kFewInliers: return "few_inliers";
    case SearchOutcome::kWeakEvidence: return "weak_evidence";
    case SearchOutcome::kLowMatchShare: return "low_match_share";
    case SearchOutcome::kLowSpread: return "low_spread";
    case SearchOutcome::kFewEstablished: return "few_established";
    case SearchOutcome::kUncertain: return "uncertain";
    case SearchOutcome::kDeniedByFlow: return "denied_by_flow";
  }
  return "unknown";
}

}  // namespace haustra
