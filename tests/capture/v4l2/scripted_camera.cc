#include "tests/capture/v4l2/scripted_camera.h"

#include <linux/dma-buf.h>
#include <linux/dma-heap.h>
#include <poll.h>

#include <algorithm>
#include <cerrno>
#include <cmath>
#include <cstring>

namespace haustra::test {
namespace {

v4l2_fract Interval(double rate_hz) { return {1000, static_cast<__u32>(std::lround(rate_hz * 1000.0))}; }

// A field that the text fills has no zero at its end.
template <std::size_t N>
void Put(const std::string& text, __u8 (&to)[N]) {
  std::memset(to, 0, N);
  std::memcpy(to, text.data(), std::min(text.size(), N));
}

bool IsPaired(std::uint32_t fourcc) { return fourcc == V4L2_PIX_FMT_YUYV || fourcc == V4L2_PIX_FMT_UYVY; }

}  // namespace

std::vector<std::string> ScriptedCamera::DevicePaths() {
  if (!is_present) return {};
  return std::vector<std::string>(has_twin ? 2 : 1, path);
}

bool ScriptedCamera::Fails(int* error) {
  *error = failure;
  return num_calls++ == failing_call;
}

int ScriptedCamera::Open(const std::string& wanted) {
  if (on_call) on_call(0);
  if (int error = 0; Fails(&error)) return error;
  if (wanted == "/dev/dma_heap/system") {
    if (has_heap) ++num_opened;
    return has_heap ? kHeapFd : -ENOENT;
  }
  if (!is_present || wanted != path) return -ENOENT;
  is_open_ = true;
  ++num_opened;
  return kFd;
}

void ScriptedCamera::Close(int fd) {
  if (on_call) on_call(0);
  --num_opened;
  heap_.erase(fd);
  exported_.erase(fd);
  if (fd == kFd) is_open_ = is_streaming_ = false;
}

int ScriptedCamera::Ioctl(int fd, unsigned long request, void* argument) {
  if (on_call) on_call(request);
  const bool is_of_heap = fd == kHeapFd || heap_.contains(fd);
  if (!is_of_heap && (fd != kFd || !is_open_)) return -EBADF;
  if (int error = 0; Fails(&error)) return error;
  if (is_of_heap) return fd == kHeapFd ? AnswerOfHeap(request, argument) : Sync(fd, argument);
  if (!is_present) return -ENODEV;
  return Answer(request, argument);
}

int ScriptedCamera::AnswerOfHeap(unsigned long request, void* argument) {
  if (request != DMA_HEAP_IOCTL_ALLOC) return -ENOTTY;
  auto* wanted = static_cast<dma_heap_allocation_data*>(argument);
  const int fd = kFirstDmaFd + num_calls;  // a new one each time
  heap_[fd].resize(wanted->len);
  wanted->fd = static_cast<__u32>(fd);
  ++num_opened;
  return 0;
}

int ScriptedCamera::Sync(int fd, void* argument) {
  const std::uint64_t flags = static_cast<const dma_buf_sync*>(argument)->flags;
  if ((flags & DMA_BUF_SYNC_RW) != DMA_BUF_SYNC_READ) return -EINVAL;
  if ((flags & DMA_BUF_SYNC_END) == 0) {
    read_now_.insert(fd);
  } else {
    num_synced += read_now_.erase(fd) != 0;
  }
  return 0;
}

std::vector<std::uint8_t>& ScriptedCamera::MemoryOf(std::uint32_t buffer) {
  return memory_ == V4L2_MEMORY_DMABUF ? heap_.at(imported_.at(buffer)) : buffers_[buffer];
}

const CameraMode* ScriptedCamera::ModeOf(std::uint32_t fourcc, std::uint32_t width, std::uint32_t height) const {
  for (const CameraMode& mode : modes) {
    if (mode.fourcc == fourcc && mode.width_px == static_cast<int>(width) &&
        mode.height_px == static_cast<int>(height)) {
      return &mode;
    }
  }
  return nullptr;
}

int ScriptedCamera::Answer(unsigned long request, void* argument) {
  switch (request) {
    case VIDIOC_QUERYCAP: {
      auto* c = static_cast<v4l2_capability*>(argument);
      Put(name, c->card);
      Put("scripted", c->driver);
      Put("usb-1.2", c->bus_info);
      c->capabilities = capabilities | V4L2_CAP_DEVICE_CAPS;
      c->device_caps = capabilities;
      return 0;
    }
    case VIDIOC_ENUMINPUT: {
      auto* input = static_cast<v4l2_input*>(argument);
      if (input->index >= inputs.size()) return -EINVAL;
      Put(inputs[input->index], input->name);
      input->type = V4L2_INPUT_TYPE_CAMERA;
      input->capabilities = has_timings ? V4L2_IN_CAP_DV_TIMINGS : 0;
      return 0;
    }
    case VIDIOC_G_INPUT: *static_cast<int*>(argument) = std::max(0, set_input); return inputs.empty() ? -ENOTTY : 0;
    case VIDIOC_S_INPUT: set_input = *static_cast<int*>(argument); return 0;
    case VIDIOC_QUERY_DV_TIMINGS: {
      if (timings_error != 0) return timings_error;
      v4l2_bt_timings& bt = static_cast<v4l2_dv_timings*>(argument)->bt;
      bt.width = 1920;
      bt.height = 1080;
      bt.hsync = 280;
      bt.vsync = 45;
      bt.pixelclock = 123750000;  // of 2200 x 1125: 50 Hz
      return 0;
    }
    case VIDIOC_S_DV_TIMINGS: return 0;
    case VIDIOC_ENUM_FMT: {
      auto* entry = static_cast<v4l2_fmtdesc*>(argument);
      std::vector<std::uint32_t> fourccs;
      for (const CameraMode& mode : modes) {
        if (std::find(fourccs.begin(), fourccs.end(), mode.fourcc) == fourccs.end()) fourccs.push_back(mode.fourcc);
      }
      if (entry->index >= fourccs.size()) return -EINVAL;
      entry->pixelformat = fourccs[entry->index];
      return 0;
    }
    case VIDIOC_ENUM_FRAMESIZES: {
      auto* entry = static_cast<v4l2_frmsizeenum*>(argument);
      if (!has_sizes) return -ENOTTY;
      std::uint32_t left = entry->index;
      for (const CameraMode& mode : modes) {
        if (mode.fourcc != entry->pixel_format || left-- > 0) continue;
        entry->type = V4L2_FRMSIZE_TYPE_DISCRETE;
        entry->discrete = {static_cast<__u32>(mode.width_px), static_cast<__u32>(mode.height_px)};
        return 0;
      }
      return -EINVAL;
    }
    case VIDIOC_ENUM_FRAMEINTERVALS: {
      auto* entry = static_cast<v4l2_frmivalenum*>(argument);
      const CameraMode* mode = ModeOf(entry->pixel_format, entry->width, entry->height);
      if (!has_sizes) return -ENOTTY;
      if (mode == nullptr || entry->index >= mode->rates_hz.size()) return -EINVAL;
      entry->type = V4L2_FRMIVAL_TYPE_DISCRETE;
      entry->discrete = Interval(mode->rates_hz[entry->index]);
      return 0;
    }
    case VIDIOC_G_FMT:
    case VIDIOC_TRY_FMT:
    case VIDIOC_S_FMT: {
      auto* format = static_cast<v4l2_format*>(argument);
      if (request == VIDIOC_G_FMT) {
        format->fmt.pix.pixelformat = modes.front().fourcc;
        format->fmt.pix.width = static_cast<__u32>(modes.front().width_px);
        format->fmt.pix.height = static_cast<__u32>(modes.front().height_px);
      }
      // As drivers do: what is not offered becomes something that is.
      if (ModeOf(format->fmt.pix.pixelformat, format->fmt.pix.width, format->fmt.pix.height) == nullptr) {
        format->fmt.pix.pixelformat = modes.front().fourcc;
        format->fmt.pix.width = static_cast<__u32>(modes.front().width_px);
        format->fmt.pix.height = static_cast<__u32>(modes.front().height_px);
      }
      format->fmt.pix.field = field;
      return request == VIDIOC_S_FMT ? SetFormat(format) : 0;
    }
    case VIDIOC_G_PARM:
    case VIDIOC_S_PARM: {
      auto* parameters = static_cast<v4l2_streamparm*>(argument);
      v4l2_captureparm& capture = parameters->parm.capture;
      if (!says_rate) return -ENOTTY;
      if (request == VIDIOC_S_PARM && rate_error != 0) return rate_error;
      capture.capability = V4L2_CAP_TIMEPERFRAME;
      const CameraMode* mode = ModeOf(fourcc_, width_, height_);
      const double wanted = request == VIDIOC_S_PARM && capture.timeperframe.numerator > 0
                                ? static_cast<double>(capture.timeperframe.denominator) / capture.timeperframe.numerator
                                : rate_hz_;
      rate_hz_ = mode->rates_hz.front();
      for (const double rate : mode->rates_hz) {
        if (std::abs(rate - wanted) < std::abs(rate_hz_ - wanted)) rate_hz_ = rate;
      }
      capture.timeperframe = Interval(rate_hz_);
      return 0;
    }
    case VIDIOC_REQBUFS: {
      auto* wanted = static_cast<v4l2_requestbuffers*>(argument);
      if (wanted->memory == V4L2_MEMORY_DMABUF && !can_import) return -EINVAL;
      // Somebody has buffers still: the kernel gives nobody else's away.
      if (num_maps > 0) return -EBUSY;
      memory_ = wanted->memory;
      imported_.clear();
      buffers_.assign(wanted->count, std::vector<std::uint8_t>(PictureBytes() + 16));
      queued_.clear();
      filled_.clear();
      return 0;
    }
    case VIDIOC_QUERYBUF: {
      auto* buffer = static_cast<v4l2_buffer*>(argument);
      if (buffer->index >= buffers_.size()) return -EINVAL;
      buffer->length = static_cast<__u32>(buffers_[buffer->index].size());
      buffer->m.offset = buffer->index * 4096;
      return 0;
    }
    case VIDIOC_QBUF: {
      const auto* buffer = static_cast<v4l2_buffer*>(argument);
      if (buffer->index >= buffers_.size() || buffer->memory != memory_) return -EINVAL;
      if (memory_ == V4L2_MEMORY_DMABUF) {
        const auto memory = heap_.find(buffer->m.fd);
        if (memory == heap_.end() || memory->second.size() < PictureBytes()) return -EINVAL;
        // Who still reads may not give it back.
        if (!can_attach || read_now_.contains(buffer->m.fd)) return -EINVAL;
        imported_[buffer->index] = buffer->m.fd;
      }
      // A buffer that is given back twice is a mistake of the caller.
      if (std::find(queued_.begin(), queued_.end(), buffer->index) != queued_.end()) return -EINVAL;
      queued_.push_back(buffer->index);
      return 0;
    }
    case VIDIOC_DQBUF: {
      auto* buffer = static_cast<v4l2_buffer*>(argument);
      if (buffer->memory != memory_) return -EINVAL;
      if (filled_.empty()) return -EAGAIN;
      const Filled picture = filled_.front();
      filled_.pop_front();
      if (picture.fault.dequeue_error != 0) return picture.fault.dequeue_error;
      buffer->index = picture.buffer;
      buffer->sequence = picture.sequence;
      buffer->bytesused = picture.bytes - (picture.fault.is_short ? 1 : 0);
      buffer->field = picture.field;
      buffer->flags = picture.fault.is_unstamped ? V4L2_BUF_FLAG_TIMESTAMP_COPY : V4L2_BUF_FLAG_TIMESTAMP_MONOTONIC;
      if (picture.fault.has_error_flag) buffer->flags |= V4L2_BUF_FLAG_ERROR;
      const std::int64_t us = (picture.stamp + picture.fault.stamp_shift).time_since_epoch().count() / 1000;
      buffer->timestamp = {us / 1000000, us % 1000000};
      return 0;
    }
    case VIDIOC_EXPBUF: {
      auto* wanted = static_cast<v4l2_exportbuffer*>(argument);
      if (!can_export) return -ENOTTY;
      if (wanted->index >= buffers_.size()) return -EINVAL;
      wanted->fd = kFirstDmaFd + num_calls;
      exported_.insert(wanted->fd);
      ++num_opened;
      return 0;
    }
    case VIDIOC_STREAMON:
      is_streaming_ = true;
      ++num_streams;
      num_taken_ = 0;
      next_picture_ = now + period();
      return 0;
    case VIDIOC_STREAMOFF: is_streaming_ = false; return 0;
    case VIDIOC_SUBSCRIBE_EVENT: subscribed_input_ = static_cast<v4l2_event_subscription*>(argument)->id; return 0;
    case VIDIOC_DQEVENT: {
      if (!has_source_change || !IsSubscribed()) return -ENOENT;
      has_source_change = false;
      static_cast<v4l2_event*>(argument)->type = V4L2_EVENT_SOURCE_CHANGE;
      return 0;
    }
    default: return -ENOTTY;
  }
}

int ScriptedCamera::SetFormat(v4l2_format* format) {
  v4l2_pix_format& pix = format->fmt.pix;
  if (height_answer != 0) pix.height = height_answer;
  fourcc_ = pix.pixelformat;
  width_ = pix.width;
  height_ = pix.height;
  pitch_ = fourcc_ == V4L2_PIX_FMT_MJPEG
               ? 0
               : width_ * (IsPaired(fourcc_) ? 2 : 1) + static_cast<std::uint32_t>(extra_pitch_bytes);
  pix.bytesperline = pitch_;
  pix.sizeimage = static_cast<__u32>(PictureBytes());
  rate_hz_ = ModeOf(fourcc_, width_, height_) != nullptr ? ModeOf(fourcc_, width_, height_)->rates_hz.front() : 25.0;
  return 0;
}

std::size_t ScriptedCamera::PictureBytes() const {
  if (fourcc_ == V4L2_PIX_FMT_MJPEG) return jpeg.size();
  return static_cast<std::size_t>(pitch_) * (fourcc_ == V4L2_PIX_FMT_NV12 ? height_ + height_ / 2 : height_);
}

int ScriptedCamera::Poll(int fd, short, Duration timeout, short* found) {
  *found = 0;
  if (fd != kFd || !is_open_) return -EBADF;
  if (int error = 0; Fails(&error)) return error;
  const TimePoint end = now + timeout;
  while (true) {
    if (!is_present) {
      *found = POLLERR | POLLHUP;
      return 1;
    }
    if (has_source_change && IsSubscribed()) *found |= POLLPRI;
    if (!filled_.empty()) *found |= POLLIN;
    if (*found != 0) return 1;
    if (now >= end) return 0;
    MoveTo(is_streaming_ ? std::min(end, std::max(now, next_picture_)) : end);
  }
}

void ScriptedCamera::MoveTo(TimePoint then) {
  while (is_streaming_ && is_present && next_picture_ <= then) {
    if (!is_silent) TakePicture(next_picture_);
    next_picture_ += period();
  }
  now = std::max(now, then);
}

void ScriptedCamera::TakePicture(TimePoint stamp) {
  const std::uint32_t number = num_taken_++;
  const auto it = faults.find(number);
  Filled picture;
  if (it != faults.end()) picture.fault = it->second;
  // Without an empty buffer the picture is lost, and counted.
  if (picture.fault.is_lost || queued_.empty()) return;
  picture.buffer = queued_.front();
  queued_.pop_front();
  // Of fields that come one by one both have the number of their picture.
  picture.sequence = field == V4L2_FIELD_ALTERNATE ? number / 2 : number;
  const std::uint32_t one = number % 2 == 0 ? __u32{V4L2_FIELD_TOP} : __u32{V4L2_FIELD_BOTTOM};
  picture.field = field == V4L2_FIELD_ALTERNATE ? one : field;
  picture.stamp = stamp;
  picture.bytes = static_cast<std::uint32_t>(PictureBytes());
  Paint(picture.sequence, MemoryOf(picture.buffer).data());
  filled_.push_back(picture);
}

void ScriptedCamera::Paint(std::uint32_t sequence, std::uint8_t* to) const {
  if (fourcc_ == V4L2_PIX_FMT_MJPEG) {
    std::copy(jpeg.begin(), jpeg.end(), to);
    return;
  }
  std::fill_n(to, PictureBytes(), std::uint8_t{128});
  const int step = IsPaired(fourcc_) ? 2 : 1;
  const int offset = fourcc_ == V4L2_PIX_FMT_UYVY ? 1 : 0;
  const int height = static_cast<int>(height_);
  for (int row = 0; row < height; ++row) {
    // The row of the picture that lies in this row of memory.
    int y = row;
    if (field == V4L2_FIELD_SEQ_TB) y = row < height / 2 ? 2 * row : 2 * (row - height / 2) + 1;
    if (field == V4L2_FIELD_SEQ_BT) y = row < height / 2 ? 2 * row + 1 : 2 * (row - height / 2);
    for (int x = 0; x < static_cast<int>(width_); ++x) {
      to[row * static_cast<int>(pitch_) + x * step + offset] =
          Luma(sequence, is_woven && y % 2 == 1 ? x + kWovenShift : x, y);
    }
  }
}

void* ScriptedCamera::Map(int fd, std::size_t length, std::int64_t offset) {
  if (int error = 0; Fails(&error)) return nullptr;
  if (const auto memory = heap_.find(fd); memory != heap_.end()) {
    if (length != memory->second.size() || offset != 0) return nullptr;
    ++num_maps;
    return memory->second.data();
  }
  const std::size_t index = static_cast<std::size_t>(offset / 4096);
  if (index >= buffers_.size() || length != buffers_[index].size()) return nullptr;
  ++num_maps;
  return buffers_[index].data();
}

void ScriptedCamera::Unmap(void* address, std::size_t length) {
  --num_maps;
  const auto* bytes = static_cast<const std::uint8_t*>(address);
  if (std::any_of(bytes, bytes + length, [](std::uint8_t byte) { return byte != 0; })) ++num_left;
}

}  // namespace haustra::test
