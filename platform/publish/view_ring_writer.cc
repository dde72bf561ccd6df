#include "platform/publish/view_ring_writer.h"

#include <sys/mman.h>
#include <unistd.h>

#include <algorithm>
#include <array>
#include <utility>

#include "platform/publish/shared_file.h"
#include "platform/publish/slot_writer.h"

namespace haustra {
namespace {

void WipeRecords(haustra_view_file* file) {
  WipeSlots(file->pictures);
  WipeSlots(file->matches);
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

}  // namespace

Status ViewRingWriter::RemoveFormer(const std::string& path) { return RemoveFormerFile(path); }

ViewRingWriter::ViewRingWriter(std::string path, int descriptor, haustra_view_file* file)
    : path_(std::move(path)), descriptor_(descriptor), file_(file), picture_(std::make_unique<haustra_picture>()) {}

Result<std::unique_ptr<ViewRingWriter>> ViewRingWriter::Create(const std::string& path, mode_t mode, gid_t group) {
  const auto prepare = [&](void* memory) {
    haustra_view_header& header = static_cast<haustra_view_file*>(memory)->header;
    header.version = HAUSTRA_VIEW_VERSION;
    header.header_bytes = sizeof(haustra_view_header);
    header.file_bytes = sizeof(haustra_view_file);
    header.picture_slot_bytes = sizeof(haustra_picture_slot);
    header.num_picture_slots = HAUSTRA_PICTURE_SLOTS;
    header.matches_slot_bytes = sizeof(haustra_matches_slot);
    header.num_matches_slots = HAUSTRA_MATCHES_SLOTS;
    header.magic = HAUSTRA_VIEW_MAGIC;
  };
  HAUSTRA_ASSIGN(const SharedFile file, CreateSharedFile(path, mode, group, sizeof(haustra_view_file), prepare));
  return std::unique_ptr<ViewRingWriter>(
      new ViewRingWriter(path, file.descriptor, static_cast<haustra_view_file*>(file.memory)));
}

Result<std::unique_ptr<ViewRingWriter>> ViewRingWriter::Attach(int descriptor) {
  HAUSTRA_ASSIGN(void* const memory, AttachSharedFile(descriptor, sizeof(haustra_view_file), "the view ring"));
  auto* file = static_cast<haustra_view_file*>(memory);
  std::unique_ptr<ViewRingWriter> writer(new ViewRingWriter("", -1, file));
  if (file->header.magic != HAUSTRA_VIEW_MAGIC || file->header.version != HAUSTRA_VIEW_VERSION) {
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
  slot.Copy(&picture, 0,
            InWholeWords(offsetof(haustra_picture, pixels) + static_cast<std::size_t>(to - picture.pixels)));
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
