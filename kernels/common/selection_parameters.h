// What every device has in common when it chooses among too many points: how they are spread over the picture
// (kernels/cpu/feature_selection.h).
#pragma once

namespace haustra::kernels {

inline constexpr int kSelectionCellPx = 60;  // side of the squares that the picture is shared out in
// Points that every square would get if all got the same, times this, make one halving of priority.
inline constexpr float kSharesPerHalving = 2.0f;

}  // namespace haustra::kernels
