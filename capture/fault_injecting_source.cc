#include "capture/fault_injecting_source.h"

#include <algorithm>
#include <array>
#include <chrono>
#include <cstring>
#include <limits>
#include <string>
#include <utility>

#include "capture/concat.h"
#include "capture/dataset/folder.h"
#include "capture/image_transform.h"
#include "capture/number.h"

namespace haustra {
namespace {

using capture::internal::Concat;
using capture::internal::ParseInteger;
using capture::internal::SplitFields;

constexpr std::array<std::pair<std::string_view, FaultKind>, 10> kKinds = {{
    {"drop", FaultKind::kDrop},
    {"repeat", FaultKind::kRepeat},
    {"black", FaultKind::kBlack},
    {"freeze", FaultKind::kFreeze},
    {"tear", FaultKind::kTear},
    {"noise", FaultKind::kNoise},
    {"damage", FaultKind::kDamage},
    {"unplug", FaultKind::kUnplug},
    {"duplicate_stamp", FaultKind::kDuplicateStamp},
    {"backward_stamp", FaultKind::kBackwardStamp},
}};

Result<std::uint32_t> ParseFrame(std::string_view text) {
  HAUSTRA_ASSIGN(const std::int64_t frame, ParseInteger(text));
  if (frame < 0 || frame > std::numeric_limits<std::uint32_t>::max()) {
    return InvalidArgument(Concat("'", text, "' is not a frame index"));
  }
  return static_cast<std::uint32_t>(frame);
}

Result<Fault> ParseFault(std::string_view text) {
  const std::vector<std::string_view> words = SplitFields(text, ' ');
  if (words.size() != 2) return InvalidArgument("not a kind and a frame or a range of frames");
  Fault fault;
  const auto kind =
      std::find_if(kKinds.begin(), kKinds.end(), [&](const auto& entry) { return entry.first == words[0]; });
  if (kind == kKinds.end()) return InvalidArgument(Concat("unknown kind of fault '", words[0], "'"));
  fault.kind = kind->second;
  const std::vector<std::string_view> range = SplitFields(words[1], '-');
  if (range.size() > 2) return InvalidArgument(Concat("'", words[1], "' is not a range of frames"));
  HAUSTRA_ASSIGN(fault.first_frame, ParseFrame(range.front()));
  HAUSTRA_ASSIGN(fault.last_frame, ParseFrame(range.back()));
  if (fault.last_frame < fault.first_frame) return InvalidArgument("the range ends before it begins");
  return fault;
}

}  // namespace

Result<std::vector<Fault>> ParseFaultScript(std::string_view script) {
  std::vector<Fault> faults;
  for (const std::string_view part : SplitFields(script, ',')) {
    if (part.empty()) continue;
    const Result<Fault> fault = ParseFault(part);
    if (!fault.ok()) return InvalidArgument(Concat("fault script, '", part, "': ", fault.status().message()));
    faults.push_back(*fault);
  }
  return faults;
}

FaultInjectingSource::FaultInjectingSource(std::unique_ptr<FrameSource> inner, std::vector<Fault> script,
                                           std::uint64_t seed)
    // Odd, because the generator stays at zero for ever.
    : inner_(std::move(inner)), script_(std::move(script)), noise_state_(seed * 2 + 1) {
  needs_previous_ = std::any_of(script_.begin(), script_.end(), [](const Fault& fault) {
    return fault.kind == FaultKind::kFreeze || fault.kind == FaultKind::kTear;
  });
}

Result<Frame> FaultInjectingSource::Next(TimePoint deadline) {
  if (std::exchange(repeats_last_, false)) return last_;
  for (;;) {
    HAUSTRA_ASSIGN(Frame frame, inner_->Next(deadline));
    const Fault* fault = FindFault(frame.index);
    if (fault != nullptr) {
      const std::string here = "frame " + std::to_string(frame.index) + ": ";
      switch (fault->kind) {
        case FaultKind::kDrop: continue;
        case FaultKind::kDamage: return DataLoss(here + "damaged by the fault script");
        case FaultKind::kUnplug: return Unavailable(here + "unplugged by the fault script");
        case FaultKind::kRepeat: repeats_last_ = true; break;
        case FaultKind::kDuplicateStamp:
          if (has_last_) frame.timestamp = last_.timestamp;
          break;
        case FaultKind::kBackwardStamp:
          if (has_last_) frame.timestamp = last_.timestamp - std::chrono::milliseconds(1);
          break;
        default: break;
      }
    }
    const ImageView original = frame.image;
    if (fault != nullptr) ApplyToPixels(fault->kind, &frame);
    const bool is_frozen = fault != nullptr && fault->kind == FaultKind::kFreeze;
    if (needs_previous_ && !(is_frozen && has_last_)) CopyImage(original, &previous_);
    last_ = frame;
    has_last_ = true;
    return frame;
  }
}

const Fault* FaultInjectingSource::FindFault(std::uint32_t frame_index) const {
  const auto found = std::find_if(script_.begin(), script_.end(), [&](const Fault& fault) {
    return frame_index >= fault.first_frame && frame_index <= fault.last_frame;
  });
  return found == script_.end() ? nullptr : &*found;
}

void FaultInjectingSource::ApplyToPixels(FaultKind kind, Frame* frame) {
  const std::size_t row_bytes = static_cast<std::size_t>(frame->image.width) * BytesPerPixel(frame->image.format);
  switch (kind) {
    case FaultKind::kBlack:
      faulty_.Resize(frame->image.width, frame->image.height, frame->image.format);
      for (int y = 0; y < faulty_.height(); ++y) std::memset(faulty_.row(y), 0, row_bytes);
      break;
    case FaultKind::kNoise:
      faulty_.Resize(frame->image.width, frame->image.height, frame->image.format);
      for (int y = 0; y < faulty_.height(); ++y) {
        std::generate_n(faulty_.row(y), row_bytes, [this] { return NextNoise(); });
      }
      break;
    case FaultKind::kFreeze:
      if (!has_last_) return;
      CopyImage(previous_.view(), &faulty_);
      break;
    case FaultKind::kTear:
      if (!has_last_) return;
      CopyImage(frame->image, &faulty_);
      for (int y = faulty_.height() / 2; y < faulty_.height(); ++y) {
        std::memcpy(faulty_.row(y), previous_.row(y), row_bytes);
      }
      break;
    default: return;
  }
  frame->image = faulty_.view();
}

// xorshift64 (Marsaglia 2003): the same noise with every standard library.
std::uint8_t FaultInjectingSource::NextNoise() {
  noise_state_ ^= noise_state_ << 13;
  noise_state_ ^= noise_state_ >> 7;
  noise_state_ ^= noise_state_ << 17;
  return static_cast<std::uint8_t>(noise_state_ >> 56);
}

}  // namespace haustra
