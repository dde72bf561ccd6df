#include "engine/place/descriptor_vote.h"

#include <algorithm>

#include "engine/place/make_retrieval.h"

namespace haustra {
namespace {

std::size_t MaxEntries(const EngineConfig& config, const RetrievalConfig& retrieval) {
  if (NeedsVocabulary(retrieval)) return 0;
  return static_cast<std::size_t>(std::min(retrieval.max_keyframes_per_query, config.memory.max_keyframes));
}

}  // namespace

std::size_t VoteList::MaxVoters(const EngineConfig& config, const RetrievalConfig& retrieval) {
  return static_cast<std::size_t>(std::min(retrieval.max_descriptors, config.features.max));
}

VoteList::VoteList(const EngineConfig& config, const RetrievalConfig& retrieval, std::pmr::memory_resource* memory)
    : query(memory), entries(memory), features(memory) {
  if (MaxEntries(config, retrieval) == 0) return;
  query.reserve(MaxVoters(config, retrieval));
  entries.reserve(MaxEntries(config, retrieval));
  features.reserve(MaxEntries(config, retrieval) * MaxVoters(config, retrieval));
}

std::size_t VoteList::BytesFor(const EngineConfig& config, const RetrievalConfig& retrieval) {
  const std::size_t num_entries = MaxEntries(config, retrieval), num_voters = MaxVoters(config, retrieval);
  if (num_entries == 0) return 0;
  return MemoryArena::BytesFor<std::int32_t>(num_voters) + MemoryArena::BytesFor<Entry>(num_entries) +
         MemoryArena::BytesFor<std::int32_t>(num_entries * num_voters);
}

DescriptorVote::DescriptorVote(const EngineConfig& config, const RetrievalConfig& retrieval, VisionDevice& device)
    : config_(config), retrieval_(retrieval), device_(device), slots_(kBatch) {
  for (Slot& slot : slots_) slot.matches.resize(static_cast<std::size_t>(retrieval.max_descriptors));
}

std::size_t DescriptorVote::BytesFor(const RetrievalConfig& retrieval) {
  return kBatch * (sizeof(Slot) + static_cast<std::size_t>(retrieval.max_descriptors) * sizeof(Match));
}

Status DescriptorVote::Count(const VoteList& list, std::vector<RetrievalCandidate>* out) {
  out->clear();
  for (std::size_t i = 0; i < list.entries.size(); i += kBatch) {
    const Status status = CountBatch(list, i, std::min<std::size_t>(i + kBatch, list.entries.size()), out);
    if (!status.ok()) {
      out->clear();
      return status;
    }
  }
  std::sort(out->begin(), out->end(), [](const RetrievalCandidate& a, const RetrievalCandidate& b) {
    return a.num_votes != b.num_votes ? a.num_votes > b.num_votes : a.id < b.id;
  });
  if (out->size() > static_cast<std::size_t>(list.max_results)) out->resize(static_cast<std::size_t>(list.max_results));
  return Status::Ok();
}

Status DescriptorVote::CountBatch(const VoteList& list, std::size_t begin, std::size_t end,
                                  std::vector<RetrievalCandidate>* out) {
  std::size_t num_queued = 0;
  Status status;
  for (std::size_t i = begin; i < end; ++i) {
    const VoteList::Entry& entry = list.entries[i];
    Slot& slot = slots_[num_queued];
    slot.entry_idx = i;
    slot.num_matches = 0;
    MatchRequest request;
    request.query = DescriptorList::Subset(list.query_set, list.query);
    request.train = DescriptorList::Subset(entry.set, std::span(list.features).subspan(entry.first, entry.num));
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
    const VoteList::Entry& entry = list.entries[slot.entry_idx];
    const double longest = static_cast<double>(std::max<std::size_t>(list.query.size(), entry.num));
    out->push_back({entry.keyframe, slot.num_matches / longest, slot.num_matches, entry.id});
  }
  return status;
}

}  // namespace haustra
