#include "engine/io/saved_atlas.h"

#include <algorithm>
#include <cmath>
#include <string>

#include "engine/atlas/mark.h"
#include "engine/camera/camera_model.h"
#include "engine/io/atlas_format.h"

namespace haustra {
namespace {

constexpr double kUnitTolerance = 1e-6;
// A keypoint lies in the image; extractors that begin on a doubled image may find one half a pixel outside.
constexpr float kImageMarginPx = 1.0f;
constexpr std::int32_t kMinOctave = -4, kMaxOctave = 32;

bool IsFinite(const SE3& pose) { return pose.rotation.coeffs().allFinite() && pose.translation.allFinite(); }

bool IsUnit(const SE3& pose) { return std::abs(pose.rotation.norm() - 1.0) <= kUnitTolerance; }

bool IsScale(double scale) { return std::isfinite(scale) && scale > 0.0; }

bool IsObservation(const SavedPoint& point, const SavedObservation& descriptor) {
  return std::any_of(point.observations.begin(), point.observations.end(), [&](const SavedObservation& o) {
    return o.keyframe_idx == descriptor.keyframe_idx && o.feature_idx == descriptor.feature_idx;
  });
}

class Checker {
 public:
  explicit Checker(const SavedAtlas& atlas) : atlas_(atlas) {}

  Status Check() {
    HAUSTRA_TRY(CheckIdentity());
    HAUSTRA_TRY(CheckMaps());
    HAUSTRA_TRY(CheckKeyframes());
    HAUSTRA_TRY(CheckPoints());
    HAUSTRA_TRY(CheckTraces());
    return CheckMarks();
  }

 private:
  static Status Bad(std::string_view section, std::uint64_t offset, const std::string& what) {
    return DataLoss(AtlasFilePlace(section, offset) + what);
  }

  Status CheckIdentity() const {
    const Result<CameraModel> camera = CameraModel::Create(atlas_.camera);
    if (!camera.ok()) return Bad(kIdentityTag, 0, camera.status().message());
    const double rate = atlas_.camera.rate_hz;
    if (!std::isfinite(rate) || rate < 0) return Bad(kIdentityTag, 0, "frame rate " + std::to_string(rate));
    return Status::Ok();
  }

  // Ids strictly ascending and below their counter.
  template <typename Saved>
  Status CheckIds(std::string_view section, const char* what, const std::vector<Saved>& list,
                  std::uint32_t next_id) const {
    for (std::size_t i = 0; i < list.size(); ++i) {
      const std::string name = std::string(what) + " " + std::to_string(list[i].id);
      if (list[i].id >= next_id || list[i].id == kNoId) {
        return Bad(section, list[i].offset, name + ": ids end at " + std::to_string(next_id));
      }
      if (i > 0 && list[i].id <= list[i - 1].id) {
        return Bad(section, list[i].offset,
                   name + " comes after " + std::to_string(list[i - 1].id) + ": doubled or out of order");
      }
    }
    return Status::Ok();
  }

  Status CheckMaps() {
    num_keyframes_.assign(atlas_.maps.size(), 0);
    return CheckIds(kMapsTag, "map", atlas_.maps, atlas_.counters.next_map_id);
  }

  Status CheckKeyframes() {
    HAUSTRA_TRY(CheckIds(kKeyframeTag, "keyframe", atlas_.keyframes, atlas_.counters.next_keyframe_id));
    for (const SavedKeyframe& keyframe : atlas_.keyframes) {
      const auto bad = [&](const std::string& what) {
        return Bad(kKeyframeTag, keyframe.offset, "keyframe " + std::to_string(keyframe.id) + ": " + what);
      };
      if (keyframe.session >= atlas_.counters.session) {
        return bad("session " + std::to_string(keyframe.session) + " of " + std::to_string(atlas_.counters.session));
      }
      if (keyframe.map_idx >= atlas_.maps.size()) {
        return bad("map " + std::to_string(keyframe.map_idx) + " of " + std::to_string(atlas_.maps.size()));
      }
      if (!IsFinite(keyframe.cam_from_map)) return bad("pose is not finite");
      if (!IsUnit(keyframe.cam_from_map)) return bad("rotation is not a unit quaternion");
      if (!IsScale(keyframe.scale)) return bad("scale " + std::to_string(keyframe.scale));
      if (!keyframe.descriptors.empty() && keyframe.descriptors.size() != keyframe.keypoints.size() * kDescriptorBytes)
        return bad("as many descriptors as keypoints expected");
      for (std::size_t i = 0; i < keyframe.keypoints.size(); ++i) {
        if (!IsKeypoint(keyframe.keypoints[i])) {
          return bad("keypoint " + std::to_string(i) + " is not one of this camera's image");
        }
      }
      ++num_keyframes_[keyframe.map_idx];
    }
    for (std::size_t i = 0; i < num_keyframes_.size(); ++i) {
      if (num_keyframes_[i] != 0) continue;
      return Bad(kMapsTag, atlas_.maps[i].offset, "map " + std::to_string(atlas_.maps[i].id) + " has no keyframes");
    }
    return Status::Ok();
  }

  bool IsKeypoint(const Keypoint& k) const {
    // Comparisons that a NaN fails.
    return k.x_px >= -kImageMarginPx && k.x_px <= static_cast<float>(atlas_.camera.width_px) - 1 + kImageMarginPx &&
           k.y_px >= -kImageMarginPx && k.y_px <= static_cast<float>(atlas_.camera.height_px) - 1 + kImageMarginPx &&
           k.scale_px > 0.0f && std::isfinite(k.scale_px) && std::isfinite(k.angle_rad) && std::isfinite(k.response) &&
           k.octave >= kMinOctave && k.octave <= kMaxOctave;
  }

  bool IsFeature(const SavedObservation& o) const {
    return o.keyframe_idx < atlas_.keyframes.size() && o.feature_idx >= 0 &&
           static_cast<std::size_t>(o.feature_idx) < atlas_.keyframes[o.keyframe_idx].keypoints.size();
  }

  Status CheckPoints() const {
    HAUSTRA_TRY(CheckIds(kPointsTag, "point", atlas_.points, atlas_.counters.next_point_id));
    std::vector<std::vector<bool>> is_taken;  // by keyframe and feature
    for (const SavedKeyframe& keyframe : atlas_.keyframes) is_taken.emplace_back(keyframe.keypoints.size(), false);
    for (const SavedPoint& point : atlas_.points) {
      const auto bad = [&](const std::string& what) {
        return Bad(kPointsTag, point.offset, "point " + std::to_string(point.id) + ": " + what);
      };
      if (point.map_idx >= atlas_.maps.size()) {
        return bad("map " + std::to_string(point.map_idx) + " of " + std::to_string(atlas_.maps.size()));
      }
      if (!point.position.allFinite()) return bad("position is not finite");
      const double length = point.normal.norm();
      if (!(length == 0.0 || std::abs(length - 1.0) <= kUnitTolerance)) return bad("normal is not a unit vector");
      if (!std::isfinite(point.scale_times_distance) || point.scale_times_distance < 0) return bad("size is no size");
      if (point.first_keyframe_id >= atlas_.counters.next_keyframe_id) {
        return bad("made by keyframe " + std::to_string(point.first_keyframe_id) + ", which never was");
      }
      if (!IsFeature(point.descriptor)) return bad("its descriptor is that of no feature");
      if (point.observations.size() < 2) return bad("fewer than two observations");
      for (std::size_t i = 0; i < point.observations.size(); ++i) {
        const SavedObservation& o = point.observations[i];
        const std::string name = "observation " + std::to_string(i) + " ";
        if (!IsFeature(o)) return bad(name + "is that of no feature");
        if (atlas_.keyframes[o.keyframe_idx].map_idx != point.map_idx) return bad(name + "is from another map");
        for (std::size_t j = 0; j < i; ++j) {
          if (point.observations[j].keyframe_idx == o.keyframe_idx) return bad(name + "is from a keyframe seen before");
        }
        if (is_taken[o.keyframe_idx][static_cast<std::size_t>(o.feature_idx)]) {
          return bad(name + "is of a feature that shows another point");
        }
        is_taken[o.keyframe_idx][static_cast<std::size_t>(o.feature_idx)] = true;
      }
      if (!IsObservation(point, point.descriptor)) return bad("its descriptor is that of no observer");
    }
    return Status::Ok();
  }

  Status CheckTraces() const {
    HAUSTRA_TRY(CheckIds(kTracesTag, "trace of keyframe", atlas_.traces, atlas_.counters.next_keyframe_id));
    const auto find = [](const auto& list, KeyframeId id) {
      const auto at =
          std::lower_bound(list.begin(), list.end(), id, [](const auto& a, KeyframeId b) { return a.id < b; });
      return at != list.end() && at->id == id ? at - list.begin() : -1;
    };
    std::vector<std::uint8_t> is_ended(atlas_.traces.size(), 0);  // its chain is known to reach a keyframe
    std::vector<std::ptrdiff_t> chain;
    for (std::size_t i = 0; i < atlas_.traces.size(); ++i) {
      const SavedTrace& trace = atlas_.traces[i];
      const auto bad = [&](const std::string& what) {
        return Bad(kTracesTag, trace.offset, "trace of keyframe " + std::to_string(trace.id) + ": " + what);
      };
      if (find(atlas_.keyframes, trace.id) >= 0) return bad("the keyframe is there");
      if (trace.session >= atlas_.counters.session) {
        return bad("session " + std::to_string(trace.session) + " of " + std::to_string(atlas_.counters.session));
      }
      if (!IsFinite(trace.cam_from_stand_in)) return bad("pose is not finite");
      if (!IsUnit(trace.cam_from_stand_in)) return bad("rotation is not a unit quaternion");
      if (!IsScale(trace.stand_in_scale) || !IsScale(trace.scale)) return bad("scale is not positive");
      chain.assign(1, static_cast<std::ptrdiff_t>(i));
      while (is_ended[static_cast<std::size_t>(chain.back())] == 0) {
        const KeyframeId next = atlas_.traces[static_cast<std::size_t>(chain.back())].stand_in;
        if (find(atlas_.keyframes, next) >= 0) break;
        const std::ptrdiff_t at = find(atlas_.traces, next);
        if (at < 0) return bad("stand-in " + std::to_string(next) + " is neither keyframe nor trace");
        chain.push_back(at);
        if (chain.size() > atlas_.traces.size()) return bad("its stand-ins go round in a circle");
      }
      for (const std::ptrdiff_t at : chain) is_ended[static_cast<std::size_t>(at)] = 1;
    }
    return Status::Ok();
  }

  Status CheckMarks() const {
    if (atlas_.marks.size() > static_cast<std::size_t>(kMaxMarks)) {
      return Bad(
          kMarksTag, 0,
          std::to_string(atlas_.marks.size()) + " marks, at most " + std::to_string(kMaxMarks) + " are possible");
    }
    HAUSTRA_TRY(CheckIds(kMarksTag, "mark", atlas_.marks, atlas_.counters.next_mark_id));
    for (std::size_t i = 0; i < atlas_.marks.size(); ++i) {
      const SavedMark& mark = atlas_.marks[i];
      const auto bad = [&](const std::string& what) {
        return Bad(kMarksTag, mark.offset, "mark " + std::to_string(mark.id) + ": " + what);
      };
      if (!MarkLabel::From(mark.label.view())) return bad("its label is none");
      for (std::size_t j = 0; j < i; ++j) {
        if (atlas_.marks[j].label == mark.label) return bad("another mark has its label");
      }
      if (mark.session >= atlas_.counters.session) {
        return bad("session " + std::to_string(mark.session) + " of " + std::to_string(atlas_.counters.session));
      }
      if (mark.keyframe_idx >= atlas_.keyframes.size()) {
        return bad("keyframe " + std::to_string(mark.keyframe_idx) + " of " + std::to_string(atlas_.keyframes.size()));
      }
      if (!mark.point_in_anchor.allFinite()) return bad("position is not finite");
      if (!(std::abs(mark.normal_in_anchor.norm() - 1.0) <= kUnitTolerance)) return bad("normal is not a unit vector");
      if (!IsScale(mark.radius) || !IsScale(mark.scale)) return bad("scale is not positive");
    }
    return Status::Ok();
  }

  const SavedAtlas& atlas_;
  std::vector<int> num_keyframes_;  // by map
};

}  // namespace

int SavedAtlas::max_features() const {
  std::size_t max = 0;
  for (const SavedKeyframe& keyframe : keyframes) max = std::max(max, keyframe.keypoints.size());
  return static_cast<int>(max);
}

std::string AtlasFilePlace(std::string_view section, std::uint64_t offset) {
  return "atlas file, section '" + std::string(section) + "'" +
         (offset == 0 ? std::string() : " at byte " + std::to_string(offset)) + ": ";
}

Status CheckSavedAtlas(const SavedAtlas& atlas) { return Checker(atlas).Check(); }

void RenumberKeyframes(SavedAtlas* atlas) {
  std::vector<SavedKeyframe>& keyframes = atlas->keyframes;
  for (SavedPoint& point : atlas->points) {
    const auto by = std::lower_bound(keyframes.begin(), keyframes.end(), point.first_keyframe_id,
                                     [](const SavedKeyframe& keyframe, KeyframeId id) { return keyframe.id < id; });
    point.first_keyframe_id =
        std::min(static_cast<KeyframeId>(by - keyframes.begin()), static_cast<KeyframeId>(keyframes.size()) - 1);
  }
  for (std::size_t i = 0; i < keyframes.size(); ++i) keyframes[i].id = static_cast<KeyframeId>(i);
  atlas->traces.clear();
  atlas->counters.next_keyframe_id = static_cast<KeyframeId>(keyframes.size());
}

}  // namespace haustra
