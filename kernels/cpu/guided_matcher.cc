#include "kernels/cpu/guided_matcher.h"

#include <algorithm>
#include <cmath>

#include "kernels/common/match_acceptance.h"

namespace haustra::kernels {
namespace {

constexpr int kQueriesPerTask = 128;

}  // namespace

GuidedMatcher::GuidedMatcher(const VisionPlan& plan, const FeatureSetPool& sets, SimdLevel level, LanePool& pool)
    : sets_(sets),
      kernels_(MatchKernelsFor(level)),
      pool_(pool),
      results_(plan.max_match_list),
      owners_(plan.max_features) {}

std::size_t GuidedMatcher::BytesFor(const VisionPlan& plan) {
  return AlignedBuffer<TwoNearest>::BytesFor(plan.max_match_list) +
         AlignedBuffer<std::int32_t>::BytesFor(plan.max_features);
}

void GuidedMatcher::Prefault() {
  results_.SetZero();
  owners_.SetZero();
}

TwoNearest GuidedMatcher::MatchOne(const GuidedQuery& query) const {
  const FeatureSet& train = *train_;
  TwoNearest top;
  const FeatureSet* set = sets_.Get(query.descriptor.set);
  const int feature = query.descriptor.feature_idx;
  if (set == nullptr || feature < 0 || feature >= set->num_features) return top;
  // Negated so that NaN finds nothing.
  if (!(query.radius_px >= 0.0f) || !std::isfinite(query.x_px) || !std::isfinite(query.y_px)) return top;
  const std::uint8_t* descriptor = set->descriptor(feature);
  const float inverse_norm = set->inverse_norms[feature];

  const auto bucket = [](float px, int num_buckets) {
    return static_cast<int>(std::clamp(px / FeatureSetPool::kBucketPx, 0.0f, static_cast<float>(num_buckets - 1)));
  };
  const int first_column = bucket(query.x_px - query.radius_px, sets_.num_bucket_columns());
  const int last_column = bucket(query.x_px + query.radius_px, sets_.num_bucket_columns());
  const int first_row = bucket(query.y_px - query.radius_px, sets_.num_bucket_rows());
  const int last_row = bucket(query.y_px + query.radius_px, sets_.num_bucket_rows());
  const float squared_radius = query.radius_px * query.radius_px;
  for (int row = first_row; row <= last_row; ++row) {
    // Buckets of a row lie one after the other.
    const std::int32_t* starts = train.bucket_starts + static_cast<std::size_t>(row) * sets_.num_bucket_columns();
    for (int k = starts[first_column]; k < starts[last_column + 1]; ++k) {
      const int candidate = train.bucket_features[k];
      const Keypoint& keypoint = train.keypoints[candidate];
      const float dx = keypoint.x_px - query.x_px;
      const float dy = keypoint.y_px - query.y_px;
      if (!(dx * dx + dy * dy <= squared_radius)) continue;
      if (!(keypoint.scale_px >= query.min_scale_px && keypoint.scale_px <= query.max_scale_px)) continue;
      if (!request_.train_allowed.empty() && request_.train_allowed[candidate] == 0) continue;
      const float similarity = static_cast<float>(kernels_.Dot(descriptor, train.descriptor(candidate))) *
                               (inverse_norm * train.inverse_norms[candidate]);
      if (similarity > top.best || (similarity == top.best && candidate < top.best_idx)) {
        top.second = top.best;
        top.best = similarity;
        top.best_idx = candidate;
      } else {
        top.second = std::max(top.second, similarity);
      }
    }
  }
  return top;
}

void GuidedMatcher::Begin(const GuidedMatchRequest& request) {
  request_ = request;
  train_ = sets_.Get(request.train);
  num_matches_ = 0;
  is_done_ = train_->num_features == 0;
  if (is_done_) return;
  const int num_queries = static_cast<int>(request.queries.size());
  pool_.Begin((num_queries + kQueriesPerTask - 1) / kQueriesPerTask, [this, num_queries](int task, int) {
    const int last = std::min((task + 1) * kQueriesPerTask, num_queries);
    for (int i = task * kQueriesPerTask; i < last; ++i) results_[i] = MatchOne(request_.queries[i]);
  });
}

bool GuidedMatcher::Continue(TimePoint deadline) {
  if (!pool_.Finish(deadline)) return false;
  if (!is_done_) num_matches_ = Accept();
  is_done_ = true;
  return true;
}

int GuidedMatcher::Accept() {
  const int num_queries = static_cast<int>(request_.queries.size());
  std::fill_n(owners_.data(), train_->num_features, -1);
  for (int i = 0; i < num_queries; ++i) {
    TwoNearest& top = results_[i];
    if (top.best_idx < 0 || !IsAccepted(top.best, top.second, request_.options)) {
      top.best_idx = -1;
      continue;
    }
    std::int32_t& owner = owners_[top.best_idx];
    if (owner < 0 || top.best > results_[owner].best) owner = i;
  }
  int num_matches = 0;
  for (int i = 0; i < num_queries; ++i) {
    const TwoNearest& top = results_[i];
    if (top.best_idx < 0 || owners_[top.best_idx] != i) continue;
    request_.matches[num_matches++] = {i, top.best_idx, std::min(top.best, 1.0f), std::clamp(top.second, 0.0f, 1.0f)};
  }
  return num_matches;
}

}  // namespace haustra::kernels
