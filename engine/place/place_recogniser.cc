#include "engine/place/place_recogniser.h"

#include "engine/geometry/rng_streams.h"
#include "engine/place/rival_poses.h"

namespace haustra {

PlaceRecogniser::PlaceRecogniser(const EngineConfig& config, const CameraModel& camera, const SceneRegion& scene,
                                 VisionDevice& device)
    : config_(config),
      noise_(config.noise),
      vote_(config, config.place.retrieval, device),
      verifier_(config, config.place.common_area, noise_, camera, scene, device),
      rng_(config.seed, rng_stream::kRecogniser) {}

void PlaceRecogniser::Recognise(PlaceTask* task) {
  noise_ = task->noise;
  switch (task->stage) {
    case PlaceTask::Stage::kRetrieve: task->has_failed = !vote_.Count(task->votes, &task->retrieved).ok(); break;
    case PlaceTask::Stage::kVerify: Verify(task); break;
  }
}

void PlaceRecogniser::Verify(PlaceTask* task) {
  // Set when a piece of the keyframe's own map agrees in all but what drift can explain: the wall itself repeats.
  bool wall_repeats = false;
  CommonArea& area = task->area;
  for (int i = 0; i < task->num_verified; ++i) {
    const PlaceCandidate& candidate = task->candidates[static_cast<std::size_t>(i)];
    const bool is_accepted = verifier_.Verify(task->query, candidate.group, rng_, &area);
    area.counts.num_votes = candidate.num_votes;
    task->report.tried.push_back(area.counts);
    wall_repeats = wall_repeats || area.counts.verdict == CommonAreaVerdict::kImplausibleDrift;
    if (!is_accepted) continue;
    task->is_known = !wall_repeats && !HasRival(task, candidate);
    if (!task->is_known) {
      area.counts.verdict = CommonAreaVerdict::kAmbiguous;
      task->report.tried.push_back(area.counts);
    }
    return;
  }
}

bool PlaceRecogniser::HasRival(PlaceTask* task, const PlaceCandidate& accepted) {
  const CommonArea& area = task->area;
  const SE3& cam_from_map = task->query.first().cam_from_map;
  const double agreement = config_.place.recognition.rival_agreement;
  for (const int i : accepted.rivals) {
    const PlaceCandidate& candidate = task->candidates[static_cast<std::size_t>(i)];
    const bool is_accepted = verifier_.Verify(task->query, candidate.group, rng_, &rival_);
    rival_.counts.num_votes = candidate.num_votes;
    task->report.tried.push_back(rival_.counts);
    if (rival_.counts.verdict == CommonAreaVerdict::kImplausibleDrift) return true;
    if (!is_accepted || candidate.group.map_id != accepted.group.map_id) continue;
    if (AreRivals(cam_from_map, area.b_from_a, rival_.b_from_a, area.median_depth_in_b, agreement)) return true;
  }
  return false;
}

}  // namespace haustra
