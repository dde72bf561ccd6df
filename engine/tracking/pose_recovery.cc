#include "engine/tracking/pose_recovery.h"

#include <algorithm>

#include "engine/geometry/rng_streams.h"
#include "engine/tracking/reserve_touched.h"

namespace haustra {
namespace {

// After a loss there is no prediction that bears witness: inliers over those by chance. A false pose that was the best
// of many had 2, true ones had 8 and more.
constexpr double kChosenFactor = 4.0;
// A prediction bears witness for its pose: this share of the brute-force matches that relocalisation asks for will do.
// On a phantom seen from afar a pose that was 6 degrees off had 0.35 of it, on living tissue true ones had 0.8 at
// least.
constexpr double kPredictedShare = 0.5;

}  // namespace

PoseRecovery::PoseRecovery(const PoseSearch::Parts& parts, PoseSearch& search)
    : parts_(parts), search_(search), rng_(parts.config.seed, rng_stream::kRecovery) {
  const auto num_features = static_cast<std::size_t>(parts.config.features.max);
  const auto num_points = static_cast<std::size_t>(parts.config.memory.max_local_points);
  ReserveTouched(&questioned_.matches, num_features);
  ReserveTouched(&alike_, num_features);
  ReserveTouched(&refs_, num_points);
  found_.resize(num_features);
  is_matched_point_.resize(num_points);
  ReserveTouched(&pixels_, num_features);
}

std::size_t PoseRecovery::BytesFor(int max_features, int max_points) {
  // questioned_, alike_; found_; pixels_.
  constexpr std::size_t kOfFeature = 2 * sizeof(PointMatch) + sizeof(Match) + sizeof(Eigen::Vector2d);
  return static_cast<std::size_t>(max_features) * kOfFeature +
         static_cast<std::size_t>(max_points) * (sizeof(DescriptorRef) + 1);
}

bool PoseRecovery::SearchByBruteForce() {
  std::vector<PointMatch>& matches = search_.estimate().matches;
  matches.clear();
  alike_.clear();
  refs_.clear();
  const LocalMap& map = search_.local_map();
  for (int i = 0; i < map.num_points; ++i) refs_.push_back(map.points[i].descriptor);
  if (refs_.empty()) return false;
  MatchRequest request;
  request.query = DescriptorList::Whole(parts_.frame.features.set);
  request.train = DescriptorList::Gather(refs_);
  request.options = {static_cast<float>(parts_.config.matching.min_similarity),
                     static_cast<float>(parts_.config.matching.brute_force_ratio), true};
  request.matches = found_;
  request.num_matches = &num_found_;
  if (!parts_.lane.Match(request, parts_.budget.wait_deadline()).ok()) return false;
  for (int i = 0; i < num_found_; ++i) matches.push_back({found_[i].query, found_[i].train});
  alike_.assign(matches.begin(), matches.end());
  return true;
}

bool PoseRecovery::Recover(bool is_lost) {
  const FrameBudget::Timer timer(parts_.budget, Stage::kRecovery);
  outcome_ = Search(is_lost);
  // What the device does not answer counts as not found, at whatever gate that shows.
  if (outcome_ != SearchOutcome::kFound && parts_.lane.has_pending()) outcome_ = SearchOutcome::kNoAnswer;
  return outcome_ == SearchOutcome::kFound;
}

// kFound, or the first gate that the frame fails.
SearchOutcome PoseRecovery::Search(bool is_lost) {
  if (!SearchByBruteForce()) return refs_.empty() ? SearchOutcome::kFewMatches : SearchOutcome::kNoAnswer;
  const std::vector<PointMatch>& matches = search_.estimate().matches;
  if (static_cast<int>(matches.size()) < parts_.config.tracking.min_inliers) return SearchOutcome::kFewMatches;
  if (!search_.SampleMatches(rng_)) return SearchOutcome::kNoPose;
  search_.KeepInliers();
  if (!search_.FitMatches()) return SearchOutcome::kNoPose;
  search_.KeepInliers();
  if (!search_.SearchLocalMap(0.0) || !search_.FitMatches()) return SearchOutcome::kFewInliers;
  search_.KeepInliers();
  search_.LookAround();
  const int min_inliers = parts_.config.tracking.min_recovery_inliers;
  if (!search_.MeasureChance()) return SearchOutcome::kNoAnswer;
  if (!search_.HasEvidence(min_inliers, min_inliers)) return SearchOutcome::kWeakEvidence;
  if (const SearchOutcome judged = JudgeChosenPose(); judged != SearchOutcome::kFound) return judged;
  // A pose that was chosen as the best of many agrees with more than chance gives a single one.
  const bool is_chance = is_lost && static_cast<double>(matches.size()) < kChosenFactor * search_.NumByChance();
  return is_chance ? SearchOutcome::kWeakEvidence : SearchOutcome::kFound;
}

// Around a prediction a few points hold a wrong pose as well as the right one. Brute force knows no prediction: it
// finds the same pose or a better one, or agrees with the one that was tracked, or there is none.
PoseRecovery::Verdict PoseRecovery::Question(bool has_pose) {
  questioned_ = search_.estimate();
  if (Recover(false) && (!has_pose || search_.estimate().matches.size() > questioned_.matches.size())) {
    return has_pose && IsQuestionedPoseConfirmed() ? Verdict::kBetter : Verdict::kRecovered;
  }
  if (!has_pose) return Verdict::kNone;
  search_.estimate() = questioned_;
  const double min_share = kPredictedShare * parts_.config.place.relocalisation.min_match_share;
  return parts_.lane.has_pending() || BruteForceAgrees(min_share) ? Verdict::kStands : Verdict::kNone;
}

// Two poses are one when most of what agreed with the first agrees with the second.
bool PoseRecovery::IsQuestionedPoseConfirmed() {
  std::fill_n(is_matched_point_.begin(), search_.local_map().num_points, std::uint8_t{0});
  for (const PointMatch& match : search_.estimate().matches) is_matched_point_[match.point_idx] = 1;
  const auto num = std::count_if(questioned_.matches.begin(), questioned_.matches.end(),
                                 [&](const PointMatch& match) { return is_matched_point_[match.point_idx] != 0; });
  return 2 * num > static_cast<std::ptrdiff_t>(questioned_.matches.size());
}

// Of what looks alike `min_share` has to lie where the pose says. Where walls are only alike, little does.
bool PoseRecovery::BruteForceAgrees(double min_share) const {
  const auto num = std::count_if(alike_.begin(), alike_.end(), [&](const PointMatch& match) {
    return search_.AgreesWith(search_.estimate().cam_from_map, match);
  });
  return static_cast<double>(num) >= min_share * static_cast<double>(alike_.size());
}

// The gates of relocalisation: what agrees covers the picture and holds all six degrees of freedom.
SearchOutcome PoseRecovery::JudgeChosenPose() {
  const RelocalisationConfig& gates = parts_.config.place.relocalisation;
  if (!BruteForceAgrees(gates.min_match_share)) return SearchOutcome::kLowMatchShare;
  pixels_.clear();
  for (const PointMatch& match : search_.estimate().matches) {
    pixels_.push_back(parts_.frame.features.pixel(match.feature_idx));
  }
  if (parts_.scene.Spread(pixels_) < gates.min_spread) return SearchOutcome::kLowSpread;
  search_.CountMatches();
  if (!search_.HasEstablishedWitnesses()) return SearchOutcome::kFewEstablished;
  const PoseUncertainty uncertainty = UncertaintyOf(search_.estimate().information, search_.estimate().median_depth);
  const bool is_certain = uncertainty.position_sigma <= gates.max_position_sigma &&
                          uncertainty.rotation_sigma_deg <= gates.max_rotation_sigma_deg;
  return is_certain ? SearchOutcome::kFound : SearchOutcome::kUncertain;
}

}  // namespace haustra
