#include "engine/mapping/local_bundle.h"

#include <algorithm>

namespace haustra {
namespace {

// 99 % of two degrees of freedom. What fails is deleted from the map: one true observation in a hundred, and not one in
// twenty. On living walls the others hold maps together (decisions/2026-11-30-a-gate-of-99-percent.md).
constexpr double kChi2Gate = 9.210;

}  // namespace

LocalBundle::LocalBundle(const EngineConfig& config, const NoiseModel& noise, const CameraModel& camera,
                         SchurBundleAdjuster& adjuster)
    : config_(config), window_(config.memory, noise, camera, adjuster) {}

Result<BundleSummary> LocalBundle::Adjust(KeyframeHandle centre, const Extent& extent, const Limits& limits,
                                          Atlas* atlas) {
  ChooseWindow(centre, extent, *atlas);
  window_.Close(*atlas, config_.mapping.fixed_keyframes, {});
  if (window_.num_fixed() == 0) {
    const auto moving = window_.moving();
    const auto oldest = std::min_element(moving.begin(), moving.end(), [&](KeyframeHandle a, KeyframeHandle b) {
      return atlas->keyframe(a).id < atlas->keyframe(b).id;
    });
    window_.Fix(static_cast<std::size_t>(oldest - moving.begin()));
  }
  BundleOptions options;
  options.max_iterations = extent.max_iterations;
  options.chi2_gate = kChi2Gate;
  options.clock = limits.clock;
  options.deadline = limits.deadline;
  options.should_stop = limits.should_stop;
  return window_.Adjust(options, atlas);
}

void LocalBundle::ChooseWindow(KeyframeHandle centre, const Extent& extent, const Atlas& atlas) {
  window_.Clear();
  window_.Add(centre);
  // Breadth first: the window is the queue, too.
  const auto max_keyframes = static_cast<std::size_t>(extent.max_keyframes);
  for (std::size_t i = 0; i < window_.moving().size() && window_.moving().size() < max_keyframes; ++i) {
    if (extent.is_direct && i > 0) break;
    atlas.FindCovisible(window_.moving()[i], config_.mapping.min_shared_points, &covisible_);
    for (const Covisible& covisible : covisible_) {
      if (window_.moving().size() == max_keyframes) break;
      window_.Add(covisible.keyframe);
    }
  }
}

}  // namespace haustra
