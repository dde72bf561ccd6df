#include "engine/place/vocabulary_retrieval.h"

#include <algorithm>

#include "engine/place/descriptor_vote.h"
#include "engine/place/strongest_features.h"

namespace haustra {

VocabularyRetrieval::VocabularyRetrieval(const EngineConfig& config, const RetrievalConfig& retrieval,
                                         VisionDevice& device, const Vocabulary& vocabulary)
    : retrieval_(retrieval),
      vocabulary_(vocabulary),
      max_words_(static_cast<std::size_t>(std::min(retrieval.max_descriptors, device.plan().max_features))),
      slots_(config.memory.max_keyframes),
      num_words_of_slot_(slots_.size()),
      entries_(slots_.size() * max_words_),
      first_of_word_(static_cast<std::size_t>(vocabulary.num_words()), kNone),
      descriptors_(device),
      common_(slots_.size()),
      num_common_(slots_.size()) {
  strongest_.reserve(static_cast<std::size_t>(device.plan().max_features));
  words_.reserve(max_words_);
  bag_.reserve(max_words_);
}

std::size_t VocabularyRetrieval::BytesFor(const EngineConfig& config) {
  const auto num_keyframes = static_cast<std::size_t>(config.memory.max_keyframes);
  const auto num_features = static_cast<std::size_t>(config.features.max);
  const auto num_words = std::min(static_cast<std::size_t>(config.place.retrieval.max_descriptors), num_features);
  return KeyframeSlots::BytesFor(config.memory.max_keyframes) + ViewDescriptors::BytesFor(config.features.max) +
         num_keyframes *
             (sizeof(std::uint32_t) + num_words * sizeof(Entry) + sizeof(std::uint32_t) + sizeof(std::int32_t)) +
         num_features * sizeof(std::int32_t) + num_words * (sizeof(std::int32_t) + sizeof(WordShare));
}

Status VocabularyRetrieval::FindWords(FeatureSetHandle set, std::span<const std::int32_t> features) {
  bag_.clear();
  words_.clear();
  const std::span<const std::int32_t> strongest = features.first(std::min(features.size(), max_words_));
  HAUSTRA_TRY(descriptors_.Read(set, strongest));
  for (const std::int32_t feature : strongest) words_.push_back(vocabulary_.WordOf(descriptors_.row(feature)));
  std::sort(words_.begin(), words_.end());
  std::uint64_t total = 0;
  for (const std::int32_t word : words_) total += vocabulary_.weight(word);
  for (std::size_t begin = 0, end = 0; begin < words_.size(); begin = end) {
    while (end < words_.size() && words_[end] == words_[begin]) ++end;
    const std::uint64_t weight = (end - begin) * std::uint64_t{vocabulary_.weight(words_[begin])};
    if (weight == 0) continue;
    bag_.push_back({words_[begin], static_cast<std::uint32_t>((weight << kShareBits) / total)});
  }
  return Status::Ok();
}

Status VocabularyRetrieval::Add(const Atlas& atlas, KeyframeHandle handle) {
  const Keyframe* keyframe = atlas.GetKeyframe(handle);
  if (keyframe == nullptr) return InvalidArgument("retrieval: the keyframe is not in the atlas");
  HAUSTRA_ASSIGN(const std::uint32_t slot, slots_.FindFree());
  SelectStrongest(keyframe->features, static_cast<int>(max_words_), &strongest_);
  HAUSTRA_TRY(FindWords(keyframe->features.set, strongest_));
  slots_.Take(slot, handle);
  num_words_of_slot_[slot] = static_cast<std::uint32_t>(bag_.size());
  auto entry_idx = static_cast<std::uint32_t>(slot * max_words_);
  for (const WordShare& word : bag_) {
    std::uint32_t& first = first_of_word_[static_cast<std::size_t>(word.word)];
    entries_[entry_idx] = {word.word, word.share, first, kNone};
    if (first != kNone) entries_[first].previous = entry_idx;
    first = entry_idx++;
  }
  return Status::Ok();
}

void VocabularyRetrieval::Remove(KeyframeHandle handle) {
  const auto slot = slots_.Release(handle);
  if (!slot) return;
  const std::size_t begin = *slot * max_words_;
  for (std::size_t i = begin; i < begin + num_words_of_slot_[*slot]; ++i) {
    const Entry& entry = entries_[i];
    if (entry.next != kNone) entries_[entry.next].previous = entry.previous;
    if (entry.previous != kNone) {
      entries_[entry.previous].next = entry.next;
    } else {
      first_of_word_[static_cast<std::size_t>(entry.word)] = entry.next;
    }
  }
}

Status VocabularyRetrieval::Query(const Atlas& atlas, const RetrievalQuery& query,
                                  std::vector<RetrievalCandidate>* out) {
  out->clear();
  HAUSTRA_TRY(FindWords(query.set, query.strongest));
  std::fill(common_.begin(), common_.end(), 0u);
  std::fill(num_common_.begin(), num_common_.end(), 0);
  for (const WordShare& word : bag_) {
    std::uint32_t i = first_of_word_[static_cast<std::size_t>(word.word)];
    for (; i != kNone; i = entries_[i].next) {
      const std::size_t slot = i / max_words_;
      common_[slot] += std::min(word.share, entries_[i].share);
      ++num_common_[slot];
    }
  }
  for (std::size_t i = 0; i < slots_.size(); ++i) {
    if (num_common_[i] == 0 || num_common_[i] < retrieval_.min_votes) continue;
    const Keyframe* keyframe = atlas.GetKeyframe(slots_[i]);
    if (keyframe == nullptr || (query.is_excluded && query.is_excluded(slots_[i], *keyframe))) continue;
    out->push_back({slots_[i], static_cast<double>(common_[i]) / (1 << kShareBits), num_common_[i], keyframe->id});
  }
  std::sort(out->begin(), out->end(), [](const RetrievalCandidate& a, const RetrievalCandidate& b) {
    return a.score != b.score ? a.score > b.score : a.id < b.id;
  });
  if (out->size() > static_cast<std::size_t>(query.max_results)) {
    out->resize(static_cast<std::size_t>(query.max_results));
  }
  return Status::Ok();
}

Status VocabularyRetrieval::Prepare(const Atlas& atlas, const RetrievalQuery& query, VoteList* votes,
                                    std::vector<RetrievalCandidate>* out) {
  votes->Clear();
  return Query(atlas, query, out);
}

}  // namespace haustra
