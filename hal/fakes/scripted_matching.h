// Matching as hal/vision_device.h defines it, on descriptors that are known by name: who looks like whom is decided by
// the landmark, not by an image. Plain loops; the specification in code. reentrant, rt-safe.
#pragma once

#include <cstdint>
#include <span>

#include "hal/vision_device.h"

namespace haustra {

// What a descriptor shows. Landmarks of one look-alike group (not 0) resemble each other nearly as much as themselves,
// like two folds of the same shape.
struct ScriptedAppearance {
  std::uint32_t landmark_id = 0;
  std::uint32_t look_alike_group = 0;

  friend constexpr bool operator==(const ScriptedAppearance&, const ScriptedAppearance&) = default;
};

// Cosines. With the defaults the ratio of angles is 0.93 between a landmark and its look-alike (they cannot be told
// apart) and 0.19 against anything else.
struct ScriptedSimilarity {
  float same = 0.97f;
  float look_alike = 0.965f;
  float other = 0.3f;

  float operator()(const ScriptedAppearance& a, const ScriptedAppearance& b) const {
    if (a.landmark_id == b.landmark_id) return same;
    return a.look_alike_group != 0 && a.look_alike_group == b.look_alike_group ? look_alike : other;
  }
};

// One entry of a descriptor list after its references were looked up.
struct ScriptedEntry {
  ScriptedAppearance appearance;
  Keypoint keypoint;
  std::int32_t feature_idx = -1;
  bool is_valid = false;  // false: the reference was stale; it matches nothing
};

// Accepted matches in order of query position into `matches` (as long as `query`); returns how many.
int MatchScripted(std::span<const ScriptedEntry> query, std::span<const ScriptedEntry> train,
                  const ScriptedSimilarity& similarity, const MatchOptions& options, const DisparityWindow* disparity,
                  const EpipolarGate* epipolar, std::span<Match> matches);

// `query[i]` is the descriptor of `windows[i]`. `holder`: workspace, one a train entry. Returns the number of matches.
int GuidedMatchScripted(std::span<const GuidedQuery> windows, std::span<const ScriptedEntry> query,
                        std::span<const ScriptedEntry> train, std::span<const std::uint8_t> train_allowed,
                        const ScriptedSimilarity& similarity, const MatchOptions& options,
                        std::span<std::int32_t> holder, std::span<Match> matches);

}  // namespace haustra
