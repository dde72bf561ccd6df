// What the CPU and the CUDA extractor share: the constants of the scale space, of the orientation histogram and of the
// descriptor (Lowe 2004, "Distinctive image features from scale-invariant keypoints"; section numbers below are his).
// "Octave pixels" are pixels of an octave's own grid: octave pixel (x, y) of octave o lies at (x, y) * 2^o input
// pixels.
#pragma once

namespace haustra::kernels {

// Scale space (3.1 to 3.3). The finest octave is the image at twice its size: at the input's own resolution about half
// of the 2000 features wanted of a 720x540 picture would be missing.
inline constexpr int kFirstOctave = -1;
inline constexpr float kFinestOctaveMaxScalePx = 1.7962f;  // its keypoints' scales lie below this, input pixels
inline constexpr int kMaxOctaves = 8;
inline constexpr int kScalesPerOctave = 3;
inline constexpr int kNumLevels = kScalesPerOctave + 3;  // Gaussian images an octave
inline constexpr float kBaseSigma = 1.6f;                // blur of level 0, octave pixels
inline constexpr float kInputSigma = 0.5f;          // blur that the camera's picture is taken to have, input pixels
inline constexpr int kMinOctaveSizePx = 24;         // no octave has a shorter side than this
inline constexpr float kKernelRadiusSigmas = 3.0f;  // Gaussian kernels are cut off here
// Extrema this close to the edge of an octave are left out, octave pixels.
inline constexpr int kEdgeMarginPx = 5;

// Refinement (4).
inline constexpr int kMaxRefinementSteps = 5;
// As low as camera noise allows: the strongest are taken anyway, and what lies in the dark has little contrast.
inline constexpr float kDefaultContrastThreshold = 0.0015f;

// Selection: the responses of the finest octave count for so much. It finds most of the points, and its are the first
// that compression and focus change; on pictures with more points than are wanted, others give more inliers for the
// same number (kernels/decisions/2026-11-23-features-on-living-tissue.md).
inline constexpr float kFinestOctavePriority = 0.5f;

// Orientation (5): the pixels of a square of at most kOrientationReachPx (octave pixels) around the point, under a
// Gaussian window in units of the keypoint's scale. The window is wider than Lowe's (1.5), and second orientations are
// rarer (his share is 0.8): on endoscopic pictures both give more matches at different places (kernels/cpu/decisions
// has the reasons).
inline constexpr float kOrientationWindowSigma = 2.5f;
inline constexpr float kOrientationReachSigmas = 2.0f;  // of the window
inline constexpr int kOrientationReachPx = 16;
inline constexpr int kOrientationBins = 36;
inline constexpr float kOrientationPeakRatio = 0.9f;
inline constexpr int kMaxOrientations = 3;

// Descriptor (6): 4x4 cells of 8 orientations, index = (row * 4 + column) * 8 + orientation, in the keypoint's own
// frame (x along its orientation). Cells of five scales instead of three: mucosa has little detail, and the wider view
// gives a third more inliers between neighbouring frames, and twice as many when a place of low texture is seen again.
inline constexpr int kDescriptorCells = 4;
inline constexpr int kDescriptorOrientations = 8;
inline constexpr float kDescriptorCellSize = 5.0f;   // side of a cell, in units of the keypoint's scale
inline constexpr int kDescriptorSamplesPerCell = 3;  // a side
// Gradients come from the level above the keypoint's and reach this far to either side: in dim, smooth pictures, noise
// costs more than detail gains.
inline constexpr int kDescriptorLevelOffset = 1;
inline constexpr int kDescriptorGradientReachPx = 3;   // octave pixels
inline constexpr float kDescriptorWindowSigma = 2.0f;  // cells
inline constexpr float kDescriptorClip = 0.2f;
inline constexpr float kDescriptorNorm =
    512.0f;  // length of the quantised descriptor, before rounding and clamping to 255

}  // namespace haustra::kernels
