#include "engine/mapping/joiner.h"

#include <utility>

namespace haustra {
namespace {

// A slice of bundle adjustment that leaves this much of the cost has little left to do.
constexpr double kSettledShare = 0.995;

}  // namespace

Joiner::Joiner(MappingState& state, Parts parts)
    : state_(state),
      places_(parts.places),
      publisher_(parts.publisher),
      trial_(parts.trial),
      bundle_(parts.bundle),
      events_(parts.events),
      scout_(state.config, parts.retrieval),
      merger_(state.config, state.config.merging, state.noise, state.camera, state.device, parts.adjuster) {}

// Does the keyframe show what another map, or another part of this one, already holds?
void Joiner::Ask(KeyframeHandle keyframe) {
  PlaceTask* task = places_.Free();
  PutOff(task == nullptr ? keyframe : KeyframeHandle{});
  if (task == nullptr) return;
  const TimePoint start = state_.Now();
  task->noise = state_.noise;
  num_turns_asked_ = state_.counters.num_reliefs_turned;
  const bool is_question = scout_.Begin(state_.atlas, keyframe, task);
  task->mapping_duration = state_.Now() - start;
  state_.counters.asking_time += task->mapping_duration;
  if (is_question) {
    places_.Ask();
  } else {
    EndQuestion(*task);
  }
}

void Joiner::PutOff(KeyframeHandle keyframe) {
  if (skipped_) ++state_.counters.num_places_skipped;
  skipped_ = keyframe;
}

// When there is nothing else to do.
bool Joiner::AskForSkipped() {
  if (!skipped_ || places_.is_out()) return false;
  const KeyframeHandle keyframe = std::exchange(skipped_, KeyframeHandle{});
  const Keyframe* skipped = state_.atlas.GetKeyframe(keyframe);
  if (skipped == nullptr || skipped->map != state_.active) {
    ++state_.counters.num_places_skipped;
    return false;
  }
  Ask(keyframe);
  return true;
}

bool Joiner::TakeAnswer() {
  PlaceTask* task = is_joining_ ? nullptr : places_.Answered();
  if (task == nullptr) return false;
  if (task->stage == PlaceTask::Stage::kRetrieve) {
    const Keyframe* keyframe = state_.atlas.GetKeyframe(task->keyframe);
    if (keyframe == nullptr || keyframe->map != state_.active) {
      ++state_.counters.num_places_skipped;
    } else {
      const TimePoint start = state_.Now();
      num_turns_asked_ = state_.counters.num_reliefs_turned;
      const bool is_question = scout_.GoOn(state_.atlas, task);
      const Duration duration = state_.Now() - start;
      task->mapping_duration += duration;
      state_.counters.asking_time += duration;
      if (is_question) {
        places_.AskOn();
        return true;
      }
    }
  }
  EndQuestion(*task);
  if (task->is_known) BeginJoin(*task);
  if (is_joining_) {
    GoOn();
  } else {
    places_.Take();
  }
  return true;
}

void Joiner::EndQuestion(const PlaceTask& task) {
  state_.counters.num_place_points_left_out = scout_.num_points_left_out();
  state_.counters.place_time += task.mapping_duration + task.merging_duration;
  for (const CommonAreaCounts& counts : task.report.tried) {
    if (counts.verdict != CommonAreaVerdict::kAccepted) ReportRejection(task, counts);
  }
}

// Local bundle adjustment, settling and changes of unit since the question was put are made up for by the plan itself
// (merge_plan.h). Maps are joined here alone and one question is out at a time, so what else may have happened is that
// keyframes have gone, that tracking has found itself in another map or begun a new one, or that a young map was built
// anew. Then the answer is dropped: where tracking is now, the next keyframe asks again.
void Joiner::BeginJoin(const PlaceTask& task) {
  const MergePlan plan = MakeMergePlan(task.area);
  const Keyframe* a = state_.atlas.GetKeyframe(plan.keyframe_a);
  Status status = FailedPrecondition("join: tracking has left the map of the plan");
  if (IsTurned()) {
    status = FailedPrecondition("join: a map was built anew");
  } else if (a != nullptr && a->map == state_.active) {
    status = merger_.Begin(plan, state_.atlas);
  }
  if (!status.ok()) {
    RefuseJoin(task, status);
    return;
  }
  is_joining_ = true;
  join_map_ = state_.active;
  joining_time_ = Duration{0};
}

JoinLimits Joiner::Limits(TimePoint start) const {
  if (!state_.is_time_boxed) return {};
  const MergingConfig& options = state_.config.merging;
  return {state_.clock, start + std::chrono::milliseconds(options.slice_milliseconds),
          start + std::chrono::milliseconds(options.max_milliseconds) - joining_time_};
}

void Joiner::GoOn() {
  const PlaceTask& task = *places_.Answered();
  // While the seam is open no map is built anew.
  const bool has_moved = merger_.outcome().has_moved;
  if (state_.active != join_map_ || (IsTurned() && !has_moved)) {
    if (!has_moved) RefuseJoin(task, FailedPrecondition("join: tracking is in another map, or a map was built anew"));
    EndJoin(task);
    return;
  }
  const TimePoint start = state_.Now();
  const bool was_one = merger_.outcome().has_moved;
  const Result<Merger::Progress> progress = merger_.Step(Limits(start), state_.newest, &state_.atlas);
  const MergeOutcome& outcome = merger_.outcome();
  if (outcome.has_moved && !was_one) {
    if (!outcome.is_loop) trial_.Join(outcome.map, outcome.absorbed);
    state_.active = join_map_ = outcome.map;
  }
  state_.is_seam_open = outcome.has_moved;
  const bool is_done = !progress.ok() || *progress == Merger::Progress::kDone;
  if (outcome.is_reframed) publisher_.Reframe(outcome.reframing);
  const Duration duration = state_.Now() - start;
  joining_time_ += duration;
  state_.counters.merge_time += duration;
  if (!progress.ok()) RefuseJoin(task, progress.status());
  if (is_done) EndJoin(task);
  if (outcome.is_reframed || (is_done && outcome.has_moved)) publisher_.Publish();
}

void Joiner::RefuseJoin(const PlaceTask& task, const Status& status) {
  const bool is_outdated =
      status.code() == StatusCode::kFailedPrecondition || status.code() == StatusCode::kInvalidArgument;
  ++(is_outdated ? state_.counters.num_merges_outdated : state_.counters.num_loops_left_open);
  CommonAreaCounts counts = task.area.counts;
  counts.verdict = is_outdated ? CommonAreaVerdict::kOutdated : CommonAreaVerdict::kNotJoined;
  ReportRejection(task, counts);
}

void Joiner::EndJoin(const PlaceTask& task) {
  const MergeOutcome& outcome = merger_.outcome();
  if (outcome.has_moved) {
    settling_rounds_ = state_.config.merging.settling_rounds;
    settling_map_ = join_map_;
    MapEvent event;
    event.kind = outcome.is_loop ? MapEventKind::kLoopClosed : MapEventKind::kMerged;
    event.frame_index = task.frame_index;
    event.timestamp = task.timestamp;
    event.map_id = outcome.map_id;
    event.other_map_id = outcome.is_loop ? kNoId : outcome.absorbed_map_id;
    if (state_.active == join_map_) {
      event.num_keyframes = static_cast<int>(state_.atlas.map(state_.active).keyframes.size());
      event.num_points = state_.atlas.map(state_.active).num_points;
    }
    event.place = task.area.counts;
    event.duration = joining_time_;
    events_.TryPush(event);
  }
  is_joining_ = state_.is_seam_open = false;
  places_.Take();
}

void Joiner::ReportRejection(const PlaceTask& task, const CommonAreaCounts& counts) {
  MapEvent event;
  event.kind = MapEventKind::kMergeRejected;
  event.frame_index = task.frame_index;
  event.timestamp = task.timestamp;
  event.map_id = counts.map_a;
  event.other_map_id = counts.map_b;
  event.place = counts;
  events_.TryPush(event);
}

// After a join, when there is nothing else to do: what the seam made known spreads over the map around it, a slice of
// bundle adjustment at a time.
bool Joiner::SettleSeam() {
  if (state_.active != settling_map_) settling_rounds_ = 0;
  if (settling_rounds_ == 0) return false;
  --settling_rounds_;
  const TimePoint start = state_.Now();
  const MergingConfig& options = state_.config.merging;
  const LocalBundle::Extent extent{options.settling_keyframes, false, options.settling_iterations};
  const SE3 old_pose = state_.atlas.keyframe(state_.newest).cam_from_map;
  const Result<BundleSummary> summary =
      bundle_.Adjust(state_.newest, extent, state_.BundleLimits(options.settling_milliseconds, 0, 0), &state_.atlas);
  const bool is_interrupted = state_.link.proposals.Front() != nullptr;
  if (!summary.ok() || summary->state == SolveState::kNone) {
    if (!is_interrupted) settling_rounds_ = 0;
    return true;
  }
  if (!is_interrupted && summary->final_cost > kSettledShare * summary->initial_cost) settling_rounds_ = 0;
  const MapId map_id = state_.atlas.map(state_.active).id;
  publisher_.Reframe(
      {map_id, map_id, Sim3(state_.atlas.keyframe(state_.newest).cam_from_map).Inverse() * Sim3(old_pose)});
  publisher_.Publish();
  state_.counters.settle_time += state_.Now() - start;
  return true;
}

}  // namespace haustra
