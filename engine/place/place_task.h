// One question of the mapper to the recogniser, with all that is needed to answer it, and the answer. It is put in two
// stages: which keyframes look like this new one? And when the mapper has added copies of the best of these: does it
// show what one of them shows? Fixed capacity, taken at construction; filled in place.
#pragma once

#include <algorithm>
#include <cstdint>
#include <memory_resource>
#include <vector>

#include "engine/noise_model.h"
#include "engine/place/common_area.h"
#include "engine/place/descriptor_vote.h"
#include "engine/place/place_excerpt.h"
#include "hal/core/fixed_vector.h"
#include "hal/core/time.h"

namespace haustra {

// Retrieved for one keyframe; most are neighbours of each other.
inline constexpr int kMaxRetrieved = 20;

struct PlaceCandidate {
  PlaceCandidate(const EngineConfig& config, std::pmr::memory_resource* memory)
      : group(GroupExcerpt::ForCandidate(config), memory) {}

  GroupExcerpt group;
  int num_votes = 0;
  // Should this one be accepted: candidates (positions in the task) that must be heard before, most votes first.
  FixedVector<int, kMaxRetrieved> rivals;
};

struct PlaceReport {
  int num_candidates = 0;               // that retrieval proposed
  std::vector<CommonAreaCounts> tried;  // every verification, in order, with its reason
};

struct PlaceTask {
  PlaceTask(const EngineConfig& config, std::pmr::memory_resource* memory)
      : votes(config, config.place.retrieval, memory),
        query(GroupExcerpt::ForQuery(config), memory),
        candidates(memory) {
    retrieved.reserve(static_cast<std::size_t>(config.memory.max_keyframes));
    candidates.reserve(static_cast<std::size_t>(MaxCandidates(config)));
    for (int i = 0; i < MaxCandidates(config); ++i) candidates.emplace_back(config, memory);
    report.tried.reserve(static_cast<std::size_t>(2 * config.place.recognition.max_candidates + 1));
  }
  // Those that are verified, and the rivals of each of them: never more.
  static int MaxCandidates(const EngineConfig& config) {
    const int num = config.place.recognition.max_candidates;
    return std::min(kMaxRetrieved, num + num * num);
  }
  static std::size_t BytesFor(const EngineConfig& config) {
    const auto num = static_cast<std::size_t>(MaxCandidates(config));
    return VoteList::BytesFor(config, config.place.retrieval) + GroupExcerpt::BytesFor(GroupExcerpt::ForQuery(config)) +
           MemoryArena::BytesFor<PlaceCandidate>(num) +
           num * GroupExcerpt::BytesFor(GroupExcerpt::ForCandidate(config));
  }

  enum class Stage : std::uint8_t { kRetrieve, kVerify };

  Stage stage = Stage::kRetrieve;
  KeyframeHandle keyframe;  // the new one
  std::uint32_t frame_index = 0;
  TimePoint timestamp;
  NoiseModel noise;       // when the question was put
  bool is_known = false;  // in the end: `area` is accepted and says where
  CommonArea area;
  PlaceReport report;
  Duration mapping_duration{0};  // what it took, on either side
  Duration merging_duration{0};

  // kRetrieve: who votes; the answer, best first.
  VoteList votes;
  std::vector<RetrievalCandidate> retrieved;
  bool has_failed = false;  // the device did not answer

  // kVerify. The answer is `area`.
  GroupExcerpt query;
  std::pmr::vector<PlaceCandidate> candidates;  // [0, num_candidates)
  int num_candidates = 0;
  int num_verified = 0;  // the first so many, most votes first; the others are rivals only
};

}  // namespace haustra
