// What every search for depth has in common, that of the engine (engine/surface/depth_matcher.h) and those of devices
// (depth_solver.h).
#pragma once

namespace haustra::depth_search {

inline constexpr float kNoCost = 2.0f;           // of a window that no source shows: that of an inverted picture
inline constexpr int kGlare = 250;               // grey; a wet highlight moves with the lamp, not with the wall
inline constexpr float kMinWindowWeight = 0.4f;  // share of the window that must be scene without glare
inline constexpr double kFirstDepthStep = 0.08;  // relative, of the first iteration; halved with each
inline constexpr double kFirstSlantStep = 0.5;   // of the plane's part across the ray, relative to its part along
inline constexpr double kSeedPull = 0.05;        // cost of being far from the seeds' plane
inline constexpr double kSeedReach = 0.15;       // relative distance that costs all of it
// Of a cell, at four distances along its row and its column.
inline constexpr int kNumNeighbours = 16, kNumNearNeighbours = 8;
inline constexpr double kSharpPeak = 0.10;  // rise of the cost a pixel beside a peak that is beyond doubt
// A wall at less than this to the ray is not seen.
inline constexpr double kMinSlantDeg = 5.0;
inline constexpr double kMinSlantSine = 0.087;

}  // namespace haustra::depth_search
