#include "kernels/cpu/brute_force_matcher.h"

#include <algorithm>
#include <cmath>
#include <cstring>

#include "kernels/common/match_acceptance.h"

namespace haustra::kernels {
namespace {

// Of a task: fewer are not worth waking another thread for.
constexpr int kComparedPerTask = 64;
static_assert(kComparedPerTask % kQueryTile == 0);

using Vector3f = std::array<float, 3>;

// A zero vector becomes NaN, which passes no gate.
Vector3f Normalised(const Vector3f& v) {
  const float norm = std::sqrt(v[0] * v[0] + v[1] * v[1] + v[2] * v[2]);
  return {v[0] / norm, v[1] / norm, v[2] / norm};
}

Vector3f Multiply(const std::array<float, 9>& m, const Vector3f& v) {
  return {m[0] * v[0] + m[1] * v[1] + m[2] * v[2], m[3] * v[0] + m[4] * v[1] + m[5] * v[2],
          m[6] * v[0] + m[7] * v[1] + m[8] * v[2]};
}

Vector3f MultiplyTransposed(const std::array<float, 9>& m, const Vector3f& v) {
  return {m[0] * v[0] + m[3] * v[1] + m[6] * v[2], m[1] * v[0] + m[4] * v[1] + m[7] * v[2],
          m[2] * v[0] + m[5] * v[1] + m[8] * v[2]};
}

}  // namespace

BruteForceMatcher::BruteForceMatcher(int max_list, const FeatureSetPool& sets, SimdLevel level, LanePool& pool)
    : sets_(sets),
      kernels_(MatchKernelsFor(level)),
      pool_(pool),
      has_train_best_(static_cast<std::size_t>(pool.num_threads())) {
  const std::size_t num_queries = AlignUp(max_list, kQueryTile);
  const std::size_t num_train = AlignUp(max_list, kTrainBlock);
  query_bytes_ = AlignedBuffer<std::uint8_t>(num_queries * kDescriptorBytes);
  query_inverse_norms_ = AlignedBuffer<float>(num_queries);
  query_is_valid_ = AlignedBuffer<std::uint8_t>(num_queries);
  query_gates_ = AlignedBuffer<GatePoint>(num_queries);
  train_bytes_ = AlignedBuffer<std::uint8_t>(num_train * kDescriptorBytes);
  train_sums_ = AlignedBuffer<std::int32_t>(num_train);
  train_inverse_norms_ = AlignedBuffer<float>(num_train);
  train_is_valid_ = AlignedBuffer<std::int32_t>(num_train);
  train_gates_ = AlignedBuffer<GateBlock>(num_train / kTrainBlock);
  results_ = AlignedBuffer<TwoNearest>(num_queries);
  query_bytes_.SetZero();
  train_best_similarity_.reserve(pool.num_threads());
  train_best_query_.reserve(pool.num_threads());
  for (int i = 0; i < pool.num_threads(); ++i) {
    train_best_similarity_.emplace_back(num_train);
    train_best_query_.emplace_back(num_train);
  }
}

std::size_t BruteForceMatcher::BytesFor(int max_list, int num_threads) {
  const std::size_t num_queries = AlignUp(max_list, kQueryTile);
  const std::size_t num_train = AlignUp(max_list, kTrainBlock);
  using Bytes = AlignedBuffer<std::uint8_t>;
  using Floats = AlignedBuffer<float>;
  using Integers = AlignedBuffer<std::int32_t>;
  return Bytes::BytesFor(num_queries * kDescriptorBytes) + Floats::BytesFor(num_queries) +
         Bytes::BytesFor(num_queries) + AlignedBuffer<GatePoint>::BytesFor(num_queries) +
         Bytes::BytesFor(num_train * kDescriptorBytes) + Integers::BytesFor(num_train) + Floats::BytesFor(num_train) +
         Integers::BytesFor(num_train) + AlignedBuffer<GateBlock>::BytesFor(num_train / kTrainBlock) +
         AlignedBuffer<TwoNearest>::BytesFor(num_queries) +
         num_threads *
             (sizeof(Floats) + sizeof(Integers) + Floats::BytesFor(num_train) + Integers::BytesFor(num_train));
}

void BruteForceMatcher::Prefault() {
  query_inverse_norms_.SetZero();
  query_is_valid_.SetZero();
  query_gates_.SetZero();
  train_bytes_.SetZero();
  train_sums_.SetZero();
  train_inverse_norms_.SetZero();
  train_is_valid_.SetZero();
  train_gates_.SetZero();
  results_.SetZero();
  for (AlignedBuffer<float>& buffer : train_best_similarity_) buffer.SetZero();
  for (AlignedBuffer<std::int32_t>& buffer : train_best_query_) buffer.SetZero();
}

int BruteForceMatcher::ListSize(const DescriptorList& list, const FeatureSetPool& sets) {
  if (!list.refs.empty()) return static_cast<int>(list.refs.size());
  const FeatureSet* set = sets.Get(list.set);
  if (set == nullptr) return -1;
  return list.use_indices || !list.indices.empty() ? static_cast<int>(list.indices.size()) : set->num_features;
}

BruteForceMatcher::Entry BruteForceMatcher::EntryOf(const DescriptorList& list, const FeatureSet* set,
                                                    int position) const {
  if (list.refs.empty()) return {set, list.use_indices || !list.indices.empty() ? list.indices[position] : position};
  const DescriptorRef& ref = list.refs[position];
  const FeatureSet* of_ref = sets_.Get(ref.set);
  if (of_ref == nullptr || ref.feature_idx < 0 || ref.feature_idx >= of_ref->num_features) return {};
  return {of_ref, ref.feature_idx};
}

void BruteForceMatcher::PackQueries(const DescriptorList& list, int size) {
  const FeatureSet* set = sets_.Get(list.set);
  for (int i = 0; i < size; ++i) {
    const Entry entry = EntryOf(list, set, i);
    query_is_valid_[i] = entry.set != nullptr ? 1 : 0;
    if (entry.set == nullptr) continue;
    std::memcpy(query_bytes_.data() + static_cast<std::size_t>(i) * kDescriptorBytes,
                entry.set->descriptor(entry.feature_idx), kDescriptorBytes);
    query_inverse_norms_[i] = entry.set->inverse_norms[entry.feature_idx];
  }
}

void BruteForceMatcher::PackTrain(const DescriptorList& list, int size) {
  const FeatureSet* set = sets_.Get(list.set);
  for (int i = 0; i < AlignUp(size, kTrainBlock); ++i) {
    const Entry entry = i < size ? EntryOf(list, set, i) : Entry{};
    train_is_valid_[i] = entry.set != nullptr ? -1 : 0;
    train_sums_[i] = 0;
    train_inverse_norms_[i] = 0.0f;
    std::uint8_t* out = train_bytes_.data() + static_cast<std::size_t>(i / kTrainBlock) * kTrainBlockBytes +
                        static_cast<std::size_t>(i % kTrainBlock) * 4;
    if (entry.set == nullptr) {
      for (int g = 0; g < kDescriptorBytes / 4; ++g)
        std::memset(out + static_cast<std::size_t>(g) * kTrainBlock * 4, 0, 4);
      continue;
    }
    const std::uint8_t* in = entry.set->descriptor(entry.feature_idx);
    std::int32_t sum = 0;
    for (int k = 0; k < kDescriptorBytes; ++k) sum += in[k];
    for (int g = 0; g < kDescriptorBytes / 4; ++g)
      std::memcpy(out + static_cast<std::size_t>(g) * kTrainBlock * 4, in + 4 * g, 4);
    train_sums_[i] = sum;
    train_inverse_norms_[i] = entry.set->inverse_norms[entry.feature_idx];
  }
}

void BruteForceMatcher::PackGates() {
  const EpipolarGate* epipolar = request_.epipolar;
  const FeatureSet* query_set = sets_.Get(request_.query.set);
  for (int i = 0; i < num_queries_; ++i) {
    GatePoint& gate = query_gates_[i];
    const int feature = EntryOf(request_.query, query_set, i).feature_idx;
    gate.x_px = query_set->keypoints[feature].x_px;
    gate.y_px = query_set->keypoints[feature].y_px;
    if (epipolar == nullptr) continue;
    gate.bearing = epipolar->query_bearings[feature];
    gate.epipolar = Normalised(Multiply(epipolar->train_from_query_essential, gate.bearing));
    gate.tolerance = epipolar->query_tolerance[feature];
  }
  const FeatureSet* train_set = sets_.Get(request_.train.set);
  for (int i = 0; i < AlignUp(num_train_, kTrainBlock); ++i) {
    GateBlock& gate = train_gates_[i / kTrainBlock];
    const int lane = i % kTrainBlock;
    // Filler takes the values of the last entry: it never matches anyway.
    const int feature = EntryOf(request_.train, train_set, std::min(i, num_train_ - 1)).feature_idx;
    gate.x_px[lane] = train_set->keypoints[feature].x_px;
    gate.y_px[lane] = train_set->keypoints[feature].y_px;
    if (epipolar == nullptr) continue;
    const Vector3f& bearing = epipolar->train_bearings[feature];
    const Vector3f normal = Normalised(MultiplyTransposed(epipolar->train_from_query_essential, bearing));
    for (int k = 0; k < 3; ++k) {
      gate.bearing[k][lane] = bearing[k];
      gate.epipolar[k][lane] = normal[k];
    }
    gate.tolerance[lane] = epipolar->train_tolerance[feature];
  }
}

void BruteForceMatcher::Begin(const MatchRequest& request) {
  request_ = request;
  if (request.disparity != nullptr) {
    disparity_ = *request.disparity;
    request_.disparity = &disparity_;
  }
  if (request.epipolar != nullptr) {
    epipolar_ = *request.epipolar;
    request_.epipolar = &epipolar_;
  }
  num_queries_ = ListSize(request.query, sets_);
  num_train_ = ListSize(request.train, sets_);
  num_matches_ = 0;
  step_ = num_queries_ > 0 && num_train_ > 0 ? Step::kPackQueries : Step::kDone;
}

bool BruteForceMatcher::Continue(TimePoint deadline) {
  while (pool_.Finish(deadline)) {
    if (step_ == Step::kDone) return true;
    if (IsOver(deadline)) return false;
    Advance();
  }
  return false;
}

void BruteForceMatcher::Advance() {
  switch (step_) {
    case Step::kPackQueries:
      PackQueries(request_.query, num_queries_);
      step_ = Step::kPackTrain;
      break;
    case Step::kPackTrain:
      PackTrain(request_.train, num_train_);
      step_ = Step::kCompare;
      break;
    case Step::kCompare:
      BeginComparisons();
      step_ = Step::kAccept;
      break;
    case Step::kAccept:
      if (request_.options.mutual) JoinTrainBest();
      num_matches_ = Accept();
      step_ = Step::kDone;
      break;
    case Step::kDone: break;
  }
}

void BruteForceMatcher::BeginComparisons() {
  const bool has_gates = request_.disparity != nullptr || request_.epipolar != nullptr;
  if (has_gates) PackGates();
  std::fill(has_train_best_.begin(), has_train_best_.end(), std::uint8_t{0});
  pool_.Begin((num_queries_ + kComparedPerTask - 1) / kComparedPerTask, [this, has_gates](int task, int worker) {
    const QueryList queries = {query_bytes_.data(), query_inverse_norms_.data(), query_is_valid_.data(),
                               query_gates_.data()};
    const TrainBlocks train = {AlignUp(num_train_, kTrainBlock) / kTrainBlock,
                               train_bytes_.data(),
                               train_sums_.data(),
                               train_inverse_norms_.data(),
                               train_is_valid_.data(),
                               has_gates ? train_gates_.data() : nullptr};
    GateOptions gate;
    gate.has_epipolar = request_.epipolar != nullptr;
    gate.has_window = request_.disparity != nullptr;
    if (gate.has_window) {
      gate.max_dx_px = request_.disparity->max_dx_px;
      gate.max_dy_px = request_.disparity->max_dy_px;
    }
    const int begin = task * kComparedPerTask;
    kernels_.MatchQueries(queries, begin, std::min(begin + kComparedPerTask, num_queries_), train, gate,
                          results_.data(), request_.options.mutual ? TrainBestOf(worker) : TrainBest{});
  });
}

// By the worker itself; a worker that has compared nothing has none.
TrainBest BruteForceMatcher::TrainBestOf(int worker) {
  const auto i = static_cast<std::size_t>(worker);
  const TrainBest best = {train_best_similarity_[i].data(), train_best_query_[i].data()};
  if (has_train_best_[i] == 0) {
    has_train_best_[i] = 1;
    const int num_lanes = AlignUp(num_train_, kTrainBlock);
    std::fill_n(best.similarity, num_lanes, -1.0f);
    std::fill_n(best.query, num_lanes, -1);
  }
  return best;
}

// Ties go to the lowest query, whoever compared it.
void BruteForceMatcher::JoinTrainBest() {
  const TrainBest joined = TrainBestOf(0);
  for (std::size_t worker = 1; worker < has_train_best_.size(); ++worker) {
    if (has_train_best_[worker] == 0) continue;
    for (int i = 0; i < num_train_; ++i) {
      const float similarity = train_best_similarity_[worker][i];
      const std::int32_t query = train_best_query_[worker][i];
      const bool is_better =
          similarity > joined.similarity[i] || (similarity == joined.similarity[i] && query < joined.query[i]);
      if (!is_better) continue;
      joined.similarity[i] = similarity;
      joined.query[i] = query;
    }
  }
}

int BruteForceMatcher::Accept() const {
  int num_matches = 0;
  for (int i = 0; i < num_queries_; ++i) {
    const TwoNearest& top = results_[i];
    if (top.best_idx < 0 || !IsAccepted(top.best, top.second, request_.options)) continue;
    if (request_.options.mutual && train_best_query_[0][top.best_idx] != i) continue;
    request_.matches[num_matches++] = {i, top.best_idx, std::min(top.best, 1.0f), std::clamp(top.second, 0.0f, 1.0f)};
  }
  return num_matches;
}

}  // namespace haustra::kernels
