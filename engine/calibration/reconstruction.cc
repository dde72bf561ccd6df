#include "engine/calibration/reconstruction.h"

#include <algorithm>
#include <cmath>
#include <numbers>
#include <optional>

#include "engine/geometry/absolute_pose.h"
#include "engine/geometry/rng.h"
#include "engine/geometry/triangulation.h"
#include "engine/geometry/two_view.h"

namespace haustra::calibration {
namespace {

constexpr int kMinObservations = 3;       // of a point
constexpr int kMaxPairs = 5;              // of views that may found the reconstruction
constexpr double kMinParallaxRad = 0.01;  // of a point: its depth is known to a tenth or so
constexpr double kFullMotion = 0.12;      // median motion, share of the width, beyond which a pair is no better
constexpr double kMinPlacedShare = 0.4;   // of the points in view that must agree on a view's place

// The localisation error of a feature grows with its scale; the finest ones are no better than the pixel grid.
double SigmaOf(const TrackObservation& o) { return std::max(0.7, 0.45 * o.scale_px); }

struct Pair {
  int a = 0, b = 0;
  double score = 0.0;
};

class Builder {
 public:
  Builder(const FeatureWindow& window, const Intrinsics& intrinsics, const ReconstructionOptions& options,
          std::uint64_t seed)
      : window_(window),
        intrinsics_(intrinsics),
        options_(options),
        rng_(seed),
        pose_(static_cast<std::size_t>(window.num_views)),
        point_(static_cast<std::size_t>(window.num_tracks())) {
    for (const TrackObservation& o : window.observations) {
      Eigen::Vector3d bearing = Eigen::Vector3d::Zero();
      is_bearing_.push_back(intrinsics.Unproject({o.x_px, o.y_px}, &bearing));
      bearings_.push_back(bearing);
      tolerance_rad_.push_back(options.tolerance_px * SigmaOf(o) / intrinsics.focal_px);
    }
  }

  bool Build(Reconstruction* out) {
    if (!Found()) return false;
    while (PlaceNextView()) TriangulateTracks();
    return Collect(out);
  }

 private:
  // Observation of a track in a view, -1: none.
  int Find(int track, int view) const {
    for (int i = window_.track_begins[track]; i < window_.track_begins[track + 1]; ++i) {
      if (window_.observations[i].view == view) return is_bearing_[i] ? i : -1;
    }
    return -1;
  }

  std::vector<Pair> RankPairs() const {
    std::vector<Pair> pairs;
    for (int a = 0; a < window_.num_views; ++a) {
      for (int b = a + 1; b < window_.num_views; ++b) {
        std::vector<double> motions;
        for (int t = 0; t < window_.num_tracks(); ++t) {
          const int i = Find(t, a), j = Find(t, b);
          if (i < 0 || j < 0) continue;
          const TrackObservation &u = window_.observations[i], &v = window_.observations[j];
          motions.push_back(std::hypot(double{u.x_px} - v.x_px, double{u.y_px} - v.y_px));
        }
        if (static_cast<int>(motions.size()) < options_.min_points) continue;
        const auto middle = motions.begin() + static_cast<std::ptrdiff_t>(motions.size() / 2);
        std::nth_element(motions.begin(), middle, motions.end());
        const double reach = kFullMotion * 2.0 * std::max(intrinsics_.cx, 1.0);
        pairs.push_back({a, b, std::sqrt(static_cast<double>(motions.size())) * std::min(1.0, *middle / reach)});
      }
    }
    std::stable_sort(pairs.begin(), pairs.end(), [](const Pair& x, const Pair& y) { return x.score > y.score; });
    if (pairs.size() > kMaxPairs) pairs.resize(kMaxPairs);
    return pairs;
  }

  bool Found() {
    TwoViewRansac ransac(std::max(1, window_.num_tracks()));
    TwoViewRansac::Options options;
    options.max_iterations = 200;
    options.min_inliers = std::max(20, options_.min_points / 2);
    for (const Pair& pair : RankPairs()) {
      std::vector<Eigen::Vector3d> a, b;
      std::vector<double> tolerance;
      std::vector<int> tracks;
      for (int t = 0; t < window_.num_tracks(); ++t) {
        const int i = Find(t, pair.a), j = Find(t, pair.b);
        if (i < 0 || j < 0) continue;
        a.push_back(bearings_[i]);
        b.push_back(bearings_[j]);
        tolerance.push_back(std::hypot(tolerance_rad_[i], tolerance_rad_[j]));
        tracks.push_back(t);
      }
      TwoViewRansac::Estimate estimate;
      if (!ransac.Run(a, b, tolerance, options, rng_, &estimate)) continue;
      if (estimate.num_inliers < kMinPlacedShare * static_cast<double>(tracks.size())) continue;
      pose_[pair.a] = SE3();
      pose_[pair.b] = estimate.b_from_a;
      for (std::size_t k = 0; k < tracks.size(); ++k) {
        if (ransac.inliers()[k] && ransac.parallax_rad()[k] > kMinParallaxRad) {
          point_[tracks[k]] = ransac.points_in_a()[k];
        }
      }
      return true;
    }
    return false;
  }

  // The view that sees most points. False when none is left that can be placed.
  bool PlaceNextView() {
    std::vector<int> counts(static_cast<std::size_t>(window_.num_views), 0);
    for (int t = 0; t < window_.num_tracks(); ++t) {
      if (!point_[t]) continue;
      for (int i = window_.track_begins[t]; i < window_.track_begins[t + 1]; ++i) {
        counts[window_.observations[i].view] += is_bearing_[i];
      }
    }
    int best = -1;
    for (int v = 0; v < window_.num_views; ++v) {
      if (pose_[v] || is_given_up(v)) continue;
      if (best < 0 || counts[v] > counts[best]) best = v;
    }
    if (best < 0) return false;
    given_up_.push_back(best);  // unless it is placed now
    std::vector<Eigen::Vector3d> bearings, points;
    std::vector<double> tolerance;
    for (int t = 0; t < window_.num_tracks(); ++t) {
      const int i = point_[t] ? Find(t, best) : -1;
      if (i < 0) continue;
      bearings.push_back(bearings_[i]);
      points.push_back(*point_[t]);
      tolerance.push_back(1.5 * tolerance_rad_[i]);  // the points are not exact either
    }
    AbsolutePoseRansac ransac(std::max<int>(1, static_cast<int>(points.size())));
    AbsolutePoseRansac::Options options;
    options.min_inliers = std::max(15, options_.min_points / 3);
    AbsolutePoseRansac::Estimate estimate;
    if (ransac.Run(bearings, points, tolerance, options, rng_, &estimate) &&
        estimate.num_inliers >= kMinPlacedShare * static_cast<double>(points.size())) {
      pose_[best] = estimate.cam_from_world;
    }
    return true;
  }
  bool is_given_up(int view) const { return std::find(given_up_.begin(), given_up_.end(), view) != given_up_.end(); }

  // Every track without a point, from its first and last placed view.
  void TriangulateTracks() {
    for (int t = 0; t < window_.num_tracks(); ++t) {
      if (point_[t]) continue;
      int first = -1, last = -1;
      for (int i = window_.track_begins[t]; i < window_.track_begins[t + 1]; ++i) {
        if (!is_bearing_[i] || !pose_[window_.observations[i].view]) continue;
        if (first < 0) first = i;
        last = i;
      }
      if (first < 0 || first == last) continue;
      const SE3& a_from_world = *pose_[window_.observations[first].view];
      const SE3 b_from_a = *pose_[window_.observations[last].view] * a_from_world.Inverse();
      Triangulated triangulated;
      if (!TriangulateBearings(b_from_a, bearings_[first], bearings_[last], &triangulated)) continue;
      if (triangulated.cos_parallax > std::cos(kMinParallaxRad)) continue;
      const Eigen::Vector3d in_b = b_from_a * triangulated.point_in_a;
      if (!Agrees(first, triangulated.point_in_a) || !Agrees(last, in_b)) continue;
      point_[t] = a_from_world.Inverse() * triangulated.point_in_a;
    }
  }
  bool Agrees(int observation, const Eigen::Vector3d& point_in_cam) const {
    return bearings_[observation].cross(point_in_cam.normalized()).norm() < 1.5 * tolerance_rad_[observation] &&
           bearings_[observation].dot(point_in_cam) > 0.0;
  }

  bool Collect(Reconstruction* out) const {
    out->cam_from_world.clear();
    out->strains.clear();
    out->points.clear();
    out->observations.clear();
    std::vector<int> view_of(pose_.size(), -1);
    for (std::size_t v = 0; v < pose_.size(); ++v) {
      if (!pose_[v]) continue;
      view_of[v] = static_cast<int>(out->cam_from_world.size());
      out->cam_from_world.push_back(*pose_[v]);
      out->strains.push_back(StrainVector::Zero());
    }
    for (int t = 0; t < window_.num_tracks(); ++t) {
      if (!point_[t]) continue;
      std::vector<PointObservation> seen;
      for (int i = window_.track_begins[t]; i < window_.track_begins[t + 1]; ++i) {
        const TrackObservation& o = window_.observations[i];
        if (view_of[o.view] < 0 || !is_bearing_[i]) continue;
        if (!Agrees(i, *pose_[o.view] * *point_[t])) continue;
        seen.push_back({view_of[o.view], static_cast<int>(out->points.size()), {o.x_px, o.y_px}, SigmaOf(o)});
      }
      if (static_cast<int>(seen.size()) < kMinObservations) continue;
      out->points.push_back(*point_[t]);
      out->observations.insert(out->observations.end(), seen.begin(), seen.end());
    }
    return static_cast<int>(out->cam_from_world.size()) >= options_.min_views &&
           static_cast<int>(out->points.size()) >= options_.min_points;
  }

  const FeatureWindow& window_;
  const Intrinsics& intrinsics_;
  const ReconstructionOptions& options_;
  Rng rng_;
  std::vector<Eigen::Vector3d> bearings_;  // one an observation
  std::vector<std::uint8_t> is_bearing_;
  std::vector<double> tolerance_rad_;
  std::vector<std::optional<SE3>> pose_;               // cam_from_world of each view
  std::vector<std::optional<Eigen::Vector3d>> point_;  // in world, of each track
  std::vector<int> given_up_;
};

}  // namespace

Eigen::Matrix3d StrainMatrix(const StrainVector& s) {
  // An orthonormal basis.
  constexpr double kRoot2 = std::numbers::sqrt2;
  const double kRoot6 = kRoot2 * std::numbers::sqrt3;
  Eigen::Matrix3d m;
  m << s[0] / kRoot2 + s[1] / kRoot6, s[2] / kRoot2, s[3] / kRoot2,  //
      s[2] / kRoot2, -s[0] / kRoot2 + s[1] / kRoot6, s[4] / kRoot2,  //
      s[3] / kRoot2, s[4] / kRoot2, -2.0 * s[1] / kRoot6;
  return m;
}

bool Reconstruct(const FeatureWindow& window, const Intrinsics& intrinsics, const ReconstructionOptions& options,
                 std::uint64_t seed, Reconstruction* out) {
  if (window.num_tracks() < options.min_points || window.num_views < options.min_views) return false;
  return Builder(window, intrinsics, options, seed).Build(out);
}

int DropOutliers(const Intrinsics& intrinsics, double tolerance_px, Reconstruction* reconstruction) {
  Reconstruction kept;
  kept.cam_from_world = reconstruction->cam_from_world;
  kept.strains = reconstruction->strains;
  const std::vector<PointObservation>& all = reconstruction->observations;
  for (std::size_t begin = 0; begin < all.size();) {
    std::size_t end = begin;
    std::vector<PointObservation> seen;
    for (; end < all.size() && all[end].point == all[begin].point; ++end) {
      const PointObservation& o = all[end];
      Eigen::Vector2d pixel;
      if (!intrinsics.Project(PointInCamera(*reconstruction, o), &pixel, nullptr, nullptr)) continue;
      if ((pixel - o.pixel).norm() > tolerance_px * o.sigma_px) continue;
      seen.push_back(o);
      seen.back().point = static_cast<int>(kept.points.size());
    }
    if (static_cast<int>(seen.size()) >= kMinObservations) {
      kept.points.push_back(reconstruction->points[all[begin].point]);
      kept.observations.insert(kept.observations.end(), seen.begin(), seen.end());
    }
    begin = end;
  }
  *reconstruction = std::move(kept);
  return static_cast<int>(reconstruction->observations.size());
}

}  // namespace haustra::calibration
