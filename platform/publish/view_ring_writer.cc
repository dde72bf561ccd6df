#include "platform/publish/view_ring_writer.h"

#include <algorithm>
#include <array>
#include <cerrno>
#include <cstdio>
#include <system_error>
#include <utility>

#include "platform/publish/slot_writer.h"

namespace haustra {
namespace {

std::string WhatIs(int error) { return std::generic_category().message(error); }

void WipeRecords(haustra_view_file* file) {
  WipeSlots(file->pictures);
  WipeSlots(file->matches);
}

// Readers of a daemon that died still hold its file.
void WipeFormerFile(const std::string& path) {
  haustra_view former;
  if (haustra_view_open(&former, path.c_str()) != HAUSTRA_OK) return;
  haustra_view_close(&former);
  const OwnedDescriptor file{::open(path.c_str(), O_RDWR | O_CLOEXEC | O_NOFOLLOW)};
  haustra_view_file* memory = file.value < 0 ? nullptr : MapShared<haustra_view_file>(file.value);
  if (memory == nullptr) return;
  WipeRecords(memory);
  ::munmap(memory, sizeof *memory);
}

std::uint8_t Clamped(int value) { return static_cast<std::uint8_t>(std::clamp(value, 0, 255)); }

// Full range; 16 bits after the point.
void StoreYuv(int y, int cb, int cr, std::uint8_t* bgr) {
  bgr[0] = Clamped(y + ((116130 * (cb - 128) + 32768) >> 16));
  bgr[1] = Clamped(y - ((22554 * (cb - 128) + 46802 * (cr - 128) + 32768) >> 16));
  bgr[2] = Clamped(y + ((91881 * (cr - 128) + 32768) >> 16));
}

void StorePixel(const ImageView& image, int x, int y, std::uint8_t* to) {
  const std::uint8_t* row = image.row(y);
  switch (image.format) {
    case PixelFormat::kGrey8: to[0] = row[x]; return;
    case PixelFormat::kBgr8: std::copy_n(row + 3 * x, 3, to); return;
    case PixelFormat::kNv12: {
      const std::uint8_t* colour = image.row(image.height + y / 2) + x / 2 * 2;
      return StoreYuv(row[x], colour[0], colour[1], to);
    }
    case PixelFormat::kYuyv: {
      const std::uint8_t* pair = row + x / 2 * 4;
      return StoreYuv(pair[x % 2 * 2], pair[1], pair[3], to);
    }
    case PixelFormat::kUyvy: {
      const std::uint8_t* pair = row + x / 2 * 4;
      return StoreYuv(pair[x % 2 * 2 + 1], pair[0], pair[2], to);
    }
  }
}

constexpr std::size_t Rounded8(std::size_t num_bytes) { return (num_bytes + 7) / 8 * 8; }

}  // namespace

ViewRingWriter::ViewRingWriter(std::string path, int descriptor, haustra_view_file* file)
    : path_(std::move(path)), descriptor_(descriptor), file_(file), picture_(std::make_unique<haustra_picture>()) {}

Result<std::unique_ptr<ViewRingWriter>> ViewRingWriter::Create(const std::string& path, mode_t mode, gid_t group) {
  const std::string temporary_path = path + ".new";
  ::unlink(temporary_path.c_str());
  OwnedDescriptor file{::open(temporary_path.c_str(), O_RDWR | O_CREAT | O_EXCL | O_CLOEXEC | O_NOFOLLOW, 0600)};
  if (file.value < 0) {
    const int error = errno;
    if (error == ENOENT || error == ENOTDIR) return NotFound(path + ": its folder does not exist");
    return Unavailable(path + ": cannot be created: " + WhatIs(error));
  }
  const auto fail = [&](int error) {
    ::unlink(temporary_path.c_str());
    return Unavailable(path + ": cannot be created: " + WhatIs(error));
  };
  // As for the poses: memory that is not there would be missed at the first frame.
  if (const int error = ::posix_fallocate(file.value, 0, sizeof(haustra_view_file)); error != 0) return fail(error);
  if (group != static_cast<gid_t>(-1) && ::fchown(file.value, static_cast<uid_t>(-1), group) != 0) return fail(errno);
  if (::fchmod(file.value, mode) != 0) return fail(errno);
  auto* memory = MapShared<haustra_view_file>(file.value);
  if (memory == nullptr) return fail(errno);

  haustra_view_header& header = memory->header;
  header.version = HAUSTRA_VIEW_VERSION;
  header.header_bytes = sizeof(haustra_view_header);
  header.file_bytes = sizeof(haustra_view_file);
  header.picture_slot_bytes = sizeof(haustra_picture_slot);
  header.num_picture_slots = HAUSTRA_PICTURE_SLOTS;
  header.matches_slot_bytes = sizeof(haustra_matches_slot);
  header.num_matches_slots = HAUSTRA_MATCHES_SLOTS;
  header.magic = HAUSTRA_VIEW_MAGIC;

  WipeFormerFile(path);
  if (std::rename(temporary_path.c_str(), path.c_str()) != 0) {
    const int error = errno;
    ::munmap(memory, sizeof *memory);
    return fail(error);
  }
  return std::unique_ptr<ViewRingWriter>(new ViewRingWriter(path, std::exchange(file.value, -1), memory));
}

Result<std::unique_ptr<ViewRingWriter>> ViewRingWriter::Attach(int descriptor) {
  struct stat info {};
  if (::fstat(descriptor, &info) != 0 || !S_ISREG(info.st_mode) ||
      info.st_size != static_cast<off_t>(sizeof(haustra_view_file))) {
    return DataLoss("the view ring has another size");
  }
  auto* memory = MapShared<haustra_view_file>(descriptor);
  if (memory == nullptr) return Unavailable("the view ring cannot be mapped: " + WhatIs(errno));
  std::unique_ptr<ViewRingWriter> writer(new ViewRingWriter("", -1, memory));
  if (memory->header.magic != HAUSTRA_VIEW_MAGIC || memory->header.version != HAUSTRA_VIEW_VERSION) {
    return DataLoss("the view ring has another layout");
  }
  return writer;
}

ViewRingWriter::~ViewRingWriter() {
  if (descriptor_ >= 0) {
    Wipe();
    ::unlink(path_.c_str());
    ::close(descriptor_);
  }
  ::munmap(file_, sizeof *file_);
}

void ViewRingWriter::PublishPicture(const Frame& frame, std::uint64_t procedure) {
  const ImageView& image = frame.image;
  if (image.is_empty()) return;
  haustra_picture& picture = *picture_;
  const auto steps = [](int size, std::uint32_t most) {
    return static_cast<int>((static_cast<std::uint32_t>(size) + most - 1) / most);
  };
  const int step =
      std::max(steps(image.width, HAUSTRA_PICTURE_MAX_WIDTH), steps(image.height, HAUSTRA_PICTURE_MAX_HEIGHT));
  const int width = (image.width + step - 1) / step, height = (image.height + step - 1) / step;
  const int num_channels = image.format == PixelFormat::kGrey8 ? 1 : 3;
  picture.published_ns = haustra_now_ns();
  picture.frame_index = frame.index;
  picture.procedure = procedure;
  picture.step = static_cast<std::uint32_t>(step);
  picture.width = static_cast<std::uint32_t>(width);
  picture.height = static_cast<std::uint32_t>(height);
  picture.num_channels = static_cast<std::uint32_t>(num_channels);
  std::uint8_t* to = picture.pixels;
  for (int y = 0; y < height; ++y) {
    for (int x = 0; x < width; ++x, to += num_channels) StorePixel(image, x * step, y * step, to);
  }
  const std::uint64_t sequence = file_->header.newest_picture + 1;
  picture.sequence = sequence;
  const SlotWriter slot(&file_->pictures[sequence % HAUSTRA_PICTURE_SLOTS].lock, sequence);
  slot.Copy(&picture, 0, Rounded8(offsetof(haustra_picture, pixels) + static_cast<std::size_t>(to - picture.pixels)));
  slot.Commit();
  StoreWord(&file_->header.newest_picture, sequence);
}

void ViewRingWriter::PublishMatches(std::uint64_t frame_index, std::uint64_t procedure,
                                    std::span<const haustra_match> points, std::uint32_t num_matched) {
  const std::size_t count = std::min<std::size_t>(points.size(), HAUSTRA_MATCHES_POINTS);
  const std::uint64_t sequence = file_->header.newest_matches + 1;
  const std::array<std::uint64_t, 4> head{sequence, frame_index, procedure,
                                          count | static_cast<std::uint64_t>(num_matched) << 32};
  const SlotWriter slot(&file_->matches[sequence % HAUSTRA_MATCHES_SLOTS].lock, sequence);
  slot.Copy(head.data(), 0, sizeof head);
  slot.Copy(points.data(), offsetof(haustra_matches, points), count * sizeof(haustra_match));
  slot.Commit();
  StoreWord(&file_->header.newest_matches, sequence);
}

void ViewRingWriter::Wipe() {
  WipeRecords(file_);
  *picture_ = haustra_picture{};
}

}  // namespace haustra
