// A frame source that goes wrong by a script, around one that works: for tests of everything behind it.
#pragma once

#include <cstdint>
#include <memory>
#include <string_view>
#include <vector>

#include "capture/image.h"
#include "hal/frame_source.h"

namespace haustra {

enum class FaultKind {
  kDrop,            // the frame never comes; its index is missing
  kRepeat,          // the frame comes twice, with the same index and time stamp
  kBlack,           // all pixels 0
  kFreeze,          // the pixels of the last frame before the fault, with new index and time stamp
  kTear,            // the lower half still shows the frame before
  kNoise,           // pixels from a seeded generator
  kDamage,          // kDataLoss in place of the frame
  kUnplug,          // kUnavailable in place of the frame
  kDuplicateStamp,  // the time stamp of the frame before
  kBackwardStamp,   // a time stamp 1 ms earlier than that of the frame before
};

// Frames are counted by the index that the inner source gives; both ends included.
struct Fault {
  FaultKind kind = FaultKind::kDrop;
  std::uint32_t first_frame = 0;
  std::uint32_t last_frame = 0;
};

// "drop 10-12, black 20, freeze 30-60": kinds are drop, repeat, black, freeze, tear, noise, damage, unplug,
// duplicate_stamp, backward_stamp. kInvalidArgument quotes the part that is wrong.
Result<std::vector<Fault>> ParseFaultScript(std::string_view script);

// Of two faults that cover a frame, the earlier in the script counts. Stamp faults break the contract of FrameSource on
// purpose. thread-bound(the reader).
class FaultInjectingSource final : public FrameSource {
 public:
  FaultInjectingSource(std::unique_ptr<FrameSource> inner, std::vector<Fault> script, std::uint64_t seed);

  const CameraCalibration& calibration() const override { return inner_->calibration(); }
  std::uint32_t num_frames() const override { return inner_->num_frames(); }
  bool is_live() const override { return inner_->is_live(); }
  ImageView static_mask() const override { return inner_->static_mask(); }
  std::string FrameName(std::uint32_t frame_index) const override { return inner_->FrameName(frame_index); }
  Result<Frame> Next(TimePoint deadline) override;

 private:
  const Fault* FindFault(std::uint32_t frame_index) const;
  // Replaces the pixels of the frame as the fault says.
  void ApplyToPixels(FaultKind kind, Frame* frame);
  std::uint8_t NextNoise();

  std::unique_ptr<FrameSource> inner_;
  std::vector<Fault> script_;
  std::uint64_t noise_state_;
  bool needs_previous_ = false;  // some fault shows the frame before
  bool repeats_last_ = false;
  Frame last_;  // as it was handed out
  bool has_last_ = false;
  Image previous_;  // pixels of the last frame without a freeze
  Image faulty_;
};

}  // namespace haustra
