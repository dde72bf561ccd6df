#include "engine/place/exhaustive_retrieval.h"

#include <algorithm>

#include "engine/place/strongest_features.h"

namespace haustra {

ExhaustiveRetrieval::ExhaustiveRetrieval(const EngineConfig& config, const RetrievalConfig& retrieval,
                                         VisionDevice& device)
    : config_(config), retrieval_(retrieval), device_(device), slots_(kBatch) {
  entries_.reserve(static_cast<std::size_t>(config.memory.max_keyframes));
  for (Slot& slot : slots_) slot.matches.resize(static_cast<std::size_t>(retrieval.max_descriptors));
}

std::size_t ExhaustiveRetrieval::BytesFor(const EngineConfig& config) {
  const auto num_keyframes = static_cast<std::size_t>(config.memory.max_keyframes);
  const auto num_descriptors = static_cast<std::size_t>(config.place.retrieval.max_descriptors);
  return num_keyframes * (sizeof(Entry) + sizeof(std::size_t) + num_descriptors * sizeof(std::int32_t)) +
         kBatch * (sizeof(Slot) + num_descriptors * sizeof(Match));
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
  for (std::size_t i = 0; i < chosen_.size(); i += kBatch) {
    const std::size_t count = std::min<std::size_t>(kBatch, chosen_.size() - i);
    const Status status = Vote(atlas, query, std::span(chosen_).subspan(i, count), out);
    if (!status.ok()) {
      out->clear();
      return status;
    }
  }
  std::sort(out->begin(), out->end(), [&](const RetrievalCandidate& a, const RetrievalCandidate& b) {
    if (a.num_votes != b.num_votes) return a.num_votes > b.num_votes;
    return atlas.keyframe(a.keyframe).id < atlas.keyframe(b.keyframe).id;
  });
  if (out->size() > static_cast<std::size_t>(query.max_results)) {
    out->resize(static_cast<std::size_t>(query.max_results));
  }
  return Status::Ok();
}

Status ExhaustiveRetrieval::Vote(const Atlas& atlas, const RetrievalQuery& query, std::span<const std::size_t> entries,
                                 std::vector<RetrievalCandidate>* out) {
  const std::size_t num_query = std::min(query.strongest.size(), static_cast<std::size_t>(retrieval_.max_descriptors));
  std::size_t num_queued = 0;
  Status status;
  for (const std::size_t entry_idx : entries) {
    Entry& entry = entries_[entry_idx];
    const Keyframe& keyframe = atlas.keyframe(entry.keyframe);
    if (entry.num_points != keyframe.num_points) {
      SelectStrongestWithPoint(keyframe, retrieval_.max_descriptors, &entry.strongest);
      entry.num_points = keyframe.num_points;
    }
    Slot& slot = slots_[num_queued];
    slot.entry_idx = entry_idx;
    slot.num_matches = 0;
    MatchRequest request;
    request.query = DescriptorList::Subset(query.set, query.strongest.first(num_query));
    request.train = DescriptorList::Subset(keyframe.features.set, entry.strongest);
    request.options = {static_cast<float>(config_.matching.min_similarity),
                       static_cast<float>(retrieval_.max_angle_ratio), true};
    request.matches = slot.matches;
    request.num_matches = &slot.num_matches;
    const Result<Ticket> ticket = device_.EnqueueMatch(Lane::kBackground, request);
    if (!ticket.ok()) {
      status = ticket.status();
      break;
    }
    slot.ticket = *ticket;
    ++num_queued;
  }
  // What was queued is waited for even after an error: the buffers are ours.
  for (std::size_t i = 0; i < num_queued; ++i) {
    const Slot& slot = slots_[i];
    if (const Status waited = device_.Wait(slot.ticket, kNoDeadline); !waited.ok()) {
      if (status.ok()) status = waited;
      continue;
    }
    if (slot.num_matches < retrieval_.min_votes) continue;
    const Entry& entry = entries_[slot.entry_idx];
    const double longest = static_cast<double>(std::max(num_query, entry.strongest.size()));
    out->push_back({entry.keyframe, slot.num_matches / longest, slot.num_matches});
  }
  return status;
}

}  // namespace haustra
