// bundle_kernels.h in vectors; included by one source file for each instruction set and nowhere else. Internal linkage
// throughout (engine/geometry/lanes.h).
//
// With J_p and J_x the Jacobians of a point's observations by the poses and by the point, eliminating the point leaves
// J_p^T (I - M M^T) J_p and J_p^T (I - M M^T) r, where M = J_x L^-T: what is orthogonal to all that the point can
// explain. Off the diagonal that is -Y_a Y_b^T with Y = J_p^T M, on it the identity is taken along, so that one product
// of rank two does for both the pose's own block and its Schur complement.
#pragma once

#include "engine/camera/lane_projection.h"
#include "engine/geometry/lanes.h"
#include "engine/optim/bundle_kernels.h"

namespace haustra::optim {
namespace {

static_assert(kLanes <= kMaxVectorLanes);

double Linearise(const BundleView& view, int begin, int end, double* chi2_out, const LinearisedObservations* out) {
  using Out = LinearisedObservations;
  const double threshold = view.huber_threshold, gate = threshold * threshold;
  VecD cost{};
  for (int o = begin; o < end; o += kLanes) {
    VecD pose[kPoseNumbers], point[kPointNumbers];
    GatherRows<kPoseNumbers>(view.poses, view.pose + o, pose);
    GatherRows<kPointNumbers>(view.points, view.point + o, point);
    VecD p[3];  // in the camera
    for (int i = 0; i < 3; ++i) {
      const VecD* row = pose + 4 * i;
      p[i] = row[0] * point[0] + row[1] * point[1] + row[2] * point[2] + row[3];
    }
    const LaneProjection projection = ProjectLanes(view.camera, p[0], p[1], p[2]);
    const VecMask is_seen = projection.is_seen;
    const VecD inverse_sigma = Load(view.inverse_sigma + o);
    const VecD residual[2] = {(projection.u - Load(view.u + o)) * inverse_sigma,
                              (projection.v - Load(view.v + o)) * inverse_sigma};
    const VecD chi2 = Select(is_seen, residual[0] * residual[0] + residual[1] * residual[1], Splat(view.unseen_chi2));
    Store(chi2_out + o, chi2);
    // Huber's loss and, for iteratively reweighted least squares, its derivative as a weight.
    VecD loss = chi2, root_weight = Splat(1.0);
    const VecMask is_inlier = chi2 <= Splat(gate);
    if (!IsAll(is_inlier)) {  // mostly they are, and roots are dear
      const VecD chi = Sqrt(chi2);
      loss = Select(is_inlier, loss, 2.0 * threshold * chi - gate);
      root_weight = Select(is_inlier, root_weight, Sqrt(threshold / chi));
    }
    cost += Select(FirstLanes(end - o), loss, VecD{});
    if (out == nullptr) continue;

    const VecD scale = inverse_sigma * root_weight;
    double* const to = out->numbers + (o - out->first);
    const auto store = [&](int number, VecD value) { Store(to + number * out->stride, value); };
    for (int r = 0; r < 2; ++r) {
      store(Out::kResidual + r, Select(is_seen, residual[r] * root_weight, VecD{}));
      VecD a[3];  // d residual / d point in the camera
      for (int i = 0; i < 3; ++i) a[i] = Select(is_seen, projection.jacobian[r][i] * scale, VecD{});
      for (int i = 0; i < 3; ++i) {
        store(Out::kByPoint + 3 * r + i, (a[0] * pose[i] + a[1] * pose[4 + i] + a[2] * pose[8 + i]) * point[3]);
        // By (rho, phi): a, and p x a.
        store(Out::kByPose + 6 * r + i, a[i]);
        const int j = (i + 1) % 3, k = (i + 2) % 3;
        store(Out::kByPose + 6 * r + 3 + i, Select(is_seen, p[j] * a[k] - p[k] * a[j], VecD{}));
      }
    }
  }
  double lanes[kLanes], sum = 0.0;
  Store(lanes, cost);
  for (const double lane : lanes) sum += lane;
  return 0.5 * sum;
}

// The factor of a point's damped normal matrix, of which its observations are the rows of the Jacobian.
EliminatedPoint Factor(const double* in, int stride, int num, double lambda) {
  using In = LinearisedObservations;
  VecD products[12] = {};  // V: 00 10 11 20 21 22; gradient: 3; rest unused
  for (int o = 0; o < num; o += kLanes) {
    const VecMask is_own = FirstLanes(num - o);
    for (int r = 0; r < 2; ++r) {
      VecD a[3];
      for (int i = 0; i < 3; ++i) a[i] = Select(is_own, Load(in + (In::kByPoint + 3 * r + i) * stride + o), VecD{});
      const VecD residuals = Load(in + (In::kResidual + r) * stride + o);
      int k = 0;
      for (int i = 0; i < 3; ++i) {
        for (int j = 0; j <= i; ++j) products[k++] += a[i] * a[j];
      }
      for (int i = 0; i < 3; ++i) products[k++] += a[i] * residuals;
    }
  }
  double sums[12];
  SumLanes<12>(products, sums);
  double v00 = sums[0], v11 = sums[2], v22 = sums[5];
  double largest = v00 > v11 ? v00 : v11;
  largest = v22 > largest ? v22 : largest;
  EliminatedPoint point = {};
  if (!(largest > 0.0)) return point;
  const double floor = kDiagonalFloor * largest;
  v00 += lambda * (v00 > floor ? v00 : floor);
  v11 += lambda * (v11 > floor ? v11 : floor);
  v22 += lambda * (v22 > floor ? v22 : floor);
  const double i0 = 1.0 / __builtin_sqrt(v00);
  const double l10 = sums[1] * i0, l20 = sums[3] * i0;
  const double i1 = 1.0 / __builtin_sqrt(v11 - l10 * l10);
  const double l21 = (sums[4] - l20 * l10) * i1;
  const double i2 = 1.0 / __builtin_sqrt(v22 - l20 * l20 - l21 * l21);
  // Infinite or not a number: rank lost to rounding; the point waits.
  constexpr double kLargest = 1e300;
  if (!(i1 < kLargest) || !(i2 < kLargest)) return point;
  point = {i0, i1, i2, l10, l20, l21, {}};
  const double* const gradient = sums + 6;
  point.z[0] = gradient[0] * i0;
  point.z[1] = (gradient[1] - l10 * point.z[0]) * i1;
  point.z[2] = (gradient[2] - l20 * point.z[0] - l21 * point.z[1]) * i2;
  return point;
}

// Where row i of a column of a matrix of six rows stands (ReducedSystem::y).
template <int kColumns>
constexpr int AtRow(int i, int column) {
  return i < 4 ? 4 * column + i : 4 * kColumns + 2 * column + (i - 4);
}

// Left factor of a product: a matrix of six rows (AtRow) in registers. A column is no whole number of vectors, but
// two are: with four lanes [0123] of the first, [45] of the first and [01] of the second, [2345] of the second.
constexpr int kPairVectors = 12 / kLanes;
template <int kColumns>
struct LeftFactor {
  VecD columns[kColumns][kPairVectors];
};
template <int kColumns>
inline LeftFactor<kColumns> LoadLeft(const double* a) {
  LeftFactor<kColumns> left;
  for (int c = 0; c < kColumns; ++c) {
    const double* const upper = a + 4 * c;
    const double* const lower = a + 4 * kColumns + 2 * c;
#if defined(__AVX2__)
    const __m256d rows0123 = _mm256_loadu_pd(upper);
    const __m256d rows4545 = _mm256_broadcast_pd(reinterpret_cast<const __m128d*>(lower));
    left.columns[c][0] = rows0123;
    left.columns[c][1] = _mm256_permute2f128_pd(rows4545, rows0123, 0x20);
    left.columns[c][2] = _mm256_permute2f128_pd(rows0123, rows4545, 0x21);
#else
    for (int i = 0; i < 2; ++i) {
      left.columns[c][3 * i] = Load(upper);
      left.columns[c][3 * i + 1] = Load(upper + 2);
      left.columns[c][3 * i + 2] = Load(lower);
    }
#endif
  }
  return left;
}

// s -= a b^T with s 6x6 column-major and b(row, column) the numbers of b. The innermost loop: once for each pair of
// views of a point.
template <int kColumns, class Right>
inline void SubtractProduct(const LeftFactor<kColumns>& a, const Right& b, double* s) {
#pragma GCC unroll 3
  for (int pair = 0; pair < 3; ++pair) {
    double* const to = s + 12 * pair;
    VecD sums[kPairVectors];
    for (int i = 0; i < kPairVectors; ++i) sums[i] = Load(to + kLanes * i);
#pragma GCC unroll 3
    for (int c = 0; c < kColumns; ++c) {
      const VecD first = Splat(b(2 * pair, c)), second = Splat(b(2 * pair + 1, c));
#if defined(__AVX2__)
      sums[0] -= a.columns[c][0] * first;
      sums[1] -= a.columns[c][1] * VecD(_mm256_blend_pd(first, second, 0xc));
      sums[2] -= a.columns[c][2] * second;
#else
      for (int i = 0; i < kPairVectors; ++i) sums[i] -= a.columns[c][i] * (i < 3 ? first : second);
#endif
    }
    for (int i = 0; i < kPairVectors; ++i) Store(to + kLanes * i, sums[i]);
  }
}

// Y of the observations of a point from the first of `in` on, and what each of them adds to its own pose.
void EliminateLanes(const EliminatedPoint& point, const double* in, int stride, int num, const std::int32_t* free_pose,
                    double* y, const ReducedSystem& system) {
  using In = LinearisedObservations;
  const auto number = [&](int i) { return Load(in + i * stride); };
  VecD m[2][3], a[2][6], rest[2];
  for (int r = 0; r < 2; ++r) {
    m[r][0] = number(In::kByPoint + 3 * r) * point.inverse_l00;
    m[r][1] = (number(In::kByPoint + 3 * r + 1) - point.l10 * m[r][0]) * point.inverse_l11;
    m[r][2] = (number(In::kByPoint + 3 * r + 2) - point.l20 * m[r][0] - point.l21 * m[r][1]) * point.inverse_l22;
    rest[r] = number(In::kResidual + r) - m[r][0] * point.z[0] - m[r][1] * point.z[1] - m[r][2] * point.z[2];
    for (int i = 0; i < 6; ++i) a[r][i] = number(In::kByPose + 6 * r + i);
  }
  VecD lower[6];
  for (int c = 0; c < 3; ++c) {
    VecD upper[4];
    for (int i = 0; i < 4; ++i) upper[i] = a[0][i] * m[0][c] + a[1][i] * m[1][c];
    StoreRows<4>(upper, y + 4 * c, 18);
    for (int i = 0; i < 2; ++i) lower[2 * c + i] = a[0][4 + i] * m[0][c] + a[1][4 + i] * m[1][c];
  }
  StoreRows<6>(lower, y + 12, 18);

  const auto product = [&](int r, int s) { return m[r][0] * m[s][0] + m[r][1] * m[s][1] + m[r][2] * m[s][2]; };
  const VecD k[2][2] = {{product(0, 0) - 1.0, product(0, 1)}, {product(1, 0), product(1, 1) - 1.0}};
  VecD own[24];  // J_p^T (M M^T - I) as AtRow; what is added to pose_sums
  for (int i = 0; i < 6; ++i) {
    for (int c = 0; c < 2; ++c) own[AtRow<2>(i, c)] = a[0][i] * k[0][c] + a[1][i] * k[1][c];
    own[12 + i] = a[0][i] * rest[0] + a[1][i] * rest[1];
    own[18 + i] = a[0][i] * a[0][i] + a[1][i] * a[1][i];
  }
  double rows[24 * kLanes];
  StoreRows<24>(own, rows, 24);
  for (int o = 0; o < num; ++o) {
    const std::int64_t pose = free_pose[o];
    const double* const row = rows + 24 * o;
    SubtractProduct(
        LoadLeft<2>(row), [&](int i, int c) { return in[(In::kByPose + 6 * c + i) * stride + o]; },
        system.blocks + 36 * (pose * (pose + 1) / 2 + pose));
    double* const sums = system.pose_sums + 12 * pose;
    for (int i = 0; i < 12; i += kLanes) Store(sums + i, Load(sums + i) + Load(row + 12 + i));
  }
}

void Eliminate(const BundleView& view, int begin, int end, double lambda, const LinearisedObservations& in,
               const ReducedSystem& system) {
  // All points before the first pair of views, so that the processor may work on several of these chains of roots.
  for (int j = begin; j < end; ++j) {
    const int first = view.begin[j];
    system.points[j] = Factor(in.numbers + (first - in.first), in.stride, view.begin[j + 1] - first, lambda);
  }
  for (int j = begin; j < end; ++j) {
    const int last = view.begin[j + 1];
    int first = view.begin[j];
    while (first < last && view.free_pose[first] < 0) ++first;
    for (int o = first; o < last; o += kLanes) {
      // Lanes beyond the last write rows of the points that follow, which write them again.
      const int num = last - o < kLanes ? last - o : kLanes;
      EliminateLanes(system.points[j], in.numbers + (o - in.first), in.stride, num, view.free_pose + o,
                     system.y + 18 * static_cast<std::int64_t>(o), system);
    }
    for (int a = first + 1; a < last; ++a) {
      const std::int64_t row = view.free_pose[a];
      const auto left = LoadLeft<3>(system.y + 18 * static_cast<std::int64_t>(a));
      double* const blocks = system.blocks + 36 * (row * (row + 1) / 2);
      const double* y = system.y + 18 * static_cast<std::int64_t>(first);
      for (int b = first; b < a; ++b, y += 18) {
        double* const block = blocks + 36 * static_cast<std::int64_t>(view.free_pose[b]);
        SubtractProduct(
            left, [&](int i, int c) { return y[AtRow<3>(i, c)]; }, block);
        if (view.free_pose[b] != row) continue;
        // Two views of the point by one pose: both halves of their product fall into its block.
        const double* const own = system.y + 18 * static_cast<std::int64_t>(a);
        SubtractProduct(
            LoadLeft<3>(y), [&](int i, int c) { return own[AtRow<3>(i, c)]; }, block);
      }
    }
  }
}

constexpr BundleKernels kKernels = {&Linearise, &Eliminate};

}  // namespace
}  // namespace haustra::optim
