#include "engine/place/exhaustive_retrieval.h"

#include <algorithm>

#include "engine/place/strongest_features.h"

namespace haustra {

ExhaustiveRetrieval::ExhaustiveRetrieval(const EngineConfig& config, const RetrievalConfig& retrieval,
                                         VisionDevice& device)
    : retrieval_(retrieval),
      max_voters_(VoteList::MaxVoters(config, retrieval)),
      vote_(config, retrieval, device),
      votes_(config, retrieval, std::pmr::get_default_resource()),
      index_(config.memory.max_keyframes, static_cast<int>(max_voters_)),
      slots_(config.memory.max_keyframes),
      voters_of_slot_(slots_.size()),
      voters_(slots_.size() * max_voters_),
      descriptors_(device),
      is_eligible_(slots_.size()),
      scores_(slots_.size()) {
  strongest_.reserve(static_cast<std::size_t>(device.plan().max_features));
  chosen_.reserve(slots_.size());
}

std::size_t ExhaustiveRetrieval::BytesFor(const EngineConfig& config) {
  const RetrievalConfig& retrieval = config.place.retrieval;
  const auto num_keyframes = static_cast<std::size_t>(config.memory.max_keyframes);
  const auto num_features = static_cast<std::size_t>(config.features.max);
  const std::size_t max_voters = VoteList::MaxVoters(config, retrieval);
  return KeyframeSlots::BytesFor(config.memory.max_keyframes) + ViewDescriptors::BytesFor(config.features.max) +
         num_keyframes * (sizeof(Voters) + sizeof(std::uint8_t) + sizeof(std::uint64_t) + sizeof(Ranked) +
                          max_voters * sizeof(std::int32_t)) +
         num_features * sizeof(std::int32_t) +
         HammingIndex::BytesFor(config.memory.max_keyframes, static_cast<int>(max_voters)) +
         VoteList::BytesFor(config, retrieval) + DescriptorVote::BytesFor(retrieval);
}

Status ExhaustiveRetrieval::Add(const Atlas& atlas, KeyframeHandle handle) {
  const Keyframe* keyframe = atlas.GetKeyframe(handle);
  if (keyframe == nullptr) return InvalidArgument("retrieval: the keyframe is not in the atlas");
  HAUSTRA_ASSIGN(const std::uint32_t slot, slots_.FindFree());
  // Of a new keyframe few features have a map point yet, and which of them will is told by the keyframes to come; to
  // index it anew with every point costs more than what the strongest miss.
  SelectStrongest(keyframe->features, static_cast<int>(max_voters_), &strongest_);
  HAUSTRA_TRY(descriptors_.Read(keyframe->features.set, strongest_));
  slots_.Take(slot, handle);
  voters_of_slot_[slot] = {};
  index_.Add(slot, descriptors_.all(), strongest_);
  return Status::Ok();
}

void ExhaustiveRetrieval::Remove(KeyframeHandle handle) {
  if (const auto slot = slots_.Release(handle)) index_.Remove(*slot);
}

Status ExhaustiveRetrieval::Query(const Atlas& atlas, const RetrievalQuery& query,
                                  std::vector<RetrievalCandidate>* out) {
  HAUSTRA_TRY(Prepare(atlas, query, &votes_, out));
  return vote_.Count(votes_, out);
}

Status ExhaustiveRetrieval::Choose(const Atlas& atlas, const RetrievalQuery& query) {
  chosen_.clear();
  for (std::size_t i = 0; i < slots_.size(); ++i) {
    const Keyframe* keyframe = atlas.GetKeyframe(slots_[i]);
    is_eligible_[i] = keyframe != nullptr && !(query.is_excluded && query.is_excluded(slots_[i], *keyframe)) ? 1 : 0;
    if (is_eligible_[i] != 0) chosen_.push_back({0, keyframe->id, static_cast<std::uint32_t>(i)});
  }
  const auto limit = static_cast<std::size_t>(retrieval_.max_keyframes_per_query);
  if (chosen_.size() <= limit) return Status::Ok();
  HAUSTRA_TRY(descriptors_.Read(query.set, query.strongest));
  index_.Score(descriptors_.all(), query.strongest, is_eligible_, scores_);
  for (Ranked& ranked : chosen_) ranked.score = scores_[ranked.slot];
  std::partial_sort(
      chosen_.begin(), chosen_.begin() + static_cast<std::ptrdiff_t>(limit), chosen_.end(),
      [](const Ranked& a, const Ranked& b) { return a.score != b.score ? a.score > b.score : a.id < b.id; });
  chosen_.resize(limit);
  return Status::Ok();
}

std::span<const std::int32_t> ExhaustiveRetrieval::VotersOf(std::uint32_t slot, const Keyframe& keyframe) {
  Voters& chosen = voters_of_slot_[slot];
  std::int32_t* voters = &voters_[slot * max_voters_];
  if (chosen.num_point_changes != keyframe.num_point_changes) {
    SelectStrongestWithPoint(keyframe, static_cast<int>(max_voters_), &strongest_);
    std::copy(strongest_.begin(), strongest_.end(), voters);
    chosen = {keyframe.num_point_changes, static_cast<std::uint32_t>(strongest_.size())};
  }
  return {voters, chosen.num};
}

Status ExhaustiveRetrieval::Prepare(const Atlas& atlas, const RetrievalQuery& query, VoteList* votes,
                                    std::vector<RetrievalCandidate>* out) {
  out->clear();
  votes->Clear();
  HAUSTRA_TRY(Choose(atlas, query));
  votes->query_set = query.set;
  votes->max_results = query.max_results;
  const std::span<const std::int32_t> voters = query.strongest.first(std::min(query.strongest.size(), max_voters_));
  votes->query.assign(voters.begin(), voters.end());
  for (const Ranked& ranked : chosen_) {
    const KeyframeHandle handle = slots_[ranked.slot];
    const Keyframe& keyframe = atlas.keyframe(handle);
    const std::span<const std::int32_t> strongest = VotersOf(ranked.slot, keyframe);
    votes->entries.push_back({handle, keyframe.id, keyframe.features.set,
                              static_cast<std::uint32_t>(votes->features.size()),
                              static_cast<std::uint32_t>(strongest.size())});
    votes->features.insert(votes->features.end(), strongest.begin(), strongest.end());
  }
  return Status::Ok();
}

}  // namespace haustra
