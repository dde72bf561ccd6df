#include "engine/place/place_scout.h"

#include <algorithm>

#include "engine/place/strongest_features.h"

namespace haustra {

PlaceScout::PlaceScout(const EngineConfig& config, KeyframeRetrieval& retrieval)
    : config_(config),
      retrieval_(retrieval),
      copier_(config),
      is_connected_(static_cast<std::size_t>(config.memory.max_keyframes), 0) {}

// The keyframe, all that share points with it, and their neighbours: no news can come from there.
void PlaceScout::MarkConnected(const Atlas& atlas, KeyframeHandle keyframe) {
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

bool PlaceScout::Look(const Atlas& atlas, KeyframeHandle keyframe, PlaceTask* task) {
  const Keyframe& query_keyframe = atlas.keyframe(keyframe);
  task->frame_index = query_keyframe.frame_index;
  task->timestamp = query_keyframe.timestamp;
  task->num_candidates = 0;
  task->num_verified = 0;
  task->is_known = false;
  task->verification_duration = Duration{0};
  task->report.num_candidates = 0;
  task->report.tried.clear();
  MarkConnected(atlas, keyframe);
  SelectStrongestWithPoint(query_keyframe, config_.place.retrieval.max_descriptors, &strongest_);
  RetrievalQuery query;
  query.set = query_keyframe.features.set;
  query.strongest = strongest_;
  query.max_results = kMaxRetrieved;
  query.is_excluded = [this](KeyframeHandle handle, const Keyframe&) { return is_connected_[handle.index] != 0; };
  if (!retrieval_.Query(atlas, query, &retrieved_).ok()) {
    CommonAreaCounts failed;
    failed.verdict = CommonAreaVerdict::kDeviceFailed;
    failed.keyframe_a = query_keyframe.id;
    failed.map_a = atlas.map(query_keyframe.map).id;
    task->report.tried.push_back(failed);
    return false;
  }
  task->report.num_candidates = static_cast<int>(retrieved_.size());
  if (retrieved_.empty()) return false;

  copier_.CopyQuery(atlas, keyframe, &task->query);
  candidate_of_.assign(retrieved_.size(), -1);
  const std::size_t num_verified =
      std::min(retrieved_.size(), static_cast<std::size_t>(config_.place.recognition.max_candidates));
  for (std::size_t i = 0; i < num_verified; ++i) candidate_of_[i] = Copy(atlas, i, task);
  task->num_verified = task->num_candidates;
  for (std::size_t i = 0; i < num_verified; ++i) NameRivals(atlas, i, task);
  return true;
}

int PlaceScout::Copy(const Atlas& atlas, std::size_t retrieved_idx, PlaceTask* task) {
  PlaceCandidate& candidate = task->candidates[static_cast<std::size_t>(task->num_candidates)];
  copier_.CopyCandidate(atlas, retrieved_[retrieved_idx].keyframe, task->query.keyframe, &candidate.group);
  candidate.num_votes = retrieved_[retrieved_idx].num_votes;
  candidate.rivals.Clear();
  return task->num_candidates++;
}

// Those before it were turned down when it is accepted.
void PlaceScout::NameRivals(const Atlas& atlas, std::size_t retrieved_idx, PlaceTask* task) {
  const RetrievalCandidate& accepted = retrieved_[retrieved_idx];
  const int min_votes = static_cast<int>(config_.place.recognition.rival_share * accepted.num_votes);
  const MapHandle map_a = atlas.keyframe(task->query.keyframe).map;
  const MapHandle map_b = atlas.keyframe(accepted.keyframe).map;
  const auto max_rivals = static_cast<std::size_t>(config_.place.recognition.max_candidates);
  auto& rivals = task->candidates[retrieved_idx].rivals;
  atlas.FindCovisible(accepted.keyframe, 1, &covisible_);
  for (std::size_t i = retrieved_idx + 1; i < retrieved_.size() && rivals.size() < max_rivals; ++i) {
    if (retrieved_[i].num_votes < min_votes) continue;
    const KeyframeHandle handle = retrieved_[i].keyframe;
    const MapHandle map = atlas.keyframe(handle).map;
    const bool is_same_place = std::any_of(covisible_.begin(), covisible_.end(),
                                           [&](const Covisible& neighbour) { return neighbour.keyframe == handle; });
    if ((map != map_b && map != map_a) || is_same_place) continue;
    if (candidate_of_[i] < 0) candidate_of_[i] = Copy(atlas, i, task);
    HAUSTRA_CHECK(rivals.PushBack(candidate_of_[i]));
  }
}

}  // namespace haustra
