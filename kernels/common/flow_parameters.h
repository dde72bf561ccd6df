// What the CPU and the CUDA device share of following features from picture to picture: Lucas and Kanade 1981, coarse
// to fine (Bouguet 2000), on patches without their mean and scaled to their deviation, because the light moves with the
// scope (SD-DefSLAM, Rodriguez et al. 2021, follows points of living tissue under such light likewise). The levels are
// level 0 of the octaves from the input's size on.
#pragma once

#include "kernels/common/sift_parameters.h"

namespace haustra::kernels {

inline constexpr int kFlowPatchPx = 16;  // side
inline constexpr int kFlowPatchArea = kFlowPatchPx * kFlowPatchPx;
inline constexpr int kFlowLevels = 5;  // at most: motions of some hundred pixels in the largest pictures
// Of a patch, intensities in [0, 1]: less than a sixteen-bit step is no texture.
inline constexpr float kFlowMinVariance = 2.4e-10f;
inline constexpr int kFlowMaxSteps = 12;
inline constexpr float kFlowSettledPx = 0.03f;                      // a step this short is the last one
inline constexpr float kFlowMaxStepPx = 0.5f * kFlowPatchPx;        // a longer one leaves what the patch can tell
inline constexpr float kFlowMarginPx = 0.5f * kFlowPatchPx + 2.0f;  // of the patch's centre from the edge of a level
// Mean squared gradient along the worst direction, in deviations of the patch: below it the patch slides.
inline constexpr float kFlowMinGradient2 = 1e-3f;
// Followed to the new picture and back, a feature is where it was, and looks alike. Laxer limits let maps of living
// tissue drift (kernels/decisions/2026-11-23-features-are-followed.md).
inline constexpr float kFlowMaxReturnPx = 0.3f;
inline constexpr float kFlowMinCorrelation = 0.9f;
// Where a feature may be, for callers that ask for the motion of many and make no features of them: in blur few are
// sure.
inline constexpr float kFlowMaxRoughReturnPx = 1.5f;
inline constexpr float kFlowMinRoughCorrelation = 0.8f;
// A feature that detection has found this near, at nearly the same scale, is not followed: distance in scales, and at
// least in pixels; factor of the scales.
inline constexpr float kFlowSameDistance = 0.7f;
inline constexpr float kFlowSameMinPx = 1.0f;
inline constexpr float kFlowSameScaleFactor = 1.4f;

}  // namespace haustra::kernels
