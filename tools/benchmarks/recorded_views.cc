#include "tools/benchmarks/recorded_views.h"

#include <algorithm>
#include <filesystem>
#include <memory>
#include <utility>

#include "capture/open_sequence.h"
#include "hal/frame_source.h"
#include "platform/assemble.h"
#include "tools/evaluate/reference.h"

namespace haustra::benchmarks {
namespace {

// The features of one picture, moved from the device that extracts to the one that keeps.
Status Extract(ImageView image, const CameraModel& camera, VisionDevice& extractor, VisionDevice& device,
               std::vector<std::uint8_t>* descriptors, FrameFeatures* features) {
  HAUSTRA_ASSIGN(const FeatureSetHandle extracted, extractor.CreateFeatureSet());
  ExtractRequest request;
  request.image = image;
  request.set = extracted;
  request.keypoints = features->keypoints;
  request.num_keypoints = &features->num;
  HAUSTRA_TRY(ExtractAndWait(extractor, Lane::kTracking, request));
  HAUSTRA_TRY(extractor.ReadDescriptors(extracted, *descriptors));
  extractor.ReleaseFeatureSet(extracted);
  HAUSTRA_ASSIGN(features->set, device.CreateFeatureSet());
  const auto num = static_cast<std::size_t>(features->num);
  for (int i = 0; i < features->num; ++i) {
    Eigen::Vector3d bearing = Eigen::Vector3d::UnitZ();
    camera.Unproject(features->pixel(i), &bearing);
    for (int k = 0; k < 3; ++k) features->bearings[i][k] = static_cast<float>(bearing[k]);
  }
  return device.WriteFeatures(features->set, std::span(features->keypoints).first(num),
                              std::span(*descriptors).first(num * kDescriptorBytes));
}

Status AddTruth(const std::string& path, const SequenceOptions& part, RecordedSequence* sequence) {
  HAUSTRA_ASSIGN(const evaluate::Reference reference, evaluate::ReadReference(path, ""));
  std::vector<evaluate::RunFrame> frames(sequence->views.size());
  for (std::size_t i = 0; i < frames.size(); ++i) {
    frames[i].frame_idx = static_cast<std::int64_t>(i);
    frames[i].timestamp_ns = sequence->views[i].timestamp.time_since_epoch().count();
  }
  const std::vector<std::optional<SE3>> truth = evaluate::Associate(frames, reference.poses);
  const std::vector<bool> is_clear = evaluate::FindClearFrames(frames, part, reference);
  for (std::size_t i = 0; i < frames.size(); ++i) {
    sequence->views[i].world_from_cam = truth[i];
    sequence->views[i].is_clear = is_clear[i];
  }
  sequence->has_truth = true;
  return Status::Ok();
}

}  // namespace

Result<RecordedSequence> ReadViews(const std::string& path, int every_nth, const EngineConfig& config,
                                   const std::string& extractor_name, int num_threads, VisionDevice& device) {
  SequenceOptions options;
  options.every_nth = static_cast<std::uint32_t>(every_nth);
  HAUSTRA_ASSIGN(const std::unique_ptr<FrameSource> source, OpenSequence(path, options));
  RecordedSequence sequence;
  sequence.path = path;
  HAUSTRA_ASSIGN(sequence.camera, CameraModel::Create(source->calibration()));
  EngineConfig small = config;
  small.memory.max_keyframes = 1;
  HAUSTRA_ASSIGN(const std::unique_ptr<VisionDevice> extractor,
                 CreateVisionDevice(extractor_name, small, source->calibration(), num_threads));
  HAUSTRA_TRY(extractor->SetStaticMask(source->static_mask()));
  std::vector<std::uint8_t> descriptors(static_cast<std::size_t>(config.features.max) * kDescriptorBytes);
  while (true) {
    const Result<Frame> frame = source->Next(kNoDeadline);
    if (frame.code() == StatusCode::kNotFound) break;
    if (frame.code() == StatusCode::kDataLoss) continue;
    HAUSTRA_TRY(frame.status());
    RecordedView view;
    view.timestamp = frame->timestamp;
    view.features = FrameFeatures(config.features.max);
    HAUSTRA_TRY(Extract(frame->image, sequence.camera, *extractor, device, &descriptors, &view.features));
    sequence.views.push_back(std::move(view));
  }
  const std::string truth = (std::filesystem::path(path) / "groundtruth.txt").string();
  std::error_code error;
  if (std::filesystem::is_regular_file(truth, error)) HAUSTRA_TRY(AddTruth(truth, options, &sequence));
  return sequence;
}

}  // namespace haustra::benchmarks
