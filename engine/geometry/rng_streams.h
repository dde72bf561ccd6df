// Which stream of the run's seed each user of random numbers draws from (rng.h): no two share one, but for the pair
// that is said below. Another number is another sequence, and with it another map of the same video. Sequences of fixed
// seeds, which no configuration changes, stand beside their users. Plain data.
#pragma once

#include <cstdint>

namespace haustra::rng_stream {

inline constexpr std::uint64_t kFounding = 1;    // engine/tracking/initialiser.h
inline constexpr std::uint64_t kRecovery = 2;    // engine/tracking/pose_recovery.h
inline constexpr std::uint64_t kTrackLinks = 7;  // engine/mapping/track_linker.h
// The same sequence for both, each from its beginning. One draws pairs of features of two pictures of a young map, the
// other points of two groups of keyframes: never of the same list, so neither can tell.
inline constexpr std::uint64_t kRelief = 11;       // engine/mapping/relief_check.h
inline constexpr std::uint64_t kRecogniser = 11;   // engine/place/place_recogniser.h
inline constexpr std::uint64_t kRelocaliser = 12;  // engine/place/relocaliser.h
inline constexpr std::uint64_t kGroups = 13;       // engine/place/common_area.h
inline constexpr std::uint64_t kVocabulary = 23;   // engine/place/vocabulary.h

}  // namespace haustra::rng_stream
