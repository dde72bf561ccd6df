#include "hal/fakes/scripted_matching.h"

#include <algorithm>
#include <cmath>

namespace haustra {
namespace {

using Vector3 = std::array<float, 3>;

float Angle(float cosine) { return std::acos(std::clamp(cosine, -1.0f, 1.0f)); }

bool PassesThresholds(const Match& match, const MatchOptions& options) {
  return match.train >= 0 && match.similarity >= options.min_similarity &&
         Angle(match.similarity) <= options.max_angle_ratio * Angle(match.second_similarity);
}

// Whether `to` lies on the epipolar plane of `from`, to within the sine `tolerance`. Without a plane none does.
bool IsOnEpipolarPlane(const std::array<float, 9>& e, bool is_transposed, const Vector3& from, const Vector3& to,
                       float tolerance) {
  Vector3 normal{};
  for (int row = 0; row < 3; ++row) {
    for (int column = 0; column < 3; ++column) {
      normal[row] += e[is_transposed ? 3 * column + row : 3 * row + column] * from[column];
    }
  }
  const float length = std::sqrt(normal[0] * normal[0] + normal[1] * normal[1] + normal[2] * normal[2]);
  const float distance = std::abs(normal[0] * to[0] + normal[1] * to[1] + normal[2] * to[2]);
  return length > 0.0f && distance <= tolerance * length;
}

// Which pairs may be compared at all.
struct Gate {
  const DisparityWindow* disparity;
  const EpipolarGate* epipolar;

  bool Admits(const ScriptedEntry& query, const ScriptedEntry& train) const {
    if (!query.is_valid || !train.is_valid) return false;
    if (disparity != nullptr) {
      if (std::abs(query.keypoint.x_px - train.keypoint.x_px) > disparity->max_dx_px) return false;
      if (std::abs(query.keypoint.y_px - train.keypoint.y_px) > disparity->max_dy_px) return false;
    }
    if (epipolar != nullptr) {
      const Vector3& b_query = epipolar->query_bearings[query.feature_idx];
      const Vector3& b_train = epipolar->train_bearings[train.feature_idx];
      const auto& e = epipolar->train_from_query_essential;
      if (!IsOnEpipolarPlane(e, false, b_query, b_train, epipolar->train_tolerance[train.feature_idx])) return false;
      if (!IsOnEpipolarPlane(e, true, b_train, b_query, epipolar->query_tolerance[query.feature_idx])) return false;
    }
    return true;
  }
};

// Best and second best of the candidates; ties keep the lowest position.
template <typename Admits>
Match FindBest(const ScriptedEntry& entry, std::span<const ScriptedEntry> candidates,
               const ScriptedSimilarity& similarity, const Admits& admits) {
  Match match;
  bool has_second = false;
  for (std::size_t i = 0; i < candidates.size(); ++i) {
    const float value = similarity(entry.appearance, candidates[i].appearance);
    // The gate is the expensive part: it is asked only where the answer can change anything.
    if (has_second && value <= match.second_similarity) continue;
    if (!admits(candidates[i])) continue;
    if (match.train < 0) {
      match.similarity = value;
      match.train = static_cast<std::int32_t>(i);
    } else if (value > match.similarity) {
      match.second_similarity = match.similarity;
      match.similarity = value;
      match.train = static_cast<std::int32_t>(i);
      has_second = true;
    } else {
      match.second_similarity = value;
      has_second = true;
    }
  }
  return match;
}

}  // namespace

int MatchScripted(std::span<const ScriptedEntry> query, std::span<const ScriptedEntry> train,
                  const ScriptedSimilarity& similarity, const MatchOptions& options, const DisparityWindow* disparity,
                  const EpipolarGate* epipolar, std::span<Match> matches) {
  const Gate gate{disparity, epipolar};
  int num_matches = 0;
  for (std::size_t q = 0; q < query.size(); ++q) {
    Match match = FindBest(query[q], train, similarity,
                           [&](const ScriptedEntry& candidate) { return gate.Admits(query[q], candidate); });
    match.query = static_cast<std::int32_t>(q);
    if (!PassesThresholds(match, options)) continue;
    if (options.mutual) {
      const ScriptedEntry& partner = train[match.train];
      const Match back = FindBest(partner, query, similarity,
                                  [&](const ScriptedEntry& candidate) { return gate.Admits(candidate, partner); });
      if (back.train != match.query) continue;
    }
    matches[num_matches++] = match;
  }
  return num_matches;
}

int GuidedMatchScripted(std::span<const GuidedQuery> windows, std::span<const ScriptedEntry> query,
                        std::span<const ScriptedEntry> train, std::span<const std::uint8_t> train_allowed,
                        const ScriptedSimilarity& similarity, const MatchOptions& options,
                        std::span<std::int32_t> holder, std::span<Match> matches) {
  std::fill_n(holder.begin(), train.size(), -1);
  int num_candidates = 0;
  for (std::size_t q = 0; q < windows.size(); ++q) {
    const GuidedQuery& window = windows[q];
    if (!query[q].is_valid) continue;
    Match match = FindBest(query[q], train, similarity, [&](const ScriptedEntry& candidate) {
      const Keypoint& keypoint = candidate.keypoint;
      const float dx = keypoint.x_px - window.x_px, dy = keypoint.y_px - window.y_px;
      return candidate.is_valid && dx * dx + dy * dy <= window.radius_px * window.radius_px &&
             keypoint.scale_px >= window.min_scale_px && keypoint.scale_px <= window.max_scale_px &&
             (train_allowed.empty() || train_allowed[candidate.feature_idx] != 0);
    });
    match.query = static_cast<std::int32_t>(q);
    if (!PassesThresholds(match, options)) continue;
    matches[num_candidates] = match;
    std::int32_t& held = holder[match.train];
    if (held < 0 || match.similarity > matches[held].similarity) held = num_candidates;
    ++num_candidates;
  }
  int num_matches = 0;
  for (int i = 0; i < num_candidates; ++i) {
    if (holder[matches[i].train] == i) matches[num_matches++] = matches[i];
  }
  return num_matches;
}

}  // namespace haustra
