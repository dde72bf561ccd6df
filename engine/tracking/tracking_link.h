// The only things that tracking and mapping share: proposals one way, snapshots and replies the other. All memory is
// taken at construction; both sides are wait-free.
//
// The ring of replies loses nothing. No step of the mapper tells more than one thing, and none is begun while the ring
// is full (Mapper::Step). It has room for all that the mapper can do while the tracker looks at nothing (MaxReplies),
// so the mapper waits for it only when that bound is wrong, and the tracker never waits at all.
#pragma once

#include <atomic>
#include <cstddef>
#include <cstdint>
#include <memory_resource>

#include "engine/atlas/local_map.h"
#include "engine/config.h"
#include "engine/tracking/answered_frame.h"
#include "engine/tracking/keyframe_proposal.h"
#include "engine/tracking/map_reply.h"
#include "hal/core/mailbox.h"
#include "hal/core/memory_plan.h"
#include "hal/core/spsc_ring.h"

namespace haustra {

struct TrackingLink {
  explicit TrackingLink(const EngineConfig& config,
                        std::pmr::memory_resource* memory = std::pmr::get_default_resource());
  // A line each for proposals, snapshots, replies and answered frames.
  static MemoryPlan PlanMemory(const EngineConfig& config);
  // What the mapper can have to tell between two looks of the tracker.
  static std::size_t MaxReplies(const EngineConfig& config);

  // Tracking, of every frame in turn. Full: it is left out, and no mark can be set in it.
  void Answer(AnsweredFrame frame);

  SpscRing<KeyframeProposal> proposals;  // tracking to mapping
  LatestMailbox<LocalMap> snapshots;     // mapping to tracking
  SpscRing<VersionedReply> replies;      // mapping to tracking; pushed before the snapshot of their version
  SpscRing<AnsweredFrame> answers;       // tracking to mapping; pushed by Answer alone
  // Frames that were answered. Each is in the ring when it is counted here, or was left out.
  std::atomic<std::uint64_t> num_answered{0};
  // Version of the snapshot that the tracker used in its last finished frame: what older ones alone refer to may go.
  std::atomic<std::uint64_t> version_done{0};
  // Proposals waiting or being worked on: the mapper is busy while this is not zero.
  std::atomic<int> num_pending{0};
};

}  // namespace haustra
