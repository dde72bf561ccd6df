#include "tools/evaluate/path_segments.h"

#include <cmath>
#include <map>

#include "tools/evaluate/trajectory_error.h"

namespace haustra::evaluate {
namespace {

// Squared errors of some frames.
struct Sum {
  double squared = 0.0;
  std::size_t count = 0;
  std::optional<double> rms() const {
    if (count == 0) return std::nullopt;
    return std::sqrt(squared / static_cast<double>(count));
  }
};

// Errors of a stretch, whose localised frames are given by map.
void Finish(const std::map<int, std::vector<PosePair>>& parts, const std::map<int, Sim3>& truth_from_map,
            SegmentEvaluation* segment) {
  Sum together, own;
  for (const auto& [map_id, pairs] : parts) {
    segment->localised += pairs.size();
    if (const auto sim3 = truth_from_map.find(map_id); sim3 != truth_from_map.end()) {
      for (const PosePair& pair : pairs) {
        together.squared += (sim3->second * pair.estimated.translation - pair.truth.translation).squaredNorm();
      }
      together.count += pairs.size();
    }
    if (const std::optional<Alignment> alignment = Align(pairs)) {
      own.squared += alignment->squared_error;
      own.count += alignment->count;
    }
  }
  segment->rms_ate = together.rms();
  segment->rms_own = own.rms();
  segment->own_frames = own.count;
}

}  // namespace

std::vector<SegmentEvaluation> EvaluateSegments(const std::vector<EvaluatedFrame>& frames,
                                                const std::vector<MapEvaluation>& maps, double length) {
  std::map<int, Sim3> truth_from_map;
  for (const MapEvaluation& map : maps) {
    if (map.truth_from_map) truth_from_map.emplace(map.map_id, *map.truth_from_map);
  }
  std::vector<SegmentEvaluation> segments;
  std::map<int, std::vector<PosePair>> parts;
  double travelled = 0.0;
  const SE3* before = nullptr;
  for (const EvaluatedFrame& frame : frames) {
    if (!frame.truth) continue;
    if (before != nullptr) travelled += (frame.truth->translation - before->translation).norm();
    before = &*frame.truth;
    const double begin = length * std::floor(travelled / length);
    if (segments.empty() || begin > segments.back().begin) {
      if (!segments.empty()) Finish(parts, truth_from_map, &segments.back());
      parts.clear();
      segments.push_back({});
      segments.back().begin = begin;
    }
    ++segments.back().frames;
    if (frame.is_localised()) parts[frame.map_id].push_back(frame.pair());
  }
  if (!segments.empty()) Finish(parts, truth_from_map, &segments.back());
  return segments;
}

}  // namespace haustra::evaluate
