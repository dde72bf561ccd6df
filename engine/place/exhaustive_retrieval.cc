#include "engine/place/exhaustive_retrieval.h"

#include <algorithm>

#include "engine/place/strongest_features.h"

namespace haustra {

ExhaustiveRetrieval::ExhaustiveRetrieval(const EngineConfig& config, const RetrievalConfig& retrieval,
                                         VisionDevice& device)
    : config_(config),
      retrieval_(retrieval),
      vote_(config, retrieval, device),
      votes_(config, retrieval, std::pmr::get_default_resource()) {
  entries_.reserve(static_cast<std::size_t>(config.memory.max_keyframes));
}

std::size_t ExhaustiveRetrieval::BytesFor(const EngineConfig& config) {
  const RetrievalConfig& retrieval = config.place.retrieval;
  const auto num_keyframes = static_cast<std::size_t>(config.memory.max_keyframes);
  const auto num_descriptors = static_cast<std::size_t>(retrieval.max_descriptors);
  return num_keyframes * (sizeof(Entry) + sizeof(std::size_t) + num_descriptors * sizeof(std::int32_t)) +
         VoteList::BytesFor(config, retrieval) + DescriptorVote::BytesFor(retrieval);
}

Status ExhaustiveRetrieval::Add(const Atlas& atlas, KeyframeHandle keyframe) {
  if (atlas.GetKeyframe(keyframe) == nullptr) return InvalidArgument("retrieval: the keyframe is not in the atlas");
  if (entries_.size() >= static_cast<std::size_t>(config_.memory.max_keyframes)) {
    return CapacityExceeded("retrieval: " + std::to_string(entries_.size()) + " keyframes are all there is room for");
  }
  entries_.push_back({keyframe, {}, -1});
  return Status::Ok();
}

void ExhaustiveRetrieval::Remove(KeyframeHandle keyframe) {
  std::erase_if(entries_, [&](const Entry& entry) { return entry.keyframe == keyframe; });
}

Status ExhaustiveRetrieval::Query(const Atlas& atlas, const RetrievalQuery& query,
                                  std::vector<RetrievalCandidate>* out) {
  HAUSTRA_TRY(Prepare(atlas, query, &votes_, out));
  return vote_.Count(votes_, out);
}

Status ExhaustiveRetrieval::Prepare(const Atlas& atlas, const RetrievalQuery& query, VoteList* votes,
                                    std::vector<RetrievalCandidate>* out) {
  out->clear();
  // Entries stand in order of insertion, which is the order of the ids.
  chosen_.clear();
  std::size_t first = 0;
  for (std::size_t i = 0; i < entries_.size(); ++i) {
    const Keyframe* keyframe = atlas.GetKeyframe(entries_[i].keyframe);
    if (keyframe == nullptr || (query.is_excluded && query.is_excluded(entries_[i].keyframe, *keyframe))) continue;
    if (keyframe->id < next_id_) ++first;
    chosen_.push_back(i);
  }
  const std::size_t limit = static_cast<std::size_t>(retrieval_.max_keyframes_per_query);
  if (chosen_.size() > limit) {
    std::rotate(chosen_.begin(), chosen_.begin() + static_cast<std::ptrdiff_t>(first % chosen_.size()), chosen_.end());
    next_id_ = atlas.keyframe(entries_[chosen_[limit]].keyframe).id;
    chosen_.resize(limit);
  }
  votes->Clear();
  votes->query_set = query.set;
  votes->max_results = query.max_results;
  const std::size_t num_voters = std::min(query.strongest.size(), static_cast<std::size_t>(retrieval_.max_descriptors));
  votes->query.assign(query.strongest.begin(), query.strongest.begin() + static_cast<std::ptrdiff_t>(num_voters));
  for (const std::size_t entry_idx : chosen_) {
    Entry& entry = entries_[entry_idx];
    const Keyframe& keyframe = atlas.keyframe(entry.keyframe);
    if (entry.num_points != keyframe.num_points) {
      SelectStrongestWithPoint(keyframe, retrieval_.max_descriptors, &entry.strongest);
      entry.num_points = keyframe.num_points;
    }
    votes->entries.push_back({entry.keyframe, keyframe.id, keyframe.features.set,
                              static_cast<std::uint32_t>(votes->features.size()),
                              static_cast<std::uint32_t>(entry.strongest.size())});
    votes->features.insert(votes->features.end(), entry.strongest.begin(), entry.strongest.end());
  }
  return Status::Ok();
}

}  // namespace haustra
