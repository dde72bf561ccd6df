// The ladder that a frame walks down before it misses its deadline.
#pragma once

#include <cstdint>
#include <string_view>

namespace haustra {

enum class Rung : std::uint8_t {
  kFull = 0,       // nothing was left out
  kNoRecovery,     // brute force would have taken too long: after a guided search that failed, or to found a map
  kFewerFeatures,  // of the picture, and no fine ones
  kFewerPoints,    // of the local map
  kPredicted,      // no measurement in time: the pose is the prediction, or there is none
  kNumRungs,
};
inline constexpr int kNumRungs = static_cast<int>(Rung::kNumRungs);

constexpr std::string_view ToString(Rung rung) {
  constexpr std::string_view names[] = {"full", "no_recovery", "fewer_features", "fewer_points", "predicted"};
  return rung < Rung::kNumRungs ? names[static_cast<int>(rung)] : "unknown";
}

}  // namespace haustra
