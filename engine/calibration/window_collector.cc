#include "engine/calibration/window_collector.h"

#include <algorithm>
#include <cmath>
#include <numeric>
#include <span>
#include <utility>

#include "hal/core/median.h"

namespace haustra::calibration {
namespace {

constexpr int kLinkedViews = 3;            // earlier views that a view is matched with
constexpr std::size_t kNumRecent = 25;     // frames that say what is usual
constexpr float kMaxAngleRatio = 0.8f;     // Lowe 2004
constexpr double kMaxMotion = 0.25;        // of a match between linked views, share of the width
constexpr int kMinTrackLength = 3;         // two views of a point say nothing about the focal length
constexpr double kMinTrackMotionPx = 1.5;  // over the whole window: what stays is drawn on the screen

// Sets that are joined; the root is the smallest member.
class DisjointSets {
 public:
  explicit DisjointSets(std::size_t size) : parent_(size) { std::iota(parent_.begin(), parent_.end(), 0); }
  int Root(int i) {
    while (parent_[i] != i) {
      parent_[i] = parent_[parent_[i]];
      i = parent_[i];
    }
    return i;
  }
  void Join(int a, int b) {
    a = Root(a);
    b = Root(b);
    parent_[std::max(a, b)] = std::min(a, b);
  }

 private:
  std::vector<int> parent_;
};

}  // namespace

WindowCollector::WindowCollector(VisionDevice& device, int width_px, const CollectorOptions& options)
    : device_(device), width_px_(width_px), options_(options) {
  matches_.resize(static_cast<std::size_t>(device.plan().max_features));
}

WindowCollector::~WindowCollector() {
  for (const View& view : views_) device_.ReleaseFeatureSet(view.set);
}

Status WindowCollector::Extract(const ImageView& image, View* view) {
  HAUSTRA_ASSIGN(view->set, device_.CreateFeatureSet());
  view->keypoints.resize(static_cast<std::size_t>(device_.plan().max_features));
  std::int32_t num = 0;
  ExtractRequest request;
  request.image = image;
  request.set = view->set;
  request.keypoints = view->keypoints;
  request.num_keypoints = &num;
  const Status status = ExtractAndWait(device_, Lane::kTracking, request);
  if (!status.ok()) device_.ReleaseFeatureSet(view->set);
  view->keypoints.resize(static_cast<std::size_t>(std::max(0, num)));
  return status;
}

Status WindowCollector::MatchTo(const View& earlier, const View& view, std::vector<Link>* links) {
  std::int32_t num = 0;
  const float reach = static_cast<float>(kMaxMotion * width_px_);
  const DisparityWindow disparity{reach, reach};
  MatchRequest request;
  request.query = DescriptorList::Whole(view.set);
  request.train = DescriptorList::Whole(earlier.set);
  request.options.max_angle_ratio = kMaxAngleRatio;
  request.options.mutual = true;
  request.disparity = &disparity;
  request.matches = matches_;
  request.num_matches = &num;
  HAUSTRA_TRY(MatchAndWait(device_, Lane::kTracking, request));
  links->clear();
  for (int i = 0; i < num; ++i) links->push_back({matches_[i].train, matches_[i].query});
  return Status::Ok();
}

double WindowCollector::MedianMotion(const View& earlier, const View& view, const std::vector<Link>& links) const {
  std::vector<double> motions;
  for (const Link& link : links) {
    const Keypoint& a = earlier.keypoints[link.earlier_feature];
    const Keypoint& b = view.keypoints[link.feature];
    motions.push_back(std::hypot(double{a.x_px} - b.x_px, double{a.y_px} - b.y_px));
  }
  return UpperMedian(std::span<double>(motions)) / width_px_;
}

bool WindowCollector::IsPoor(int num_features) {
  std::vector<double> recent(recent_features_.begin(), recent_features_.end());
  const double usual = UpperMedian(std::span<double>(recent));
  recent_features_.push_back(num_features);
  if (recent_features_.size() > kNumRecent) recent_features_.erase(recent_features_.begin());
  return num_features < options_.min_features || num_features < options_.min_feature_share * usual;
}

Status WindowCollector::Add(std::uint32_t frame_index, const ImageView& image) {
  ++counters_.num_frames;
  View view;
  view.frame_index = frame_index;
  HAUSTRA_TRY(Extract(image, &view));
  const bool is_poor = IsPoor(static_cast<int>(view.keypoints.size()));
  counters_.num_poor += is_poor;
  view.looked_at = counters_.num_frames;
  if (!views_.empty() && view.looked_at - views_.front().looked_at > options_.max_frames_of_window) Overlap();
  if (views_.empty() && !is_poor) return Promote(std::move(view), {});

  std::vector<Link> links;
  if (!is_poor) {
    if (const Status status = MatchTo(views_.back(), view, &links); !status.ok()) {
      device_.ReleaseFeatureSet(view.set);
      return status;
    }
  }
  if (static_cast<int>(links.size()) < options_.min_matches) {
    counters_.num_unmatched += !is_poor;
    if (!views_.empty() && ++num_lost_ > options_.max_frames_lost) {
      Interrupt();
      if (!is_poor) return Promote(std::move(view), {});
    }
    device_.ReleaseFeatureSet(view.set);
    return Status::Ok();
  }
  num_lost_ = 0;
  const double motion = MedianMotion(views_.back(), view, links);
  counters_.max_motion = std::max(counters_.max_motion, motion);
  if (motion >= options_.view_motion) return Promote(std::move(view), std::move(links));
  device_.ReleaseFeatureSet(view.set);
  return Status::Ok();
}

Status WindowCollector::Promote(View view, std::vector<Link> links_to_last) {
  Status status;
  if (!views_.empty()) {
    view.links.push_back(std::move(links_to_last));
    for (int back = 2; back <= kLinkedViews && back <= static_cast<int>(views_.size()) && status.ok(); ++back) {
      std::vector<Link> links;
      status = MatchTo(views_[views_.size() - static_cast<std::size_t>(back)], view, &links);
      view.links.push_back(std::move(links));
    }
  }
  views_.push_back(std::move(view));
  has_new_view_ = true;
  if (status.ok() && static_cast<int>(views_.size()) >= options_.max_views) Overlap();
  return status;
}

void WindowCollector::EmitWindow() {
  if (!has_new_view_ || static_cast<int>(views_.size()) < options_.min_views) return;
  FeatureWindow window = JoinTracks();
  if (window.num_tracks() > 0) windows_.push_back(std::move(window));
  has_new_view_ = false;
}

void WindowCollector::DropViews(std::size_t count) {
  for (std::size_t i = 0; i < count; ++i) device_.ReleaseFeatureSet(views_[i].set);
  views_.erase(views_.begin(), views_.begin() + static_cast<std::ptrdiff_t>(count));
  for (std::size_t v = 0; v < views_.size(); ++v) {
    if (views_[v].links.size() > v) views_[v].links.resize(v);
  }
}

void WindowCollector::Overlap() {
  EmitWindow();
  DropViews((views_.size() + 1) / 2);
}

void WindowCollector::Interrupt() {
  EmitWindow();
  DropViews(views_.size());
  num_lost_ = 0;
}

FeatureWindow WindowCollector::JoinTracks() const {
  std::vector<int> begin(views_.size() + 1, 0);
  for (std::size_t v = 0; v < views_.size(); ++v) {
    begin[v + 1] = begin[v] + static_cast<int>(views_[v].keypoints.size());
  }
  DisjointSets sets(static_cast<std::size_t>(begin.back()));
  for (std::size_t v = 0; v < views_.size(); ++v) {
    for (std::size_t back = 0; back < views_[v].links.size(); ++back) {
      const std::size_t earlier = v - 1 - back;
      for (const Link& link : views_[v].links[back]) {
        sets.Join(begin[earlier] + link.earlier_feature, begin[v] + link.feature);
      }
    }
  }
  // Members in order of root, then of view: roots are the smallest members, so a counting pass keeps both orders.
  std::vector<std::vector<int>> members(static_cast<std::size_t>(begin.back()));
  for (int i = 0; i < begin.back(); ++i) members[sets.Root(i)].push_back(i);

  FeatureWindow window;
  window.first_frame = views_.front().frame_index;
  window.last_frame = views_.back().frame_index;
  window.num_views = static_cast<int>(views_.size());
  for (const std::vector<int>& track : members) {
    if (static_cast<int>(track.size()) < kMinTrackLength) continue;
    std::vector<TrackObservation> seen;
    bool is_one_point = true;
    double motion = 0.0;
    int view = 0;
    for (const int member : track) {
      while (member >= begin[view + 1]) ++view;
      is_one_point = is_one_point && (seen.empty() || seen.back().view != view);
      const Keypoint& k = views_[view].keypoints[member - begin[view]];
      seen.push_back({view, k.x_px, k.y_px, k.scale_px});
      motion = std::max(motion, std::hypot(double{k.x_px} - seen[0].x_px, double{k.y_px} - seen[0].y_px));
    }
    if (!is_one_point || motion < kMinTrackMotionPx) continue;
    window.track_begins.push_back(static_cast<std::int32_t>(window.observations.size()));
    window.observations.insert(window.observations.end(), seen.begin(), seen.end());
  }
  if (!window.track_begins.empty())
    window.track_begins.push_back(static_cast<std::int32_t>(window.observations.size()));
  return window;
}

}  // namespace haustra::calibration
