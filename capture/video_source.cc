#include "capture/video_source.h"

extern "C" {
#include <libavcodec/avcodec.h>
#include <libavformat/avformat.h>
#include <libavutil/common.h>
#include <libavutil/imgutils.h>
#include <libavutil/log.h>
#include <libswscale/swscale.h>
}

#include <algorithm>
#include <array>
#include <limits>
#include <optional>
#include <utility>

#include "capture/dataset/folder.h"
#include "capture/deinterlace.h"
#include "capture/image.h"
#include "capture/image_transform.h"
#include "capture/number.h"
#include "capture/static_mask.h"
#include "capture/video_calibration.h"

namespace haustra {
namespace {

using capture::internal::SizeText;
using capture::internal::VideoCompanions;

// The containers that are read. libav knows many more; some of them are lists that name other files and addresses to
// open.
constexpr const char* kContainers = "mov,mp4,avi,matroska,mpeg,mpegts,asf";

constexpr AVRational kNanosecond{1, 1'000'000'000};
// A stamp so far back begins another recording. A smaller step is damage, and costs no more than that much video.
constexpr std::int64_t kJumpBackNs = 1'000'000'000;
// Such a pause means nothing to tracking, which has long lost its place, and in real time it would be waited out: hours
// of it, where the clock is that of another recording.
constexpr std::int64_t kJumpAheadNs = 10'000'000'000;

struct FormatCloser {
  void operator()(AVFormatContext* format) const { avformat_close_input(&format); }
};
struct CodecCloser {
  void operator()(AVCodecContext* codec) const { avcodec_free_context(&codec); }
};
struct FrameCloser {
  void operator()(AVFrame* frame) const { av_frame_free(&frame); }
};
struct PacketCloser {
  void operator()(AVPacket* packet) const { av_packet_free(&packet); }
};
struct ScalerCloser {
  void operator()(SwsContext* scaler) const { sws_freeContext(scaler); }
};

std::string ErrorText(int error) {
  std::array<char, AV_ERROR_MAX_STRING_SIZE> text{};
  av_strerror(error, text.data(), text.size());
  return text.data();
}

// How many frames the container states, or else its duration lets expect; 0: it says neither. To count them the whole
// recording would have to be read.
std::int64_t NumStored(const AVFormatContext& format, const AVStream& stream) {
  if (stream.nb_frames > 0) return stream.nb_frames;
  if (format.duration_estimation_method == AVFMT_DURATION_FROM_BITRATE) return 0;  // wild for what varies
  if (stream.avg_frame_rate.num <= 0 || stream.avg_frame_rate.den <= 0) return 0;
  const AVRational period = av_inv_q(stream.avg_frame_rate);
  if (stream.duration != AV_NOPTS_VALUE) return av_rescale_q(stream.duration, stream.time_base, period);
  return format.duration != AV_NOPTS_VALUE ? av_rescale_q(format.duration, AV_TIME_BASE_Q, period) : 0;
}

// What libav makes of one picture of the stream.
enum class Decoded { kPicture, kLost, kEnd };

class VideoSource final : public FrameSource {
 public:
  static Result<std::unique_ptr<FrameSource>> Open(const std::string& path, const SequenceOptions& options);

  const CameraCalibration& calibration() const override { return calibration_; }
  std::uint32_t num_frames() const override { return num_frames_; }
  ImageView static_mask() const override { return mask_.view(); }
  std::string FrameName(std::uint32_t frame_index) const override {
    return NumberedFrameName(options_.first_frame + frame_index * options_.every_nth);
  }
  Result<Frame> Next(TimePoint deadline) override;
  std::string StampRemark() const;

 private:
  VideoSource(std::string path, const SequenceOptions& options)
      : path_(std::move(path)), options_(options), deinterlacer_(options.deinterlace) {}

  Status OpenContainer();
  Status OpenDecoder();
  void CountFrames();
  // Decodes the next picture into picture_; `why` says what is wrong with a lost one.
  Decoded Decode(std::string* why);
  // From one picture to the next, in nanoseconds; 0: not known.
  std::int64_t Period() const;
  // Time of picture_, or nothing when it has none or not one after the last.
  std::optional<std::int64_t> TakeStamp();
  Status Convert();

  std::string path_;
  SequenceOptions options_;
  VideoCompanions companions_;
  CameraCalibration calibration_;  // of the frames that are handed out
  std::uint32_t num_frames_ = 0;

  std::unique_ptr<AVFormatContext, FormatCloser> format_;
  std::unique_ptr<AVCodecContext, CodecCloser> codec_;
  std::unique_ptr<AVPacket, PacketCloser> packet_;
  std::unique_ptr<AVFrame, FrameCloser> picture_;
  std::unique_ptr<SwsContext, ScalerCloser> scaler_;
  const AVStream* stream_ = nullptr;
  bool is_draining_ = false;
  std::uint32_t next_stored_ = 0;  // of the pictures of the stream, lost ones included
  std::optional<std::int64_t> first_pts_;
  std::int64_t first_ns_ = 0;  // time of the picture that is stamped first_pts_
  std::int64_t last_stamp_ns_ = -1;
  std::optional<std::int64_t> refused_ns_;  // what was stated where they jumped, for the next frame
  std::uint32_t num_jumps_ = 0;
  std::uint32_t first_jump_ = 0;  // picture of the stream

  Deinterlacer deinterlacer_;
  Image mask_;
  Image stored_;
  Image half_;
};

Result<std::unique_ptr<FrameSource>> VideoSource::Open(const std::string& path, const SequenceOptions& options) {
  HAUSTRA_TRY(options.Validate());
  if (!capture::internal::IsFile(path)) return NotFound(path + ": no such file");
  std::unique_ptr<VideoSource> source(new VideoSource(path, options));
  HAUSTRA_TRY(source->OpenContainer());
  HAUSTRA_ASSIGN(source->companions_, capture::internal::FindVideoCompanions(path, options));
  HAUSTRA_TRY(source->OpenDecoder());
  HAUSTRA_ASSIGN(source->mask_, capture::internal::ReadStaticMask(source->companions_.mask_path,
                                                                  source->companions_.calibration, options.halve));
  return std::unique_ptr<FrameSource>(std::move(source));
}

Status VideoSource::OpenContainer() {
  // libav writes to stderr on its own, in the middle of the caller's output; what matters is in the statuses.
  av_log_set_level(AV_LOG_QUIET);
  AVDictionary* options = nullptr;
  av_dict_set(&options, "format_whitelist", kContainers, 0);
  av_dict_set(&options, "protocol_whitelist", "file", 0);
  AVFormatContext* format = nullptr;
  const int open_error = avformat_open_input(&format, path_.c_str(), nullptr, &options);
  av_dict_free(&options);
  if (open_error < 0) {
    return DataLoss(path_ +
                    ": cannot be opened as a video (mov, mp4, avi, mkv, webm, mpg, ts, wmv): " + ErrorText(open_error));
  }
  format_.reset(format);
  if (const int error = avformat_find_stream_info(format, nullptr); error < 0) {
    return DataLoss(path_ + ": no stream can be read: " + ErrorText(error));
  }
  const int stream_idx = av_find_best_stream(format, AVMEDIA_TYPE_VIDEO, -1, -1, nullptr, 0);
  if (stream_idx < 0) return InvalidArgument(path_ + ": no video stream");
  stream_ = format->streams[stream_idx];
  return Status::Ok();
}

Status VideoSource::OpenDecoder() {
  const AVCodec* decoder = avcodec_find_decoder(stream_->codecpar->codec_id);
  if (decoder == nullptr) {
    return InvalidArgument(path_ + ": no decoder for codec " + avcodec_get_name(stream_->codecpar->codec_id));
  }
  CameraCalibration& stored = companions_.calibration;
  if (stored.width_px == 0) {
    stored.width_px = stream_->codecpar->width;
    stored.height_px = stream_->codecpar->height;
  }
  if (stored.rate_hz == 0.0 && stream_->avg_frame_rate.num > 0 && stream_->avg_frame_rate.den > 0) {
    stored.rate_hz = av_q2d(stream_->avg_frame_rate);
  }
  calibration_ = options_.CalibrationOfFrames(stored);
  if (stream_->codecpar->width != stored.width_px || stream_->codecpar->height != stored.height_px) {
    return InvalidArgument(path_ + ": the video is " + SizeText(stream_->codecpar->width, stream_->codecpar->height) +
                           ", the calibration (" + companions_.calibration_path + ") is for " +
                           SizeText(stored.width_px, stored.height_px));
  }

  codec_.reset(avcodec_alloc_context3(decoder));
  packet_.reset(av_packet_alloc());
  picture_.reset(av_frame_alloc());
  if (codec_ == nullptr || packet_ == nullptr || picture_ == nullptr) return Unavailable(path_ + ": out of memory");
  int error = avcodec_parameters_to_context(codec_.get(), stream_->codecpar);
  codec_->thread_count = 1;  // the cores belong to tracking and mapping
  codec_->err_recognition = AV_EF_CRCCHECK | AV_EF_BITSTREAM | AV_EF_BUFFER;
  if (error >= 0) error = avcodec_open2(codec_.get(), decoder, nullptr);
  if (error < 0) return InvalidArgument(path_ + ": the decoder cannot be opened: " + ErrorText(error));
  CountFrames();
  return Status::Ok();
}

void VideoSource::CountFrames() {
  const std::int64_t num_stored = NumStored(*format_, *stream_);
  if (num_stored <= options_.first_frame || num_stored > std::numeric_limits<std::uint32_t>::max()) return;
  const std::int64_t last = std::min<std::int64_t>(options_.last_frame, num_stored - 1);
  num_frames_ = static_cast<std::uint32_t>((last - options_.first_frame) / options_.every_nth + 1);
}

Decoded VideoSource::Decode(std::string* why) {
  for (;;) {
    const int received = avcodec_receive_frame(codec_.get(), picture_.get());
    if (received == 0) {
      const bool is_corrupt = (picture_->flags & AV_FRAME_FLAG_CORRUPT) != 0 || picture_->decode_error_flags != 0;
      if (is_corrupt) *why = "the decoder marks the picture as corrupt";
      return is_corrupt ? Decoded::kLost : Decoded::kPicture;
    }
    if (received == AVERROR_EOF) return Decoded::kEnd;
    if (received != AVERROR(EAGAIN)) {
      *why = ErrorText(received);
      return Decoded::kLost;
    }
    if (is_draining_) return Decoded::kEnd;
    const int read = av_read_frame(format_.get(), packet_.get());
    if (read < 0) {
      // Also after a read error the pictures that the decoder still holds come out.
      is_draining_ = true;
      avcodec_send_packet(codec_.get(), nullptr);
      if (read == AVERROR_EOF) continue;
      *why = "the recording cannot be read further: " + ErrorText(read);
      return Decoded::kLost;
    }
    const bool is_ours = packet_->stream_index == stream_->index;
    const int sent = is_ours ? avcodec_send_packet(codec_.get(), packet_.get()) : 0;
    av_packet_unref(packet_.get());
    if (sent < 0 && sent != AVERROR(EAGAIN)) {
      *why = ErrorText(sent);
      return Decoded::kLost;
    }
  }
}

std::int64_t VideoSource::Period() const {
  const AVRational rate = stream_->avg_frame_rate;
  return rate.num > 0 && rate.den > 0 ? av_rescale_q(1, av_inv_q(rate), kNanosecond) : 0;
}

std::optional<std::int64_t> VideoSource::TakeStamp() {
  const std::int64_t pts = picture_->best_effort_timestamp;
  const std::int64_t period_ns = Period();
  if (pts == AV_NOPTS_VALUE) {
    // MPEG streams need not stamp every picture: one without follows at the rate of the stream.
    if (last_stamp_ns_ < 0 || period_ns == 0) return std::nullopt;
    return last_stamp_ns_ += period_ns;
  }
  if (!first_pts_) first_pts_ = stream_->start_time != AV_NOPTS_VALUE ? std::min(stream_->start_time, pts) : pts;
  // Damaged stamps may be any numbers.
  std::int64_t stamp_ns =
      av_sat_add64(first_ns_, av_rescale_q(av_sat_sub64(pts, *first_pts_), stream_->time_base, kNanosecond));
  const std::int64_t step_ns = av_sat_sub64(stamp_ns, last_stamp_ns_);
  // Of a stream with few pictures a long step is none.
  const bool is_jump = step_ns < -kJumpBackNs || step_ns > std::max(kJumpAheadNs, 10 * period_ns);
  if (is_jump && last_stamp_ns_ >= 0 && period_ns > 0) {
    if (num_jumps_++ == 0) first_jump_ = next_stored_ - 1;
    refused_ns_ = stamp_ns;
    stamp_ns = first_ns_ = last_stamp_ns_ + period_ns;
    first_pts_ = pts;
  }
  if (stamp_ns <= last_stamp_ns_) return std::nullopt;
  last_stamp_ns_ = stamp_ns;
  return stamp_ns;
}

std::string VideoSource::StampRemark() const {
  if (num_jumps_ == 0) return "";
  const std::string times =
      num_jumps_ == 1 ? "once, at frame " : std::to_string(num_jumps_) + " times, first at frame ";
  return path_ + ": the time stamps jump " + times + std::to_string(first_jump_) +
         ", as where recordings were joined; the times go on at the rate of the stream";
}

Status VideoSource::Convert() {
  const int width = companions_.calibration.width_px;
  const int height = companions_.calibration.height_px;
  if (picture_->width != width || picture_->height != height) {
    return DataLoss("the picture is " + SizeText(picture_->width, picture_->height) + ", the video began with " +
                    SizeText(width, height));
  }
  const bool grey = options_.channels == ChannelChoice::kGrey;
  stored_.Resize(width, height, grey ? PixelFormat::kGrey8 : PixelFormat::kBgr8);
  // Bit-exact, so that a recording gives the same pixels on every machine.
  constexpr int kFlags = SWS_BILINEAR | SWS_ACCURATE_RND | SWS_FULL_CHR_H_INT | SWS_BITEXACT;
  SwsContext* previous = scaler_.release();
  scaler_.reset(sws_getCachedContext(previous, width, height, static_cast<AVPixelFormat>(picture_->format), width,
                                     height, grey ? AV_PIX_FMT_GRAY8 : AV_PIX_FMT_BGR24, kFlags, nullptr, nullptr,
                                     nullptr));
  if (scaler_ == nullptr) return DataLoss("the picture has a pixel format that cannot be converted");
  // Recorders often leave the colour matrix open; then the one that is usual for the size.
  int matrix = picture_->colorspace;
  if (matrix == AVCOL_SPC_UNSPECIFIED) matrix = height >= 720 ? SWS_CS_ITU709 : SWS_CS_ITU601;
  const int full_range_in = picture_->color_range == AVCOL_RANGE_JPEG ? 1 : 0;
  constexpr int kUnity = 1 << 16;
  sws_setColorspaceDetails(scaler_.get(), sws_getCoefficients(matrix), full_range_in,
                           sws_getCoefficients(SWS_CS_DEFAULT), 1, 0, kUnity, kUnity);
  std::uint8_t* rows[4] = {stored_.row(0), nullptr, nullptr, nullptr};
  const int pitches[4] = {static_cast<int>(stored_.pitch_bytes()), 0, 0, 0};
  sws_scale(scaler_.get(), picture_->data, picture_->linesize, 0, height, rows, pitches);
  return Status::Ok();
}

Result<Frame> VideoSource::Next(TimePoint) {
  for (;;) {
    if (next_stored_ > options_.last_frame) return NotFound(path_ + ": the end of the chosen part");
    std::string why;
    const Decoded decoded = Decode(&why);
    if (decoded == Decoded::kEnd) return NotFound(path_ + ": the recording is over");
    const std::uint32_t stored_idx = next_stored_++;
    const std::optional<std::int64_t> stamp = decoded == Decoded::kPicture ? TakeStamp() : std::nullopt;
    if (stored_idx < options_.first_frame || (stored_idx - options_.first_frame) % options_.every_nth != 0) continue;

    const std::string here = path_ + ": frame " + std::to_string(stored_idx) + ": ";
    if (decoded == Decoded::kLost) return DataLoss(here + why);
    if (!stamp) return DataLoss(here + "its time stamp is missing or not after that of the frame before");
    if (const Status status = Convert(); !status.ok()) return DataLoss(here + status.message());
    Frame frame;
    frame.shows_one_field = deinterlacer_.WantsTopField(stored_.view());
    if (frame.shows_one_field) KeepTopField(&stored_);
    if (options_.halve) HalveImage(stored_.view(), &half_);
    frame.index = (stored_idx - options_.first_frame) / options_.every_nth;
    frame.timestamp = TimePoint(Duration(*stamp));
    if (refused_ns_) frame.refused_stamp = TimePoint(Duration(*std::exchange(refused_ns_, std::nullopt)));
    frame.image = options_.halve ? half_.view() : stored_.view();
    return frame;
  }
}

}  // namespace

bool HasVideoSupport() { return true; }

std::string StampRemark(const FrameSource& source) {
  const auto* video = dynamic_cast<const VideoSource*>(&source);
  return video != nullptr ? video->StampRemark() : std::string();
}

Result<std::unique_ptr<FrameSource>> OpenVideo(const std::string& path, const SequenceOptions& options) {
  HAUSTRA_TRY(options.RefuseFrameRate(path));
  if (options.reversed) return InvalidArgument(path + ": a recording cannot be read backwards, only image files can");
  return VideoSource::Open(path, options);
}

}  // namespace haustra
