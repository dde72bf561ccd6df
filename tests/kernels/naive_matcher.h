// What matching is to give, as plainly as it can be said (hal/vision_device.h): every pair in a double loop.
#pragma once

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <functional>
#include <vector>

#include "hal/vision_device.h"

namespace haustra::testing {

// Features as the host knows them.
struct HostFeatures {
  std::vector<Keypoint> keypoints;
  std::vector<std::uint8_t> descriptors;

  int size() const { return static_cast<int>(keypoints.size()); }
  const std::uint8_t* descriptor(int i) const {
    return descriptors.data() + static_cast<std::size_t>(i) * kDescriptorBytes;
  }
};

inline double Similarity(const std::uint8_t* a, const std::uint8_t* b) {
  double dot = 0.0;
  double squares_a = 0.0;
  double squares_b = 0.0;
  for (int i = 0; i < kDescriptorBytes; ++i) {
    dot += a[i] * b[i];
    squares_a += a[i] * a[i];
    squares_b += b[i] * b[i];
  }
  return squares_a > 0 && squares_b > 0 ? dot / std::sqrt(squares_a * squares_b) : 0.0;
}

// An entry of a list; nullptr: a stale one.
using Entries = std::vector<const std::uint8_t*>;

inline Entries AllOf(const HostFeatures& features) {
  Entries entries;
  for (int i = 0; i < features.size(); ++i) entries.push_back(features.descriptor(i));
  return entries;
}

inline bool PassesTests(double best, double second, const MatchOptions& options) {
  if (best < options.min_similarity) return false;
  return std::acos(std::min(best, 1.0)) <= options.max_angle_ratio * std::acos(std::clamp(second, 0.0, 1.0));
}

// admissible(query position, train position).
inline std::vector<Match> NaiveMatch(const Entries& query, const Entries& train, const MatchOptions& options,
                                     const std::function<bool(int, int)>& admissible = nullptr) {
  const auto similarity = [&](std::size_t q, std::size_t t) {
    if (query[q] == nullptr || train[t] == nullptr) return -1.0;
    if (admissible && !admissible(static_cast<int>(q), static_cast<int>(t))) return -1.0;
    return Similarity(query[q], train[t]);
  };
  std::vector<Match> matches;
  for (std::size_t q = 0; q < query.size(); ++q) {
    int best_idx = -1;
    double best = -1.0;
    for (std::size_t t = 0; t < train.size(); ++t) {
      const double s = similarity(q, t);
      if (s > best) {
        best = s;
        best_idx = static_cast<int>(t);
      }
    }
    if (best_idx < 0) continue;
    double second = 0.0;
    for (std::size_t t = 0; t < train.size(); ++t) {
      if (static_cast<int>(t) != best_idx) second = std::max(second, similarity(q, t));
    }
    if (!PassesTests(best, second, options)) continue;
    bool is_mutual = true;
    for (std::size_t other = 0; options.mutual && other < query.size(); ++other) {
      const double s = similarity(other, best_idx);
      if (s > best || (s == best && other < q)) is_mutual = false;
    }
    if (!is_mutual) continue;
    matches.push_back({static_cast<std::int32_t>(q), best_idx, static_cast<float>(best), static_cast<float>(second)});
  }
  return matches;
}

// descriptors[i]: of query i; nullptr: stale.
inline std::vector<Match> NaiveGuidedMatch(const std::vector<GuidedQuery>& queries, const Entries& descriptors,
                                           const HostFeatures& train, const std::vector<std::uint8_t>& allowed,
                                           const MatchOptions& options) {
  std::vector<Match> proposals;
  for (std::size_t q = 0; q < queries.size(); ++q) {
    if (descriptors[q] == nullptr) continue;
    double best = -1.0;
    double second = 0.0;
    int best_idx = -1;
    for (int t = 0; t < train.size(); ++t) {
      const Keypoint& k = train.keypoints[t];
      const double dx = k.x_px - queries[q].x_px;
      const double dy = k.y_px - queries[q].y_px;
      const double radius = queries[q].radius_px;
      if (dx * dx + dy * dy > radius * radius) continue;
      if (k.scale_px < queries[q].min_scale_px || k.scale_px > queries[q].max_scale_px) continue;
      if (!allowed.empty() && allowed[t] == 0) continue;
      const double s = Similarity(descriptors[q], train.descriptor(t));
      if (s > best) {
        second = std::max(second, best);
        best = s;
        best_idx = t;
      } else {
        second = std::max(second, s);
      }
    }
    if (best_idx < 0 || !PassesTests(best, second, options)) continue;
    proposals.push_back({static_cast<std::int32_t>(q), best_idx, static_cast<float>(best), static_cast<float>(second)});
  }
  std::vector<Match> matches;
  for (const Match& m : proposals) {
    bool is_best = true;
    for (const Match& other : proposals) {
      if (other.train != m.train) continue;
      if (other.similarity > m.similarity || (other.similarity == m.similarity && other.query < m.query))
        is_best = false;
    }
    if (is_best) matches.push_back(m);
  }
  return matches;
}

}  // namespace haustra::testing
