#include "capture/v4l2/v4l2_source.h"

#include <linux/videodev2.h>

#include <algorithm>
#include <cstdio>
#include <utility>

#include "capture/calibration_reader.h"
#include "capture/image_transform.h"
#include "capture/number.h"
#include "capture/static_mask.h"
#include "capture/v4l2/picture_view.h"
#include "capture/yuv.h"
#include "hal/core/seconds_text.h"

namespace haustra {
namespace {

using capture::internal::SizeText;
using capture::internal::V4l2Format;
using capture::internal::V4l2Picture;
using capture::internal::V4l2Stream;
using std::chrono::milliseconds;
using std::chrono::seconds;

constexpr Duration kLongestWait = seconds(1);
constexpr Duration kRetryInterval = milliseconds(250);
constexpr Duration kSilence = seconds(3);
// One stamp that goes back is a damaged picture's; after so many in a row the clock has.
constexpr int kMostNotLater = 5;

TimePoint Sooner(TimePoint a, TimePoint b) { return std::min(a, b); }

}  // namespace

// The device is closed, opened, or told to begin.
class V4l2Source::Recovery {
 public:
  explicit Recovery(V4l2Source& source) : source_(source) {
    source.io_.Begin();
    is_within_another_ = source.is_recovering_.exchange(true, std::memory_order_acq_rel);
  }
  ~Recovery() { source_.is_recovering_.store(is_within_another_, std::memory_order_release); }
  Recovery(const Recovery&) = delete;
  Recovery& operator=(const Recovery&) = delete;

 private:
  V4l2Source& source_;
  bool is_within_another_ = false;
};

std::optional<TimePoint> V4l2Source::recovering_since() const {
  return is_recovering_.load(std::memory_order_acquire) ? std::optional(io_.newest()) : std::nullopt;
}

Result<std::unique_ptr<V4l2Source>> V4l2Source::Create(const V4l2Options& options, const SequenceOptions& sequence,
                                                       DeviceIo& io) {
  HAUSTRA_TRY(options.Validate());
  HAUSTRA_TRY(sequence.Validate());
  if (sequence.first_frame != 0 || sequence.last_frame != SequenceOptions().last_frame) {
    return InvalidArgument("a live camera has no first and no last frame to choose");
  }
  if (sequence.reversed) return InvalidArgument("a live camera cannot be played backwards");
  if (options.field != FieldChoice::kProgressive && !sequence.halve) {
    return InvalidArgument(
        "a field has half the rows of the picture: field=top and field=bottom go together with halving");
  }
  std::unique_ptr<V4l2Source> source(new V4l2Source(options, sequence, io));
  HAUSTRA_TRY(source->Initialise());
  return source;
}

Status V4l2Source::Initialise() {
  CameraCalibration file;
  const bool has_file = !sequence_.calibration_path.empty();
  // Some cameras are set to a few pictures a second until they are asked for more.
  preferred_rate_hz_ = options_.max_rate_hz;
  width_px_ = options_.width_px;
  height_px_ = options_.height_px;
  if (has_file) {
    HAUSTRA_ASSIGN(file, ReadCalibration(sequence_.calibration_path));
    if (file.rate_hz > 0.0) preferred_rate_hz_ = file.rate_hz;
    if (width_px_ == 0 && options_.region.is_whole()) {
      width_px_ = file.width_px;
      height_px_ = file.height_px;
    }
  }
  const bool is_size_of_camera = width_px_ == 0;
  if (const Status status = Connect(); !status.ok()) {
    if (status.code() != StatusCode::kUnavailable || !options_.may_come_later) return status;
    if (width_px_ == 0) {
      return InvalidArgument("the size of the pictures of a camera that is not there is not known: give size=WxH (" +
                             status.message() + ")");
    }
    Disconnect(status.message());
  }
  const Status resolved = ResolveGeometry(has_file ? &file : nullptr);
  // The camera's next signal may have the size.
  if (is_size_of_camera && resolved.code() == StatusCode::kInvalidArgument) return Unavailable(resolved.message());
  HAUSTRA_TRY(resolved);
  CameraCalibration stored = calibration_;
  if (sequence_.halve) {
    calibration_ = Halved(calibration_);
    // Row y of a field is row 2 y of the picture, or 2 y + 1: not the middle between the two.
    if (options_.field == FieldChoice::kTop) calibration_.cy += 0.25;
    if (options_.field == FieldChoice::kBottom) calibration_.cy -= 0.25;
  }
  const bool is_rate_known = stream_ != nullptr && stream_->format().rate_hz > 0.0;
  const double camera_rate = is_rate_known ? stream_->format().rate_hz : preferred_rate_hz_;
  calibration_.rate_hz = std::min(camera_rate, options_.max_rate_hz) / sequence_.every_nth;
  HAUSTRA_ASSIGN(mask_, capture::internal::ReadStaticMask(sequence_.mask_path, stored, sequence_.halve));
  return Status::Ok();
}

Status V4l2Source::ResolveGeometry(const CameraCalibration* file) {
  const std::uint32_t fourcc = stream_ != nullptr ? stream_->format().fourcc : options_.format;
  HAUSTRA_TRY(capture::internal::CheckRegion(options_.region, width_px_, height_px_, fourcc, options_.field));
  const bool is_whole = options_.region.is_whole();
  const int width = is_whole ? width_px_ : options_.region.width_px;
  const int height = is_whole ? height_px_ : options_.region.height_px;
  if (file != nullptr) {
    calibration_ = *file;
    if (file->width_px == width && file->height_px == height) return Status::Ok();
    if (file->width_px != width_px_ || file->height_px != height_px_) {
      return InvalidArgument(sequence_.calibration_path + ": the calibration is for " +
                             SizeText(file->width_px, file->height_px) + ", the camera's pictures are " +
                             SizeText(width_px_, height_px_) +
                             (is_whole ? std::string() : ", the region is " + SizeText(width, height)));
    }
    calibration_.cx -= options_.region.x_px;
    calibration_.cy -= options_.region.y_px;
  }
  calibration_.width_px = width;
  calibration_.height_px = height;
  return Status::Ok();
}

Status V4l2Source::Connect() {
  HAUSTRA_ASSIGN(stream_, V4l2Stream::Open(options_, width_px_, height_px_, preferred_rate_hz_, io_));
  const V4l2Format& format = stream_->format();
  const int height =
      format.rows == V4l2Format::Rows::kOneField && (height_px_ == 0 || height_px_ == 2 * format.height_px)
          ? 2 * format.height_px
          : format.height_px;
  if (width_px_ == 0) {
    width_px_ = format.width_px;
    height_px_ = height;
  }
  counter_.Restart(format.rate_hz, options_.max_rate_hz, sequence_.every_nth);
  deinterlacer_.Restart();  // it may be another signal
  if (format.fourcc == V4L2_PIX_FMT_MJPEG && !decoder_) {
    decoder_.emplace(ImageSize{format.width_px, format.height_px});
    decoded_.Resize(format.width_px, format.height_px, PixelFormat::kBgr8);
  }
  gone_.clear();
  return Status::Ok();
}

Status V4l2Source::Start() {
  const Recovery recovery(*this);
  if (const Status status = stream_->Start(); !status.ok()) {
    Disconnect(status.message());
    return Unavailable(gone_);
  }
  last_picture_ = io_.Now();
  return Status::Ok();
}

Status V4l2Source::Reconnect(TimePoint limit) {
  const Recovery recovery(*this);
  if (io_.Now() < next_attempt_) {
    io_.Sleep(Sooner(next_attempt_, limit) - io_.Now());
    if (io_.Now() < next_attempt_) return Unavailable(gone_);
  }
  Status status = Connect();
  // Its format is known only now.
  if (status.ok()) {
    status = capture::internal::CheckRegion(options_.region, width_px_, height_px_, stream_->format().fourcc,
                                            options_.field);
    if (!status.ok()) status = Unavailable(stream_->path() + ": " + status.message());
  }
  if (status.ok()) {
    ++counters_.num_restarts;
    return status;
  }
  // Whatever it is, another device may be plugged in, or the signal may become what it was.
  Disconnect(status.message());
  return Unavailable(gone_);
}

void V4l2Source::Disconnect(std::string reason) {
  const Recovery recovery(*this);
  held_.reset();
  stream_.reset();
  gone_ = std::move(reason);
  next_attempt_ = io_.Now() + kRetryInterval;
}

void V4l2Source::GiveBack() {
  if (held_) stream_->GiveBack(*held_);
  held_.reset();
}

Result<Frame> V4l2Source::Next(TimePoint deadline) {
  GiveBack();
  const TimePoint limit = Sooner(deadline, io_.Now() + kLongestWait);
  if (stream_ == nullptr) HAUSTRA_TRY(Reconnect(limit));
  if (!stream_->is_streaming()) HAUSTRA_TRY(Start());
  const Result<std::uint32_t> index = Wait(limit);
  if (!index.ok()) {
    if (index.code() == StatusCode::kUnavailable) Disconnect(index.status().message());
    if (index.code() == StatusCode::kDeadlineExceeded) {
      ++counters_.num_timeouts;
      if (io_.Now() - last_picture_ > kSilence) {
        Disconnect(stream_->path() + ": no picture for " + std::to_string(kSilence / seconds(1)) + " s");
      }
    }
    return index.status();
  }
  Frame frame;
  frame.index = *index;
  frame.timestamp = held_->timestamp;
  frame.refused_stamp = held_->refused_stamp;
  if (const Status status = Show(*held_, &frame); !status.ok()) {
    ++counters_.num_damaged;
    return status;
  }
  ++counters_.num_frames;
  return frame;
}

Result<std::uint32_t> V4l2Source::Wait(TimePoint limit) {
  std::optional<std::uint32_t> newest;
  // Each turn ends with a picture or at the limit; a camera that only sends what is left out ends it, too.
  for (int num_looks = 0;; ++num_looks) {
    // After the first that counts, only what is there already.
    const bool may_look_on = options_.skip_stale && num_looks < options_.num_buffers;
    if (newest && !may_look_on) return *newest;
    if (!newest && num_looks > 0 && io_.Now() >= limit) return Status(StatusCode::kDeadlineExceeded);
    Result<V4l2Picture> picture = stream_->Dequeue(newest ? io_.Now() : limit);
    if (!picture.ok()) {
      if (newest && picture.code() == StatusCode::kDeadlineExceeded) return *newest;
      return picture.status();
    }
    last_picture_ = io_.Now();
    if (picture->is_other_field) {
      stream_->GiveBack(*picture);
      ++counters_.num_left_out;
      continue;
    }
    if (!picture->is_damaged) RefuseStampsThatWentBack(&*picture);
    const auto place = counter_.Count(picture->sequence, picture->timestamp);
    counters_.num_lost += place.num_lost;
    if (!picture->is_stamped) ++counters_.num_unstamped;
    const bool is_late_enough = !has_stamp_ || picture->timestamp > last_stamp_;
    if (picture->is_damaged || !is_late_enough) {
      ++counters_.num_damaged;
      stream_->GiveBack(*picture);
      // While there is a sound one, or another chance for the same frame, nobody has missed anything.
      if (newest || place.is_taken || !place.is_last_chance) continue;
      counter_.Take(place.index);
      const std::string what = picture->is_damaged ? " is damaged"
                                                   : " has the time stamp " + SecondsText(picture->timestamp) +
                                                         " s, which is not later than " + SecondsText(last_stamp_) +
                                                         " s, the one before";
      return DataLoss(stream_->path() + ": picture " + std::to_string(picture->sequence) + what);
    }
    if (place.is_taken) {
      stream_->GiveBack(*picture);
      ++counters_.num_left_out;
      continue;
    }
    if (newest) {
      GiveBack();
      ++counters_.num_stale;
    }
    held_ = *picture;
    has_stamp_ = true;
    last_stamp_ = picture->timestamp;
    counter_.Take(place.index);
    newest = place.index;
  }
}

void V4l2Source::RefuseStampsThatWentBack(V4l2Picture* picture) {
  num_not_later_ = !has_stamp_ || picture->timestamp > last_stamp_ ? 0 : num_not_later_ + 1;
  if (num_not_later_ <= kMostNotLater || !picture->is_stamped) return;
  picture->refused_stamp = std::exchange(picture->timestamp, last_picture_);
  picture->is_stamped = false;
}

Status V4l2Source::Show(const V4l2Picture& picture, Frame* frame) {
  const V4l2Format& format = stream_->format();
  ImageView view;
  if (format.fourcc == V4L2_PIX_FMT_MJPEG) {
    const Status status = decoder_->Decode(picture.bytes, sequence_.channels, &decoded_);
    if (!status.ok()) return DataLoss(stream_->path() + ": " + status.message());
    if (decoded_.width() != format.width_px || decoded_.height() != format.height_px) {
      return DataLoss(stream_->path() + ": a picture of " + SizeText(decoded_.width(), decoded_.height()) +
                      " among those of " + SizeText(format.width_px, format.height_px));
    }
    view = decoded_.view();
    if (!options_.region.is_whole()) {
      view.data += options_.region.y_px * view.pitch_bytes + options_.region.x_px * BytesPerPixel(view.format);
      view.width = options_.region.width_px;
      view.height = options_.region.height_px;
    }
  } else {
    view = capture::internal::ViewOfPicture(format, picture.bytes, options_.region, options_.field);
  }
  if (options_.field != FieldChoice::kProgressive) {
    HalveColumns(view, &prepared_);
    frame->shows_one_field = true;
    frame->image = prepared_.view();
    return Status::Ok();
  }
  frame->shows_one_field = deinterlacer_.WantsTopField(view);
  if (frame->shows_one_field) {
    KeepTopField(view, &deinterlaced_);
    view = deinterlaced_.view();
  }
  if (sequence_.halve) {
    if (view.format == PixelFormat::kBgr8) {
      HalveImage(view, &prepared_);
    } else {
      HalveLuma(view, &prepared_);
    }
    view = prepared_.view();
  } else if (sequence_.channels == ChannelChoice::kGrey && view.format != PixelFormat::kGrey8) {
    LumaToGrey(view, &prepared_);
    view = prepared_.view();
  }
  frame->image = view;
  return Status::Ok();
}

std::optional<PixelFormat> V4l2Source::pixel_format() const {
  if (stream_ == nullptr) return std::nullopt;
  const PixelFormat stored = capture::internal::FormatOf(stream_->format().fourcc);
  if (sequence_.channels == ChannelChoice::kGrey) return PixelFormat::kGrey8;
  // Halving gives luma of raw formats; of a part of NV12 only luma is read (picture_view.h).
  if (sequence_.halve && stored != PixelFormat::kBgr8) return PixelFormat::kGrey8;
  return stored == PixelFormat::kNv12 && !options_.region.is_whole() ? PixelFormat::kGrey8 : stored;
}

std::span<const std::uint8_t> V4l2Source::encoded() const {
  if (!held_ || stream_->format().fourcc != V4L2_PIX_FMT_MJPEG) return {};
  return held_->bytes;
}

Result<int> V4l2Source::ExportBuffer() {
  if (!held_) return Unavailable("there is no frame whose buffer could be exported");
  return stream_->Export(*held_);
}

std::string V4l2Source::Describe() const {
  if (stream_ == nullptr) return gone_;
  const V4l2Format& format = stream_->format();
  char rate[40] = "";
  if (format.rate_hz > 0.0) std::snprintf(rate, sizeof(rate), " at %.4g Hz", format.rate_hz);
  return stream_->name() + " (" + stream_->path() + "), " + FourccText(format.fourcc) + " " +
         SizeText(width_px_, height_px_) + rate + ", " + stream_->MemoryText();
}

Result<std::unique_ptr<FrameSource>> OpenV4l2(const std::string& spec, const SequenceOptions& options) {
  HAUSTRA_ASSIGN(const V4l2Options camera, ParseV4l2Spec(spec));
  if (options.calibration_path.empty()) {
    return NotFound(spec + ": a camera carries no calibration; name a calibration file (see config/cameras)");
  }
  HAUSTRA_ASSIGN(std::unique_ptr<V4l2Source> source, V4l2Source::Create(camera, options, SystemDeviceIo()));
  return std::unique_ptr<FrameSource>(std::move(source));
}

}  // namespace haustra
