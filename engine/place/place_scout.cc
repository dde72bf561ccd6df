#include "engine/place/place_scout.h"

#include <algorithm>

#include "engine/place/strongest_features.h"

namespace haustra {

PlaceScout::PlaceScout(const EngineConfig& config, KeyframeRetrieval& retrieval)
    : config_(config),
      retrieval_(retrieval),
      copier_(config),
      is_connected_(static_cast<std::size_t>(config.memory.max_keyframes), 0) {}

// The keyframe and those that covisibility ties to it: no news can come from there.
void PlaceScout::MarkConnected(const Atlas& atlas, KeyframeHandle keyframe) {
  for (const KeyframeHandle handle : connected_) is_connected_[handle.index] = 0;
  connected_.assign(1, keyframe);
  const double shared_share = config_.place.recognition.max_shared_share;
  const int min_shared = static_cast<int>(shared_share * atlas.keyframe(keyframe).num_points);
  atlas.FindCovisible(keyframe, std::max(config_.mapping.min_shared_points, min_shared), &covisible_);
  for (const Covisible& neighbour : covisible_) connected_.push_back(neighbour.keyframe);
  for (const KeyframeHandle handle : connected_) is_connected_[handle.index] = 1;
}

bool PlaceScout::Begin(const Atlas& atlas, KeyframeHandle handle, PlaceTask* task) {
  const Keyframe& keyframe = atlas.keyframe(handle);
  task->stage = PlaceTask::Stage::kRetrieve;
  task->keyframe = handle;
  task->frame_index = keyframe.frame_index;
  task->timestamp = keyframe.timestamp;
  task->is_known = false;
  task->report.num_candidates = 0;
  task->report.tried.clear();
  task->mapping_duration = task->merging_duration = Duration{0};
  task->has_failed = false;
  MarkConnected(atlas, handle);
  SelectStrongestWithPoint(keyframe, config_.place.retrieval.max_descriptors, &strongest_);
  RetrievalQuery query;
  query.set = keyframe.features.set;
  query.strongest = strongest_;
  query.max_results = kMaxRetrieved;
  query.is_excluded = [this](KeyframeHandle other, const Keyframe&) { return is_connected_[other.index] != 0; };
  if (!retrieval_.Prepare(atlas, query, &task->votes, &task->retrieved).ok()) return ReportFailure(atlas, task);
  return !task->votes.entries.empty() || CopyCandidates(atlas, task);
}

bool PlaceScout::GoOn(const Atlas& atlas, PlaceTask* task) {
  if (task->has_failed) return ReportFailure(atlas, task);
  std::erase_if(task->retrieved,
                [&](const RetrievalCandidate& candidate) { return atlas.GetKeyframe(candidate.keyframe) == nullptr; });
  return CopyCandidates(atlas, task);
}

bool PlaceScout::ReportFailure(const Atlas& atlas, PlaceTask* task) {
  const Keyframe& keyframe = atlas.keyframe(task->keyframe);
  CommonAreaCounts failed;
  failed.verdict = CommonAreaVerdict::kDeviceFailed;
  failed.keyframe_a = keyframe.id;
  failed.map_a = atlas.map(keyframe.map).id;
  task->report.tried.push_back(failed);
  return false;
}

bool PlaceScout::CopyCandidates(const Atlas& atlas, PlaceTask* task) {
  const std::size_t num_retrieved = task->retrieved.size();
  task->report.num_candidates = static_cast<int>(num_retrieved);
  if (num_retrieved == 0) return false;
  task->stage = PlaceTask::Stage::kVerify;
  task->num_candidates = 0;
  copier_.CopyQuery(atlas, task->keyframe, &task->query);
  candidate_of_.assign(num_retrieved, -1);
  const std::size_t num_verified =
      std::min(num_retrieved, static_cast<std::size_t>(config_.place.recognition.max_candidates));
  for (std::size_t i = 0; i < num_verified; ++i) candidate_of_[i] = Copy(atlas, i, task);
  task->num_verified = task->num_candidates;
  for (std::size_t i = 0; i < num_verified; ++i) NameRivals(atlas, i, task);
  return true;
}

int PlaceScout::Copy(const Atlas& atlas, std::size_t retrieved_idx, PlaceTask* task) {
  PlaceCandidate& candidate = task->candidates[static_cast<std::size_t>(task->num_candidates)];
  const RetrievalCandidate& retrieved = task->retrieved[retrieved_idx];
  copier_.CopyCandidate(atlas, retrieved.keyframe, task->keyframe, &candidate.group);
  candidate.num_votes = retrieved.num_votes;
  candidate.rivals.Clear();
  return task->num_candidates++;
}

// Those before it were turned down when it is accepted.
void PlaceScout::NameRivals(const Atlas& atlas, std::size_t retrieved_idx, PlaceTask* task) {
  const std::vector<RetrievalCandidate>& retrieved = task->retrieved;
  const RetrievalCandidate& accepted = retrieved[retrieved_idx];
  const int min_votes = static_cast<int>(config_.place.recognition.rival_share * accepted.num_votes);
  const MapHandle map_a = atlas.keyframe(task->keyframe).map;
  const MapHandle map_b = atlas.keyframe(accepted.keyframe).map;
  const auto max_rivals = static_cast<std::size_t>(config_.place.recognition.max_candidates);
  auto& rivals = task->candidates[retrieved_idx].rivals;
  atlas.FindCovisible(accepted.keyframe, 1, &covisible_);
  for (std::size_t i = retrieved_idx + 1; i < retrieved.size() && rivals.size() < max_rivals; ++i) {
    if (retrieved[i].num_votes < min_votes) continue;
    const KeyframeHandle handle = retrieved[i].keyframe;
    const MapHandle map = atlas.keyframe(handle).map;
    const bool is_same_place = std::any_of(covisible_.begin(), covisible_.end(),
                                           [&](const Covisible& neighbour) { return neighbour.keyframe == handle; });
    if ((map != map_b && map != map_a) || is_same_place) continue;
    if (candidate_of_[i] < 0) candidate_of_[i] = Copy(atlas, i, task);
    HAUSTRA_CHECK(rivals.PushBack(candidate_of_[i]));
  }
}

}  // namespace haustra
