#include "tools/view/live_marks.h"

#include <algorithm>
#include <cmath>
#include <nlohmann/json.hpp>
#include <span>
#include <string>

namespace haustra::view {
namespace {

using Json = nlohmann::ordered_json;

std::span<const haustra_mark_sighting> SightingsOf(const haustra_pose& pose) {
  return {pose.marks, std::min(pose.num_marks, HAUSTRA_MAX_MARKS)};
}

double Rounded(float value, double steps) { return std::round(steps * static_cast<double>(value)) / steps; }

}  // namespace

Json MarksJson(const haustra_snapshot& snapshot) {
  Json marks = Json::array();
  for (const haustra_mark& mark : std::span(snapshot.marks, std::min(snapshot.num_marks, HAUSTRA_MAX_MARKS))) {
    marks.push_back({{"id", mark.id},
                     {"label", std::string(mark.label, strnlen(mark.label, sizeof mark.label))},
                     {"map", mark.map_id},
                     {"position", mark.position_mu}});
  }
  return marks;
}

Json SightingsJson(const haustra_pose& pose) {
  Json marks = Json::array();
  for (const haustra_mark_sighting& mark : SightingsOf(pose)) {
    marks.push_back({{"id", mark.id},
                     {"state", haustra_mark_state_name(mark.state)},
                     {"distance", Rounded(mark.distance_in_depths, 100.0)}});
  }
  return marks;
}

Json DrawnMarksJson(const haustra_pose& pose, std::uint32_t step) {
  Json marks = Json::array();
  for (const haustra_mark_sighting& mark : SightingsOf(pose)) {
    if (mark.state != HAUSTRA_MARK_IN_FRONT && mark.state != HAUSTRA_MARK_UNSURE) continue;
    marks.push_back({{"id", mark.id},
                     {"state", haustra_mark_state_name(mark.state)},
                     {"x", Rounded(mark.u_px / static_cast<float>(step), 10.0)},
                     {"y", Rounded(mark.v_px / static_cast<float>(step), 10.0)}});
  }
  return marks;
}

bool FindPose(const haustra_ring& ring, std::uint64_t frame_index, std::uint64_t procedure, haustra_pose* pose) {
  std::uint64_t sequence = haustra_ring_newest_pose(&ring);
  for (; haustra_ring_read_pose(&ring, sequence, pose) == HAUSTRA_OK; --sequence) {
    if (pose->procedure != procedure || pose->frame_index < frame_index) return false;
    if (pose->frame_index == frame_index) return true;
  }
  return false;
}

}  // namespace haustra::view
