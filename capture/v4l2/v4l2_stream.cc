#include "capture/v4l2/v4l2_stream.h"

#include <fcntl.h>
#include <linux/dma-buf.h>
#include <linux/dma-heap.h>
#include <linux/videodev2.h>
#include <poll.h>

#include <algorithm>
#include <array>
#include <cerrno>
#include <cmath>
#include <utility>

#include "capture/number.h"
#include "capture/v4l2/device_list.h"
#include "capture/v4l2/device_text.h"
#include "hal/core/errno_text.h"

namespace haustra::capture::internal {
namespace {

using Rows = V4l2Format::Rows;

constexpr std::uint32_t kCapture = V4L2_BUF_TYPE_VIDEO_CAPTURE;
constexpr const char* kDmaHeap = "/dev/dma_heap/system";
// 29.97 Hz is what is meant by 30.
constexpr double kRateTolerance = 2e-3;

// In the order of what they cost per frame: bytes to move, then work to get at the luma.
constexpr std::array<std::uint32_t, 5> kPreference = {V4L2_PIX_FMT_GREY, V4L2_PIX_FMT_NV12, V4L2_PIX_FMT_YUYV,
                                                      V4L2_PIX_FMT_UYVY, V4L2_PIX_FMT_MJPEG};

int BytesPerLumaPixel(std::uint32_t fourcc) {
  return fourcc == V4L2_PIX_FMT_YUYV || fourcc == V4L2_PIX_FMT_UYVY ? 2 : 1;
}

const char* FieldName(std::uint32_t field) {
  switch (field) {
    case V4L2_FIELD_TOP: return "the top field only";
    case V4L2_FIELD_BOTTOM: return "the bottom field only";
    case V4L2_FIELD_ALTERNATE: return "fields one by one";
    case V4L2_FIELD_SEQ_TB:
    case V4L2_FIELD_SEQ_BT: return "one field after the other";
    default: return "interlaced";
  }
}

Rows RowsOf(std::uint32_t field) {
  switch (field) {
    case V4L2_FIELD_ANY:
    case V4L2_FIELD_NONE: return Rows::kProgressive;
    case V4L2_FIELD_SEQ_TB: return Rows::kTopThenBottom;
    case V4L2_FIELD_SEQ_BT: return Rows::kBottomThenTop;
    case V4L2_FIELD_TOP:
    case V4L2_FIELD_BOTTOM:
    case V4L2_FIELD_ALTERNATE: return Rows::kOneField;
    default: return Rows::kInterleaved;
  }
}

bool IsOneField(std::uint32_t field) {
  return field == V4L2_FIELD_TOP || field == V4L2_FIELD_BOTTOM || field == V4L2_FIELD_ALTERNATE;
}

std::string FormatText(const v4l2_pix_format& pix) {
  return FourccText(pix.pixelformat) + " " + SizeText(static_cast<int>(pix.width), static_cast<int>(pix.height));
}

bool CanReach(const std::vector<double>& rates_hz, double wanted_hz) {
  return wanted_hz <= 0.0 || rates_hz.empty() || rates_hz.front() >= wanted_hz * (1.0 - kRateTolerance);
}

}  // namespace

Status V4l2Stream::Failed(const char* call, int error) const {
  return Unavailable(path_ + ": " + call + ": " + ErrnoText(-error));
}

Result<std::unique_ptr<V4l2Stream>> V4l2Stream::Open(const V4l2Options& options, int wanted_width_px,
                                                     int wanted_height_px, double preferred_rate_hz, DeviceIo& io) {
  HAUSTRA_ASSIGN(const std::string path, FindV4l2Device(options.device, io));
  std::unique_ptr<V4l2Stream> stream(new V4l2Stream(path, options, io));
  HAUSTRA_TRY(stream->OpenDevice());
  HAUSTRA_TRY(stream->ChooseInput());
  HAUSTRA_TRY(stream->FollowSignal());
  if (options.width_px > 0) {
    wanted_width_px = options.width_px;
    wanted_height_px = options.height_px;
  }
  HAUSTRA_TRY(stream->ChooseFormat(wanted_width_px, wanted_height_px, preferred_rate_hz));
  HAUSTRA_TRY(stream->SetRate(preferred_rate_hz));
  HAUSTRA_TRY(stream->TakeBuffers());
  return stream;
}

V4l2Stream::~V4l2Stream() {
  if (fd_ < 0) return;
  // On a device that has gone these fail, and there is nothing more to be done.
  int type = static_cast<int>(kCapture);
  if (is_streaming_) io_.Ioctl(fd_, VIDIOC_STREAMOFF, &type);
  ReleaseBuffers();
  io_.Close(fd_);
}

Status V4l2Stream::OpenDevice() {
  fd_ = io_.Open(path_);
  if (fd_ < 0) return Failed("open", fd_);
  v4l2_capability capability{};
  if (const int error = io_.Ioctl(fd_, VIDIOC_QUERYCAP, &capability); error < 0) {
    if (error == -ENOTTY) return InvalidArgument(path_ + ": not a video device");
    return Failed("VIDIOC_QUERYCAP", error);
  }
  name_ = DeviceText(capability.card);
  const __u32 has =
      (capability.capabilities & V4L2_CAP_DEVICE_CAPS) != 0 ? capability.device_caps : capability.capabilities;
  if ((has & V4L2_CAP_VIDEO_CAPTURE) == 0) {
    return InvalidArgument(path_ + ": " + name_ +
                           ((has & V4L2_CAP_VIDEO_CAPTURE_MPLANE) != 0 ? " has pictures in several planes only"
                                                                       : " does not capture pictures"));
  }
  if ((has & V4L2_CAP_STREAMING) == 0) return InvalidArgument(path_ + ": " + name_ + " has no mapped buffers");
  return Status::Ok();
}

Status V4l2Stream::ChooseInput() {
  if (options_.input.empty()) return Status::Ok();
  const Result<std::int64_t> number = ParseInteger(options_.input);
  std::string there;
  for (__u32 i = 0; i < 64; ++i) {
    v4l2_input input{};
    input.index = i;
    if (io_.Ioctl(fd_, VIDIOC_ENUMINPUT, &input) < 0) break;
    const std::string name = DeviceText(input.name);
    if (name == options_.input || (number.ok() && *number == static_cast<std::int64_t>(i))) {
      int index = static_cast<int>(i);
      const int error = io_.Ioctl(fd_, VIDIOC_S_INPUT, &index);
      return error < 0 ? Failed("VIDIOC_S_INPUT", error) : Status::Ok();
    }
    there += (there.empty() ? "" : ", ") + std::to_string(i) + " '" + name + "'";
  }
  return InvalidArgument(path_ + ": no input '" + options_.input + "'; there are " + (there.empty() ? "none" : there));
}

Status V4l2Stream::FollowSignal() {
  int index = 0;
  v4l2_input input{};
  if (io_.Ioctl(fd_, VIDIOC_G_INPUT, &index) < 0) return Status::Ok();
  input.index = input_ = static_cast<__u32>(index);
  if (io_.Ioctl(fd_, VIDIOC_ENUMINPUT, &input) < 0 || (input.capabilities & V4L2_IN_CAP_DV_TIMINGS) == 0) {
    return Status::Ok();
  }
  v4l2_dv_timings timings{};
  if (const int error = io_.Ioctl(fd_, VIDIOC_QUERY_DV_TIMINGS, &timings); error < 0) {
    // Not every receiver can look; then what is set counts.
    if (error == -ENOTTY || error == -ENODATA) return Status::Ok();
    if (error == -ENOLINK || error == -ENOLCK || error == -ERANGE) {
      return Unavailable(path_ + ": no signal on input '" + DeviceText(input.name) + "' (" + ErrnoText(-error) + ")");
    }
    return Failed("VIDIOC_QUERY_DV_TIMINGS", error);
  }
  if (const int error = io_.Ioctl(fd_, VIDIOC_S_DV_TIMINGS, &timings); error < 0) {
    return Failed("VIDIOC_S_DV_TIMINGS", error);
  }
  const v4l2_bt_timings& bt = timings.bt;
  const double pixels =
      static_cast<double>(bt.width + bt.hfrontporch + bt.hsync + bt.hbackporch) *
      (bt.height + bt.vfrontporch + bt.vsync + bt.vbackporch + bt.il_vfrontporch + bt.il_vsync + bt.il_vbackporch);
  if (pixels > 0) format_.rate_hz = static_cast<double>(bt.pixelclock) / pixels;
  return Status::Ok();
}

Status V4l2Stream::ChooseFormat(int width_px, int height_px, double preferred_rate_hz) {
  if (width_px == 0) {
    v4l2_format current{};
    current.type = kCapture;
    if (const int error = io_.Ioctl(fd_, VIDIOC_G_FMT, &current); error < 0) return Failed("VIDIOC_G_FMT", error);
    width_px = static_cast<int>(current.fmt.pix.width);
    height_px = static_cast<int>(current.fmt.pix.height);
  }
  const std::vector<V4l2FormatInfo> offered = ListFormats(fd_, io_);
  const double rate_hz = options_.rate_hz > 0.0 ? options_.rate_hz : preferred_rate_hz;
  // First those that are fast enough; a rate that was only preferred must not stand in the way of a picture.
  for (const bool at_full_rate : {true, false}) {
    if (!at_full_rate && options_.rate_hz > 0.0) break;
    for (const std::uint32_t fourcc : kPreference) {
      if (options_.format != 0 && fourcc != options_.format) continue;
      const bool is_offered =
          std::any_of(offered.begin(), offered.end(), [&](const V4l2FormatInfo& f) { return f.fourcc == fourcc; });
      if (!is_offered) continue;
      if (at_full_rate && !CanReach(ListRates(fd_, fourcc, width_px, height_px, io_), rate_hz)) continue;
      v4l2_format attempt{};
      attempt.type = kCapture;
      attempt.fmt.pix.width = static_cast<__u32>(width_px);
      attempt.fmt.pix.height = static_cast<__u32>(height_px);
      attempt.fmt.pix.pixelformat = fourcc;
      attempt.fmt.pix.field =
          options_.field == FieldChoice::kProgressive ? __u32{V4L2_FIELD_NONE} : __u32{V4L2_FIELD_INTERLACED};
      // Drivers without TRY_FMT (ENOTTY) tell with S_FMT.
      const int error = io_.Ioctl(fd_, VIDIOC_TRY_FMT, &attempt);
      if (error == -ENODEV) return Failed("VIDIOC_TRY_FMT", error);
      const v4l2_pix_format& pix = attempt.fmt.pix;
      const auto height = static_cast<__u32>(height_px);
      const bool fits = pix.pixelformat == fourcc && pix.width == static_cast<__u32>(width_px) &&
                        (pix.height == height || (IsOneField(pix.field) && 2 * pix.height == height));
      if (error == 0 && !fits) continue;
      return SetFormat(fourcc, width_px, height_px);
    }
  }
  std::string wanted = SizeText(width_px, height_px);
  if (options_.format != 0) wanted = FourccText(options_.format) + " " + wanted;
  if (options_.rate_hz > 0.0) wanted += " at " + FormatDouble(options_.rate_hz) + " Hz";
  return Unavailable(path_ + ": " + name_ + " does not offer " + wanted + "; it offers " + FormatsText(offered));
}

Status V4l2Stream::SetFormat(std::uint32_t fourcc, int width_px, int height_px) {
  const bool wants_field = options_.field != FieldChoice::kProgressive;
  v4l2_format format{};
  format.type = kCapture;
  format.fmt.pix.width = static_cast<__u32>(width_px);
  format.fmt.pix.height = static_cast<__u32>(height_px);
  format.fmt.pix.pixelformat = fourcc;
  format.fmt.pix.field = wants_field ? V4L2_FIELD_INTERLACED : V4L2_FIELD_NONE;
  if (const int error = io_.Ioctl(fd_, VIDIOC_S_FMT, &format); error < 0) {
    if (error == -EBUSY) return Unavailable(path_ + ": another program uses the camera");
    return Failed("VIDIOC_S_FMT", error);
  }
  const v4l2_pix_format& pix = format.fmt.pix;
  const std::string got = FormatText(pix);
  if (pix.pixelformat != fourcc || pix.width != static_cast<__u32>(width_px)) {
    return Unavailable(path_ + ": asked for " + FourccText(fourcc) + " " + SizeText(width_px, height_px) +
                       ", the camera sends " + got);
  }
  format_.rows = RowsOf(pix.field);
  if (format_.rows != Rows::kProgressive && !wants_field) {
    return Unavailable(path_ + ": the camera sends " + got + " " + FieldName(pix.field) +
                       "; set it to progressive, or choose field=top or field=bottom and halve the picture");
  }
  if (format_.rows == Rows::kProgressive && wants_field) {
    return Unavailable(path_ + ": the camera sends progressive pictures; leave out field=");
  }
  if (fourcc == V4L2_PIX_FMT_MJPEG && wants_field) {
    return Unavailable(path_ + ": fields of MJPEG pictures are not read; choose another format");
  }
  const bool is_half = static_cast<int>(pix.height) * 2 == height_px && format_.rows == Rows::kOneField;
  if (static_cast<int>(pix.height) != height_px && !is_half) {
    return Unavailable(path_ + ": asked for " + SizeText(width_px, height_px) + ", the camera sends " + got);
  }
  return TakeLayout(pix);
}

Status V4l2Stream::TakeLayout(const v4l2_pix_format& pix) {
  const std::uint32_t fourcc = pix.pixelformat;
  format_.fourcc = fourcc;
  format_.width_px = static_cast<int>(pix.width);
  format_.height_px = static_cast<int>(pix.height);
  format_.buffer_bytes = pix.sizeimage;
  if (fourcc == V4L2_PIX_FMT_MJPEG) {
    format_.pitch_bytes = 0;
    format_.min_bytes = 1;
    return Status::Ok();
  }
  const int row_bytes = format_.width_px * BytesPerLumaPixel(fourcc);
  // Some drivers leave it empty.
  format_.pitch_bytes =
      pix.bytesperline > 0 ? static_cast<int>(std::min<__u32>(pix.bytesperline, 1u << 20)) : row_bytes;
  if (format_.pitch_bytes < row_bytes) {
    return InvalidArgument(path_ + ": rows of " + std::to_string(format_.pitch_bytes) + " bytes are too short for " +
                           FormatText(pix));
  }
  const std::size_t rows = static_cast<std::size_t>(format_.height_px) +
                           (fourcc == V4L2_PIX_FMT_NV12 ? static_cast<std::size_t>(format_.height_px + 1) / 2 : 0);
  // The last row need not be padded.
  format_.min_bytes = (rows - 1) * static_cast<std::size_t>(format_.pitch_bytes) + static_cast<std::size_t>(row_bytes);
  return Status::Ok();
}

Status V4l2Stream::SetRate(double preferred_rate_hz) {
  const double wanted = options_.rate_hz > 0.0 ? options_.rate_hz : preferred_rate_hz;
  v4l2_streamparm parameters{};
  parameters.type = kCapture;
  if (io_.Ioctl(fd_, VIDIOC_G_PARM, &parameters) == 0) {
    v4l2_captureparm& capture = parameters.parm.capture;
    if (wanted > 0.0 && (capture.capability & V4L2_CAP_TIMEPERFRAME) != 0) {
      capture.timeperframe = {1000, static_cast<__u32>(std::lround(1000.0 * wanted))};
      const int error = io_.Ioctl(fd_, VIDIOC_S_PARM, &parameters);
      if (error < 0 && (options_.rate_hz > 0.0 || error == -ENODEV)) return Failed("VIDIOC_S_PARM", error);
      // A rate that was only preferred and is refused: the camera says again which one it has.
      if (error < 0 && io_.Ioctl(fd_, VIDIOC_G_PARM, &parameters) < 0) capture.timeperframe = {};
    }
    if (capture.timeperframe.numerator > 0 && capture.timeperframe.denominator > 0) {
      format_.rate_hz =
          static_cast<double>(capture.timeperframe.denominator) / static_cast<double>(capture.timeperframe.numerator);
    }
  }
  if (options_.rate_hz > 0.0 && format_.rate_hz > 0.0 && std::abs(format_.rate_hz - wanted) > wanted * kRateTolerance) {
    return Unavailable(path_ + ": asked for " + FormatDouble(wanted) + " Hz, the camera sends " +
                       FormatDouble(format_.rate_hz) + " Hz");
  }
  return Status::Ok();
}

Status V4l2Stream::TakeBuffers() {
  if (options_.memory == BufferMemory::kDmaBuf) {
    Status status = ImportBuffers();
    if (status.ok()) status = QueueBuffers();
    if (status.ok()) return status;
    not_imported_ = status.message();
    ReleaseBuffers();
  }
  HAUSTRA_TRY(MapBuffers());
  return QueueBuffers();
}

Result<std::uint32_t> V4l2Stream::RequestBuffers(std::uint32_t memory) {
  v4l2_requestbuffers request{};
  request.count = static_cast<__u32>(options_.num_buffers);
  request.type = kCapture;
  request.memory = memory;
  if (const int error = io_.Ioctl(fd_, VIDIOC_REQBUFS, &request); error < 0) {
    if (error == -EBUSY) return Unavailable(path_ + ": another program uses the camera");
    return Failed("VIDIOC_REQBUFS", error);
  }
  if (request.count < 2)
    return Unavailable(path_ + ": the driver has memory for " + std::to_string(request.count) + " buffers");
  return request.count;
}

Status V4l2Stream::ImportBuffers() {
  is_imported_ = true;
  const int heap = io_.Open(kDmaHeap);
  if (heap < 0) return Unavailable(std::string(kDmaHeap) + ": " + ErrnoText(-heap));
  const auto fill = [&]() -> Status {
    HAUSTRA_ASSIGN(const std::uint32_t count, RequestBuffers(V4L2_MEMORY_DMABUF));
    for (std::uint32_t i = 0; i < count; ++i) {
      dma_heap_allocation_data data{};
      data.len = std::max(format_.buffer_bytes, format_.min_bytes);
      data.fd_flags = O_RDWR | O_CLOEXEC;
      if (const int error = io_.Ioctl(heap, DMA_HEAP_IOCTL_ALLOC, &data); error < 0)
        return Unavailable(std::string(kDmaHeap) + ": " + ErrnoText(-error));
      buffers_.push_back({nullptr, data.len, static_cast<int>(data.fd)});
      buffers_.back().address = io_.Map(buffers_.back().dma_fd, data.len, 0);
      if (buffers_.back().address == nullptr) return Unavailable(std::string(kDmaHeap) + ": memory cannot be mapped");
    }
    return Status::Ok();
  };
  Status status = fill();
  io_.Close(heap);
  return status;
}

Status V4l2Stream::MapBuffers() {
  HAUSTRA_ASSIGN(const std::uint32_t count, RequestBuffers(V4L2_MEMORY_MMAP));
  for (std::uint32_t i = 0; i < count; ++i) {
    v4l2_buffer buffer{};
    buffer.type = kCapture;
    buffer.memory = V4L2_MEMORY_MMAP;
    buffer.index = i;
    if (const int error = io_.Ioctl(fd_, VIDIOC_QUERYBUF, &buffer); error < 0) return Failed("VIDIOC_QUERYBUF", error);
    if (buffer.length < format_.min_bytes) {
      return InvalidArgument(path_ + ": buffers of " + std::to_string(buffer.length) + " bytes for pictures of " +
                             std::to_string(format_.min_bytes));
    }
    void* address = io_.Map(fd_, buffer.length, buffer.m.offset);
    if (address == nullptr) return Unavailable(path_ + ": a buffer of the camera cannot be mapped");
    buffers_.push_back({address, buffer.length});
  }
  return Status::Ok();
}

Status V4l2Stream::QueueBuffers() {
  for (std::uint32_t i = 0; i < buffers_.size(); ++i) {
    if (const int error = Queue(i); error < 0) return Failed("VIDIOC_QBUF", error);
  }
  return Status::Ok();
}

void V4l2Stream::ReleaseBuffers() {
  for (const Buffer& buffer : buffers_) {
    if (buffer.address != nullptr) {
      // The driver may keep the memory for whoever comes next.
      Sync(buffer, DMA_BUF_SYNC_START | DMA_BUF_SYNC_WRITE);
      ::explicit_bzero(buffer.address, buffer.length);
      Sync(buffer, DMA_BUF_SYNC_END | DMA_BUF_SYNC_WRITE);
      io_.Unmap(buffer.address, buffer.length);
    }
    if (buffer.dma_fd >= 0) io_.Close(buffer.dma_fd);
  }
  v4l2_requestbuffers none{};
  none.type = kCapture;
  none.memory = memory();
  if (!buffers_.empty()) io_.Ioctl(fd_, VIDIOC_REQBUFS, &none);
  buffers_.clear();
  is_imported_ = false;
}

std::uint32_t V4l2Stream::memory() const { return is_imported_ ? V4L2_MEMORY_DMABUF : V4L2_MEMORY_MMAP; }

std::string V4l2Stream::MemoryText() const {
  if (is_imported_) return "imported buffers";
  return not_imported_.empty() ? "mapped buffers" : "mapped buffers (no DMA-BUF: " + not_imported_ + ")";
}

Status V4l2Stream::Start() {
  // A receiver says by an event, which bears the number of the input, that the signal has changed. Not all have it.
  v4l2_event_subscription subscription{};
  subscription.type = V4L2_EVENT_SOURCE_CHANGE;
  subscription.id = input_;
  io_.Ioctl(fd_, VIDIOC_SUBSCRIBE_EVENT, &subscription);
  begin_ = io_.Now();
  int type = static_cast<int>(kCapture);
  if (const int error = io_.Ioctl(fd_, VIDIOC_STREAMON, &type); error < 0) return Failed("VIDIOC_STREAMON", error);
  is_streaming_ = true;
  return Status::Ok();
}

Result<V4l2Picture> V4l2Stream::Dequeue(TimePoint deadline) {
  while (true) {
    if (give_back_error_ < 0) return Failed("VIDIOC_QBUF", give_back_error_);
    const TimePoint now = io_.Now();
    short found = 0;  // NOLINT(google-runtime-int): poll's type
    const int num_found = io_.Poll(fd_, POLLIN | POLLPRI, std::max(Duration(0), deadline - now), &found);
    if (num_found < 0) return Failed("poll", num_found);
    if ((found & POLLPRI) != 0) HAUSTRA_TRY(HandleEvents());
    // On POLLERR and POLLHUP the dequeue says what has happened.
    if ((found & (POLLIN | POLLERR | POLLHUP | POLLNVAL)) != 0) {
      Result<V4l2Picture> picture = TryDequeue();
      if (picture.code() != StatusCode::kDeadlineExceeded) return picture;
      if ((found & POLLIN) == 0) return Unavailable(path_ + ": the camera has stopped");
    }
    if (io_.Now() >= deadline) return Status(StatusCode::kDeadlineExceeded);
  }
}

Result<V4l2Picture> V4l2Stream::TryDequeue() {
  v4l2_buffer buffer{};
  buffer.type = kCapture;
  buffer.memory = memory();
  if (const int error = io_.Ioctl(fd_, VIDIOC_DQBUF, &buffer); error < 0) {
    if (error == -EAGAIN) return Status(StatusCode::kDeadlineExceeded);
    return Failed("VIDIOC_DQBUF", error);
  }
  if (buffer.index >= buffers_.size()) {
    return Unavailable(path_ + ": the driver gave buffer " + std::to_string(buffer.index) + " of " +
                       std::to_string(buffers_.size()));
  }
  V4l2Picture picture;
  picture.buffer = buffer.index;
  const Buffer& memory = buffers_[buffer.index];
  Sync(memory, DMA_BUF_SYNC_START);
  // Drivers of raw formats may leave bytesused empty.
  const bool is_raw = format_.fourcc != V4L2_PIX_FMT_MJPEG;
  const std::size_t num_bytes =
      buffer.bytesused == 0 && is_raw ? memory.length : std::min<std::size_t>(buffer.bytesused, memory.length);
  picture.bytes = {static_cast<const std::uint8_t*>(memory.address), num_bytes};
  picture.sequence = buffer.sequence;
  picture.is_damaged = (buffer.flags & V4L2_BUF_FLAG_ERROR) != 0 || num_bytes < format_.min_bytes;
  const TimePoint now = io_.Now();
  const TimePoint stamp(std::chrono::seconds(buffer.timestamp.tv_sec) +
                        std::chrono::microseconds(buffer.timestamp.tv_usec));
  // A stamp from before the stream began, or from the future, is of another clock, whatever the flag says. Once taken,
  // one that lies ahead would make all pictures too early until the clock gets there.
  const bool is_monotonic = (buffer.flags & V4L2_BUF_FLAG_TIMESTAMP_MASK) == V4L2_BUF_FLAG_TIMESTAMP_MONOTONIC;
  picture.is_stamped = is_monotonic && stamp >= begin_ && stamp <= now;
  picture.timestamp = picture.is_stamped ? stamp : now;
  if (is_monotonic && !picture.is_stamped) picture.refused_stamp = stamp;
  if (format_.rows == Rows::kOneField) {
    const __u32 chosen = options_.field == FieldChoice::kTop ? V4L2_FIELD_TOP : V4L2_FIELD_BOTTOM;
    picture.is_other_field = buffer.field != chosen;
  }
  return picture;
}

void V4l2Stream::GiveBack(const V4l2Picture& picture) {
  Sync(buffers_[picture.buffer], DMA_BUF_SYNC_END);
  const int error = Queue(picture.buffer);
  if (error < 0 && give_back_error_ == 0) give_back_error_ = error;
}

int V4l2Stream::Queue(std::uint32_t index) {
  v4l2_buffer buffer{};
  buffer.type = kCapture;
  buffer.memory = memory();
  buffer.index = index;
  if (is_imported_) {
    buffer.m.fd = buffers_[index].dma_fd;
    buffer.length = static_cast<__u32>(buffers_[index].length);
  }
  return io_.Ioctl(fd_, VIDIOC_QBUF, &buffer);
}

// What it answers is of no use: the picture is there, and at worst shows an older one.
void V4l2Stream::Sync(const Buffer& buffer, std::uint64_t flags) {
  if (!is_imported_) return;
  dma_buf_sync sync{flags | DMA_BUF_SYNC_READ};
  io_.Ioctl(buffer.dma_fd, DMA_BUF_IOCTL_SYNC, &sync);
}

Result<int> V4l2Stream::Export(const V4l2Picture& picture) {
  Buffer& buffer = buffers_[picture.buffer];
  if (buffer.dma_fd >= 0) return buffer.dma_fd;
  v4l2_exportbuffer exported{};
  exported.type = kCapture;
  exported.index = picture.buffer;
  exported.flags = O_RDONLY | O_CLOEXEC;
  if (const int error = io_.Ioctl(fd_, VIDIOC_EXPBUF, &exported); error < 0) return Failed("VIDIOC_EXPBUF", error);
  buffer.dma_fd = exported.fd;
  return buffer.dma_fd;
}

Status V4l2Stream::HandleEvents() {
  v4l2_event event{};
  for (int i = 0; i < 16 && io_.Ioctl(fd_, VIDIOC_DQEVENT, &event) == 0; ++i) {
    if (event.type == V4L2_EVENT_SOURCE_CHANGE) return Unavailable(path_ + ": the signal has changed");
    if (event.pending == 0) break;
  }
  return Status::Ok();
}

}  // namespace haustra::capture::internal
