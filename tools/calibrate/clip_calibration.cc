#include "tools/calibrate/clip_calibration.h"

#include <algorithm>
#include <cmath>
#include <memory>
#include <utility>

#include "capture/open_sequence.h"
#include "engine/camera/camera_model.h"
#include "platform/assemble.h"
#include "tools/calibrate/frame_plan.h"

namespace haustra {
namespace {

using calibration::CollectorCounters;
using calibration::CollectorOptions;
using calibration::ScopeWindowFinder;
using calibration::WindowCollector;

constexpr int kMaxFeatures = 1500;
// Reflections wander with the light, which the scope carries: their flanks, too, bend the focal length by percents.
constexpr int kReflectionThreshold = 205;
constexpr double kMaskDilation = 1.0 / 120.0;  // share of the width
constexpr int kMinFrames = 30;                 // that can be read
// A picture that moves less than this share of its width against a frame a second or so before stands still.
constexpr double kStillMotion = 0.004;

Result<std::unique_ptr<VisionDevice>> MakeDevice(const ClipCalibrationRequest& request, const FrameSource& source,
                                                 const CollectorOptions& options) {
  VisionPlan plan;
  plan.max_width_px = source.calibration().width_px;
  plan.max_height_px = source.calibration().height_px;
  plan.max_features = kMaxFeatures;
  plan.max_feature_sets = options.max_views + 4;
  plan.extracts_in_background = false;
  ExtractOptions extract;
  extract.num_features = kMaxFeatures;
  extract.reflection_threshold = kReflectionThreshold;
  extract.mask_dilation_px = std::clamp(static_cast<int>(std::lround(kMaskDilation * plan.max_width_px)), 2, 12);
  HAUSTRA_ASSIGN(std::unique_ptr<VisionDevice> device,
                 CreateVisionDevice(request.device, plan, extract, request.threads));
  HAUSTRA_TRY(device->SetStaticMask(source.static_mask()));
  return device;
}

Status CheckWhatWasSeen(int num_read, const CollectorCounters& counters) {
  if (num_read < kMinFrames) {
    return FailedPrecondition(std::to_string(num_read) + " frames are too few to calibrate from, " +
                              std::to_string(kMinFrames) + " are needed");
  }
  if (counters.num_poor > counters.num_frames * 9 / 10) {
    return FailedPrecondition("hardly a frame shows enough texture to calibrate from (" +
                              std::to_string(counters.num_poor) + " of " + std::to_string(counters.num_frames) +
                              " do not)");
  }
  if (counters.max_motion < kStillMotion) {
    return FailedPrecondition("the picture does not move; the scope must turn and move");
  }
  return Status::Ok();
}

CameraCalibration CalibrationOf(const ClipCalibration& result, double rate_hz) {
  const calibration::CalibrationEstimate& estimate = result.estimate;
  CameraCalibration calibration = estimate.intrinsics.ToCalibration(result.width_px, result.height_px, rate_hz);
  if (!estimate.verdict.ok()) calibration.focal_guess_sigma = estimate.sigma[calibration::kLogFocal];
  return calibration;
}

}  // namespace

Result<ClipCalibration> CalibrateFromClip(const ClipCalibrationRequest& request) {
  SequenceOptions options = request.options;
  options.halve = false;
  options.calibration_path.clear();
  options.calibration = CameraCalibration{};
  HAUSTRA_ASSIGN(const std::unique_ptr<FrameSource> source, OpenSequence(request.sequence, options));
  ClipCalibration result;
  result.width_px = source->calibration().width_px;
  result.height_px = source->calibration().height_px;
  const CollectorOptions collector_options;
  HAUSTRA_ASSIGN(const std::unique_ptr<VisionDevice> device, MakeDevice(request, *source, collector_options));

  WindowCollector collector(*device, result.width_px, collector_options);
  ScopeWindowFinder finder(result.width_px, result.height_px);
  const FramePlan plan =
      PlanFrames(source->num_frames(), source->calibration().rate_hz, result.width_px, result.height_px);
  int num_read = 0;
  std::uint32_t piece = 0;
  for (;;) {
    const Result<Frame> frame = source->Next(kNoDeadline);
    if (frame.code() == StatusCode::kDataLoss) continue;
    if (frame.code() == StatusCode::kNotFound) break;
    HAUSTRA_TRY(frame.status());
    ++num_read;
    if (plan.PieceOf(frame->index) != piece) collector.Interrupt();
    piece = plan.PieceOf(frame->index);
    if (!plan.IsWanted(frame->index)) continue;
    finder.Add(frame->image);
    HAUSTRA_TRY(collector.Add(frame->index, frame->image));
    if (request.on_frame) request.on_frame(frame->index, source->num_frames());
  }
  collector.Interrupt();
  result.counters = collector.counters();
  const ImageView mask = source->static_mask();
  result.scope = mask.is_empty() ? finder.Find() : ScopeWindowFinder::OfMask(mask, result.width_px, result.height_px);

  calibration::SelfCalibrationOptions self_options;
  self_options.seed = request.seed;
  const Status seen = CheckWhatWasSeen(num_read, result.counters);
  result.estimate = seen.ok() ? calibration::EstimateIntrinsics(collector.windows(), result.scope, self_options)
                              : calibration::UsualIntrinsics(result.scope, self_options, seen);
  result.calibration = CalibrationOf(result, source->calibration().rate_hz);
  if (const Result<CameraModel> camera = CameraModel::Create(result.calibration); !camera.ok()) {
    result.estimate = calibration::UsualIntrinsics(
        result.scope, self_options,
        FailedPrecondition("what was estimated is no camera: " + camera.status().message()));
    result.calibration = CalibrationOf(result, source->calibration().rate_hz);
  }
  return result;
}

}  // namespace haustra
