// Two views of one scene in one picture, as stereo scopes and comparisons are recorded: beside each other, or one above
// the other. To an engine with one camera they are one scene that does not exist. reentrant.
#pragma once

#include "hal/core/views.h"

namespace haustra {

enum class Halves { kLeftAndRight, kTopAndBottom };

// Sums over pictures. Blocks of the first half that show texture in both directions are searched in the second half
// where another view has them: in the same rows, a little to the left or right.
struct HalvesMatch {
  int num_blocks = 0;  // that were searched
  int num_found = 0;   // that are there
  int num_chance = 0;  // that are found as well a third of the height away, where no view has them

  HalvesMatch& operator+=(const HalvesMatch& other);
};

// kMinTwoViewsBlocks were searched, and kMinTwoViewsShare of them found beyond what chance finds.
bool AreTwoViews(const HalvesMatch& match);

// Ordinary pictures of living tissue have up to 0.04, a page of many pictures 0.07. A view beside its rendering has
// 0.45, neighbouring frames of moving scopes beside each other 0.37 to 0.84.
inline constexpr double kMinTwoViewsShare = 0.3;
// Fewer are chance: three squeezed pictures have as many.
inline constexpr int kMinTwoViewsBlocks = 40;

// All formats. Some 10 to 100 ms a picture on one core; allocates.
HalvesMatch MatchHalves(ImageView image, Halves halves);

}  // namespace haustra
