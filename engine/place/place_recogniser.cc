#include "engine/place/place_recogniser.h"

#include <algorithm>

#include "engine/place/strongest_features.h"

namespace haustra {
namespace {

constexpr std::uint64_t kRecogniserStream = 11;
// Retrieved for one keyframe; most are neighbours of each other.
constexpr int kMaxRetrieved = 20;

}  // namespace

PlaceRecogniser::PlaceRecogniser(const EngineConfig& config, const PlaceConfig& place, const CameraModel& camera,
                                 VisionDevice& device, KeyframeRetrieval& retrieval)
    : config_(config),
      place_(place),
      retrieval_(retrieval),
      verifier_(config, place.common_area, camera, device),
      rng_(config.seed, kRecogniserStream),
      is_connected_(static_cast<std::size_t>(config.memory.max_keyframes), 0) {}

// The keyframe, all that share points with it, and their neighbours: no news can come from there.
void PlaceRecogniser::MarkConnected(const Atlas& atlas, KeyframeHandle keyframe) {
  for (const KeyframeHandle handle : connected_) is_connected_[handle.index] = 0;
  connected_.assign(1, keyframe);
  is_connected_[keyframe.index] = 1;
  std::size_t ring_begin = 0;
  for (int ring = 0; ring < 2; ++ring) {
    const std::size_t ring_end = connected_.size();
    const int min_shared = ring == 0 ? 1 : config_.mapping.min_shared_points;
    for (std::size_t i = ring_begin; i < ring_end; ++i) {
      atlas.FindCovisible(connected_[i], min_shared, &covisible_);
      for (const Covisible& neighbour : covisible_) {
        if (is_connected_[neighbour.keyframe.index] != 0) continue;
        is_connected_[neighbour.keyframe.index] = 1;
        connected_.push_back(neighbour.keyframe);
      }
    }
    ring_begin = ring_end;
  }
}

bool PlaceRecogniser::IsOnePlace(const Atlas& atlas, KeyframeHandle a, KeyframeHandle b) {
  if (a == b) return true;
  atlas.FindCovisible(a, 1, &covisible_);
  return std::any_of(covisible_.begin(), covisible_.end(), [&](const Covisible& c) { return c.keyframe == b; });
}

bool PlaceRecogniser::Recognise(const Atlas& atlas, KeyframeHandle keyframe, CommonArea* area, PlaceReport* report) {
  report->num_candidates = 0;
  report->tried.clear();
  MarkConnected(atlas, keyframe);
  const Keyframe& query_keyframe = atlas.keyframe(keyframe);
  SelectStrongestWithPoint(query_keyframe, place_.retrieval.max_descriptors, &strongest_);
  RetrievalQuery query;
  query.set = query_keyframe.features.set;
  query.strongest = strongest_;
  query.max_results = kMaxRetrieved;
  query.is_excluded = [this](KeyframeHandle handle, const Keyframe&) { return is_connected_[handle.index] != 0; };
  if (!retrieval_.Query(atlas, query, &candidates_).ok()) {
    CommonAreaCounts failed;
    failed.verdict = CommonAreaVerdict::kDeviceFailed;
    failed.keyframe_a = query_keyframe.id;
    failed.map_a = atlas.map(query_keyframe.map).id;
    report->tried.push_back(failed);
    return false;
  }
  report->num_candidates = static_cast<int>(candidates_.size());
  is_tried_.assign(candidates_.size(), 0);
  int num_verified = 0;
  // Set when a piece of the keyframe's own map agrees in all but what drift can explain: the wall itself repeats.
  bool wall_repeats = false;
  for (std::size_t i = 0; i < candidates_.size() && num_verified < place_.recognition.max_candidates; ++i) {
    is_tried_[i] = 1;
    ++num_verified;
    const bool is_accepted = verifier_.Verify(atlas, keyframe, candidates_[i].keyframe, rng_, area);
    area->counts.num_votes = candidates_[i].num_votes;
    report->tried.push_back(area->counts);
    wall_repeats = wall_repeats || area->counts.verdict == CommonAreaVerdict::kImplausibleDrift;
    if (!is_accepted) continue;
    if (wall_repeats || HasRival(atlas, *area, i, report)) {
      area->counts.verdict = CommonAreaVerdict::kAmbiguous;
      report->tried.push_back(area->counts);
      return false;
    }
    return true;
  }
  return false;
}

bool PlaceRecogniser::HasRival(const Atlas& atlas, const CommonArea& accepted, std::size_t accepted_idx,
                               PlaceReport* report) {
  const int min_votes = static_cast<int>(place_.recognition.rival_share * candidates_[accepted_idx].num_votes);
  const Keyframe& a = atlas.keyframe(accepted.keyframe_a);
  const Keyframe& b = atlas.keyframe(accepted.keyframe_b);
  const Eigen::Vector3d centre = a.cam_from_map.InverseTranslation();
  int num_heard = 0;
  for (std::size_t i = 0; i < candidates_.size() && num_heard < place_.recognition.max_candidates; ++i) {
    const KeyframeHandle handle = candidates_[i].keyframe;
    if (is_tried_[i] != 0 || candidates_[i].num_votes < min_votes) continue;
    const Keyframe& keyframe = atlas.keyframe(handle);
    if ((keyframe.map != b.map && keyframe.map != a.map) || IsOnePlace(atlas, accepted.keyframe_b, handle)) continue;
    is_tried_[i] = 1;
    ++num_heard;
    const bool is_accepted = verifier_.Verify(atlas, accepted.keyframe_a, handle, rng_, &rival_);
    rival_.counts.num_votes = candidates_[i].num_votes;
    report->tried.push_back(rival_.counts);
    if (rival_.counts.verdict == CommonAreaVerdict::kImplausibleDrift) return true;
    if (!is_accepted || keyframe.map != b.map) continue;
    const double apart = (accepted.b_from_a * centre - rival_.b_from_a * centre).norm();
    if (apart > place_.recognition.rival_agreement * accepted.median_depth_in_b) return true;
  }
  return false;
}

}  // namespace haustra
