#include "engine/tracking/tracking_link.h"

namespace haustra {
namespace {

// A keyframe or a frame without a place, and a new map.
constexpr std::size_t kProposalsPerFrame = 2;

}  // namespace

TrackingLink::TrackingLink(const EngineConfig& config, std::pmr::memory_resource* memory)
    : proposals(static_cast<std::size_t>(config.memory.max_proposals), memory, config.features.max,
                config.initialisation.kept_views, memory),
      snapshots(memory, config.memory.max_local_points, memory),
      replies(MaxReplies(config), memory),
      answers(kKeptAnswers, memory) {}

void TrackingLink::Answer(AnsweredFrame frame) {
  frame.number = num_answered.load(std::memory_order_relaxed) + 1;
  answers.TryPush(frame);
  num_answered.store(frame.number, std::memory_order_release);
}

std::size_t TrackingLink::MaxReplies(const EngineConfig& config) {
  // A frame that looks proposes afterwards; those that do not look propose nothing.
  const std::size_t num_proposals = static_cast<std::size_t>(config.memory.max_proposals) + kProposalsPerFrame;
  // Every keyframe may show a known place, and so may the one that is asked about and the one that waits for that.
  const std::size_t num_joins = num_proposals + 2;
  // The map is moved, and the seam is placed.
  constexpr std::size_t kMovesPerJoin = 2;
  // After every join the map settles; an earlier one may still be at it.
  const std::size_t num_slices = (num_joins + 1) * static_cast<std::size_t>(config.merging.settling_rounds);
  // What was told already, but whose snapshot was not yet published at the last look.
  constexpr std::size_t kUnread = 1;
  return num_proposals + kMovesPerJoin * num_joins + num_slices + kUnread;
}

MemoryPlan TrackingLink::PlanMemory(const EngineConfig& config) {
  const auto ring = static_cast<std::size_t>(config.memory.max_proposals);
  const int max_features = config.features.max;
  const int max_between = config.initialisation.kept_views;
  MemoryPlan plan;
  plan.Add(MemoryPlace::kHostArena, "proposals", ring,
           decltype(proposals)::BytesFor(ring) +
               decltype(proposals)::NumSlots(ring) * KeyframeProposal::BytesFor(max_features, max_between),
           "memory.max_proposals x features.max x initialisation.kept_views");
  plan.Add(MemoryPlace::kHostArena, "snapshots", decltype(snapshots)::kNumSlots,
           decltype(snapshots)::BytesFor() +
               decltype(snapshots)::kNumSlots * LocalMap::BytesFor(config.memory.max_local_points),
           "memory.max_local_points");
  plan.Add(MemoryPlace::kHostArena, "replies to tracking", MaxReplies(config),
           decltype(replies)::BytesFor(MaxReplies(config)), "memory.max_proposals, merging.settling_rounds");
  plan.Add(MemoryPlace::kHostArena, "answered frames", kKeptAnswers, decltype(answers)::BytesFor(kKeptAnswers),
           "fixed");
  return plan;
}

}  // namespace haustra
