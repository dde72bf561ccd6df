#include "tools/evaluate/join_judge.h"

#include <algorithm>
#include <cmath>
#include <map>
#include <tuple>

#include "engine/geometry/constants.h"
#include "tools/evaluate/shared_view.h"

namespace haustra::evaluate {
namespace {

constexpr std::size_t kMaxPairViews = 300;  // of each part that are compared for nearness
constexpr std::size_t kNumNearestPairs = 15;
constexpr const char* kRecovered = "recovered";  // no event of a run: made of its frames

using Part = std::vector<const EvaluatedFrame*>;

struct Parts {
  Part first, second;
};

// --- Which frames a join has joined.

Parts MergeParts(const std::vector<EvaluatedFrame>& frames, const RunEventRow& event, MapGroups& groups) {
  const std::set<int> first = groups.Of(event.map_id), second = groups.Of(event.other_map_id);
  Parts parts;
  for (const EvaluatedFrame& frame : frames) {
    if (frame.frame_idx > event.frame_idx) break;
    if (first.contains(frame.live_map_id)) parts.first.push_back(&frame);
    if (second.contains(frame.live_map_id)) parts.second.push_back(&frame);
  }
  return parts;
}

Parts RelocalisationParts(const std::vector<EvaluatedFrame>& frames, const RunEventRow& event, MapGroups& groups) {
  const std::set<int>& map = groups.Of(event.map_id);
  Parts parts;
  for (const EvaluatedFrame& frame : frames) {
    const bool is_in_map = map.contains(frame.live_map_id);
    if (frame.frame_idx < event.frame_idx) {
      if (is_in_map) parts.first.push_back(&frame);
    } else if (is_in_map) {
      parts.second.push_back(&frame);
    } else {
      break;
    }
  }
  return parts;
}

Parts LoopParts(const std::vector<EvaluatedFrame>& frames, const RunEventRow& event, MapGroups& groups) {
  const std::set<int>& map = groups.Of(event.map_id);
  Part all;
  std::size_t met_again = 0;
  bool is_met_again_known = false;
  for (const EvaluatedFrame& frame : frames) {
    if (frame.frame_idx > event.frame_idx || !map.contains(frame.live_map_id)) continue;
    if (!is_met_again_known && event.other_keyframe_id && frame.keyframe_id == *event.other_keyframe_id) {
      met_again = all.size();
      is_met_again_known = true;
    }
    all.push_back(&frame);
  }
  const auto third = static_cast<std::ptrdiff_t>((all.size() - met_again) / 3);
  return {Part(all.begin(), all.begin() + static_cast<std::ptrdiff_t>(met_again) + third),
          Part(all.end() - third, all.end())};
}

// Frames that can be judged: with a true pose and a final one, in the map where most of the joined frames are at the
// end.
void KeepJudgeable(Parts* parts) {
  std::map<int, std::size_t> frames_in_map;
  for (const Part* part : {&parts->first, &parts->second}) {
    for (const EvaluatedFrame* frame : *part) {
      if (frame->is_localised() && frame->truth) ++frames_in_map[frame->map_id];
    }
  }
  int map_id = -1;
  std::size_t most = 0;
  for (const auto& [id, count] : frames_in_map) {
    if (count > most) {
      map_id = id;
      most = count;
    }
  }
  const auto is_useless = [&](const EvaluatedFrame* frame) { return frame->map_id != map_id || !frame->truth; };
  std::erase_if(parts->first, is_useless);
  std::erase_if(parts->second, is_useless);
}

// --- How well they fit together.

std::vector<PosePair> PairsOf(const Part& part) {
  std::vector<PosePair> pairs;
  for (const EvaluatedFrame* frame : part) pairs.push_back(frame->pair());
  return pairs;
}

double MedianDepth(const Parts& parts) {
  std::vector<double> depths;
  for (const Part* part : {&parts.first, &parts.second}) {
    for (const EvaluatedFrame* frame : *part) {
      if (frame->depth > 0.0) depths.push_back(frame->depth);
    }
  }
  return depths.empty() ? 0.0 : Median(std::move(depths));
}

// At most kMaxPairViews frames, evenly over the part.
Part Thinned(const Part& part) {
  const std::size_t step = (part.size() + kMaxPairViews - 1) / kMaxPairViews;
  Part thinned;
  for (std::size_t i = 0; i < part.size(); i += step) thinned.push_back(part[i]);
  return thinned;
}

struct FramePair {
  double remoteness = 0.0;
  const EvaluatedFrame* first = nullptr;
  const EvaluatedFrame* second = nullptr;
};

// One depth of distance counts as much as 45 degrees between the axes.
std::vector<FramePair> NearestPairs(const Parts& parts, double depth, bool positions_only) {
  std::vector<FramePair> pairs;
  for (const EvaluatedFrame* a : Thinned(parts.first)) {
    for (const EvaluatedFrame* b : Thinned(parts.second)) {
      double remoteness = (a->truth->translation - b->truth->translation).norm() / depth;
      if (!positions_only) remoteness += AxisAngleDeg(*a->truth, *b->truth) / kMaxSharedAngleDeg;
      pairs.push_back({remoteness, a, b});
    }
  }
  const std::size_t count = std::min(kNumNearestPairs, pairs.size());
  std::partial_sort(pairs.begin(), pairs.begin() + count, pairs.end(), [](const FramePair& x, const FramePair& y) {
    return std::tuple(x.remoteness, x.first->frame_idx, x.second->frame_idx) <
           std::tuple(y.remoteness, y.first->frame_idx, y.second->frame_idx);
  });
  pairs.resize(count);
  return pairs;
}

void CompareRelativePoses(const Parts& parts, double scale, double depth, const JoinOptions& options,
                          JoinEvaluation* join) {
  std::vector<double> rotations_deg, translations;
  for (const FramePair& pair : NearestPairs(parts, depth, options.positions_only)) {
    const SE3 estimated = pair.first->estimated.Inverse() * pair.second->estimated;
    const SE3 truth = pair.first->truth->Inverse() * *pair.second->truth;
    rotations_deg.push_back(RotationAngle(estimated.rotation, truth.rotation) * kDegPerRad);
    if (options.positions_only) {
      translations.push_back(std::abs(scale * estimated.translation.norm() - truth.translation.norm()) / depth);
    } else {
      translations.push_back((scale * estimated.translation - truth.translation).norm() / depth);
    }
  }
  if (!options.positions_only) join->rotation_error_deg = Median(std::move(rotations_deg));
  join->translation_error_depths = Median(std::move(translations));
}

// What alignment by floating point leaves of errors that are none: the ratio of two such numbers says nothing.
double RoundingOf(const std::vector<PosePair>& pairs) {
  constexpr double kRelative = 1e-9;
  double extent = 0.0;
  for (const PosePair& pair : pairs) {
    extent = std::max(extent, (pair.truth.translation - pairs[0].truth.translation).norm());
  }
  return kRelative * extent;
}

void Refuse(const std::string& reason, JoinEvaluation* join) {
  join->verdict = Verdict::kFalse;
  join->reason += join->reason.empty() ? reason : "; " + reason;
}

void Judge(Parts parts, const JoinOptions& options, JoinEvaluation* join) {
  KeepJudgeable(&parts);
  if (parts.first.empty() || parts.second.empty()) {
    join->reason = "one part has no frame with a final and a true pose";
    return;
  }
  const std::vector<PosePair> first = PairsOf(parts.first), second = PairsOf(parts.second);
  std::vector<PosePair> both = first;
  both.insert(both.end(), second.begin(), second.end());
  const std::optional<Alignment> first_alone = Align(first), second_alone = Align(second), joined = Align(both);
  const double depth = MedianDepth(parts);

  if (joined && (first_alone || second_alone)) {
    double squared_error = 0.0;
    std::size_t count = 0;
    for (const auto& alone : {first_alone, second_alone}) {
      if (!alone) continue;
      squared_error += alone->squared_error;
      count += alone->count;
    }
    join->ate_parts = std::sqrt(squared_error / static_cast<double>(count));
    join->ate_joined = joined->rms();
    if (depth > 0.0) join->ate_joined_depths = *join->ate_joined / depth;
  }
  const bool first_is_scale = first_alone && (!second_alone || first.size() >= second.size());
  const std::optional<Alignment>& measure = first_is_scale ? first_alone : second_alone;
  if (depth > 0.0 && measure) CompareRelativePoses(parts, measure->truth_from_map.scale, depth, options, join);

  if (!join->ate_joined && !join->translation_error_depths) {
    join->reason = "both parts are too short, or on a line";
    return;
  }
  join->verdict = Verdict::kTrue;
  const bool is_small = join->ate_joined_depths && *join->ate_joined_depths <= options.min_ate_depths;
  if (join->ate_joined && !is_small &&
      *join->ate_joined > options.max_ate_ratio * *join->ate_parts + RoundingOf(both)) {
    Refuse("the parts do not fit one Sim(3)", join);
  }
  if (join->rotation_error_deg && *join->rotation_error_deg > options.max_rotation_deg) {
    Refuse("relative rotation is wrong", join);
  }
  if (join->translation_error_depths && *join->translation_error_depths > options.max_translation_depths) {
    Refuse("relative position is wrong", join);
  }
}

// Events and recoveries, by frame; within a frame the events come first.
std::vector<RunEventRow> WithRecoveries(const std::vector<EvaluatedFrame>& frames, std::vector<RunEventRow> events) {
  bool was_recovered = false;
  for (const EvaluatedFrame& frame : frames) {
    const bool is_recovered = frame.is_recovered && frame.live_map_id >= 0;
    if (is_recovered && !was_recovered) {
      RunEventRow row;
      row.frame_idx = frame.frame_idx;
      row.event = kRecovered;
      row.map_id = frame.live_map_id;
      events.push_back(std::move(row));
    }
    was_recovered = is_recovered;
  }
  std::stable_sort(events.begin(), events.end(),
                   [](const RunEventRow& a, const RunEventRow& b) { return a.frame_idx < b.frame_idx; });
  return events;
}

}  // namespace

std::vector<JoinEvaluation> JudgeJoins(const std::vector<EvaluatedFrame>& frames,
                                       const std::vector<RunEventRow>& events, const JoinOptions& options) {
  std::vector<JoinEvaluation> joins;
  MapGroups groups;
  for (const RunEventRow& event : WithRecoveries(frames, events)) {
    JoinEvaluation join;
    join.frame_idx = event.frame_idx;
    join.map_id = event.map_id;
    join.other_map_id = event.other_map_id;
    if (event.event == "merged") {
      join.kind = JoinKind::kMerge;
      Judge(MergeParts(frames, event, groups), options, &join);
      groups.Merge(event.map_id, event.other_map_id);
    } else if (event.event == "relocalised" || event.event == kRecovered) {
      join.kind = event.event == kRecovered ? JoinKind::kRecovery : JoinKind::kRelocalisation;
      Judge(RelocalisationParts(frames, event, groups), options, &join);
    } else if (event.event == "loop_closed") {
      join.kind = JoinKind::kLoop;
      Judge(LoopParts(frames, event, groups), options, &join);
    } else {
      continue;
    }
    joins.push_back(std::move(join));
  }
  return joins;
}

}  // namespace haustra::evaluate
