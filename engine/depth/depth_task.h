// The depth of one keyframe as a task: the keeper fills it, whoever has a DepthMatcher answers. Pictures are those of
// the keeper, who does not touch them while the task is out.
#pragma once

#include <memory_resource>
#include <vector>

#include "engine/atlas/handles.h"
#include "engine/surface/depth_matcher.h"
#include "hal/core/fixed_vector.h"
#include "hal/core/status.h"
#include "hal/core/task_mailbox.h"
#include "hal/core/time.h"
#include "hal/depth_solver.h"

namespace haustra {

struct DepthTask {
  DepthTask(int width, int height, int max_seeds, std::pmr::memory_resource* memory)
      : seeds(memory), depth(width, height, memory) {
    seeds.reserve(static_cast<std::size_t>(max_seeds));
  }
  static std::size_t BytesFor(int num_cells, int max_seeds) {
    return MemoryArena::BytesFor<DepthSeed>(static_cast<std::size_t>(max_seeds)) + DepthMap::BytesFor(num_cells);
  }

  KeyframeHandle keyframe;
  double scale = 1.0;           // Atlas::KeyframeScale when it was asked
  std::uint64_t turned_at = 0;  // Keyframe::turned_at likewise
  DepthView reference;
  FixedVector<DepthView, kMaxDepthSources> sources;
  std::pmr::vector<DepthSeed> seeds;

  // The answer.
  DepthMap depth;
  Status status;  // of DepthMatcher::Match
  Duration duration{0};
};

using DepthMailbox = TaskMailbox<DepthTask>;

}  // namespace haustra
