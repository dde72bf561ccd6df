#include "tools/vocabulary/training_sample.h"

#include <algorithm>
#include <utility>

#include "capture/open_sequence.h"
#include "engine/place/strongest_features.h"
#include "hal/frame_source.h"
#include "platform/assemble.h"

namespace haustra {

Status TrainingSample::BeginSource(const CameraCalibration& calibration, ImageView mask) {
  // One picture at a time is all that it holds.
  EngineConfig config = config_;
  config.memory.max_keyframes = 1;
  config.initialisation.kept_views = 2;
  device_.reset();
  HAUSTRA_ASSIGN(device_, CreateVisionDevice("cpu", config, calibration, num_threads_));
  features_ = FrameFeatures(device_->plan().max_features);
  descriptors_.resize(static_cast<std::size_t>(device_->plan().max_features) * kDescriptorBytes);
  return device_->SetStaticMask(mask);
}

Status TrainingSample::AddPicture(ImageView picture) {
  HAUSTRA_ASSIGN(features_.set, device_->CreateFeatureSet());
  ExtractRequest request;
  request.image = picture;
  request.set = features_.set;
  request.keypoints = features_.keypoints;
  request.num_keypoints = &features_.num;
  Status status = ExtractAndWait(*device_, Lane::kTracking, request);
  if (status.ok()) status = device_->ReadDescriptors(features_.set, descriptors_);
  device_->ReleaseFeatureSet(features_.set);
  HAUSTRA_TRY(std::move(status));
  SelectStrongest(features_, max_per_picture_, &strongest_);
  for (const std::int32_t feature : strongest_) {
    const auto begin = descriptors_.begin() + std::ptrdiff_t{feature} * kDescriptorBytes;
    sample_.descriptors.insert(sample_.descriptors.end(), begin, begin + kDescriptorBytes);
  }
  sample_.picture_ends.push_back(sample_.num_descriptors());
  return Status::Ok();
}

Status TrainingSample::AddSequence(const std::string& path, int every_nth) {
  SequenceOptions options;
  options.every_nth = static_cast<std::uint32_t>(every_nth);
  // Words are of pictures alone: any camera will do, and any times.
  options.calibration = CameraCalibration{};
  options.calibration->rate_hz = 25.0;
  HAUSTRA_ASSIGN(const std::unique_ptr<FrameSource> source, OpenSequence(path, options));
  HAUSTRA_TRY(BeginSource(source->calibration(), source->static_mask()));
  while (true) {
    const Result<Frame> frame = source->Next(kNoDeadline);
    if (frame.code() == StatusCode::kNotFound) return Status::Ok();
    if (frame.code() == StatusCode::kDataLoss) continue;
    HAUSTRA_TRY(frame.status());
    HAUSTRA_TRY(AddPicture(frame->image));
  }
}

}  // namespace haustra
