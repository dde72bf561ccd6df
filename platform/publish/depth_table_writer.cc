#include "platform/publish/depth_table_writer.h"

#include <sys/mman.h>
#include <unistd.h>

#include <algorithm>
#include <utility>

#include "platform/publish/shared_file.h"
#include "platform/publish/slot_writer.h"

namespace haustra {
namespace {

// Behind the header.
void WipeRecords(void* memory, std::size_t file_bytes) {
  auto* words = reinterpret_cast<std::uint64_t*>(static_cast<char*>(memory) + sizeof(haustra_depth_header));
  // Locks lie among them: a reader in the middle of a record finds at its end that it is gone.
  for (std::size_t i = 0; i < (file_bytes - sizeof(haustra_depth_header)) / 8; ++i) StoreWord(words + i, 0);
}

}  // namespace

Status DepthTableWriter::RemoveFormer(const std::string& path) { return RemoveFormerFile(path); }

DepthTableWriter::DepthTableWriter(std::string path, int descriptor, void* memory, std::uint32_t num_slots)
    : path_(std::move(path)), descriptor_(descriptor), num_slots_(num_slots) {
  char* at = static_cast<char*>(memory);
  header_ = reinterpret_cast<haustra_depth_header*>(at);
  at += sizeof(haustra_depth_header);
  camera_ = reinterpret_cast<haustra_depth_camera_slot*>(at);
  at += sizeof(haustra_depth_camera_slot);
  keyframes_ = reinterpret_cast<haustra_depth_keyframe_slot*>(at);
  at += std::size_t(num_slots) * sizeof(haustra_depth_keyframe_slot);
  depths_ = reinterpret_cast<haustra_depth_slot*>(at);
}

Result<std::unique_ptr<DepthTableWriter>> DepthTableWriter::Create(const std::string& path, mode_t mode, gid_t group,
                                                                   std::uint32_t num_slots) {
  const std::size_t file_bytes = haustra_depth_file_bytes(num_slots);
  const auto prepare = [&](void* memory) {
    auto& header = *static_cast<haustra_depth_header*>(memory);
    header.version = HAUSTRA_DEPTH_VERSION;
    header.header_bytes = sizeof(haustra_depth_header);
    header.file_bytes = file_bytes;
    header.num_slots = num_slots;
    header.camera_slot_bytes = sizeof(haustra_depth_camera_slot);
    header.keyframe_slot_bytes = sizeof(haustra_depth_keyframe_slot);
    header.depth_slot_bytes = sizeof(haustra_depth_slot);
    header.magic = HAUSTRA_DEPTH_MAGIC;
  };
  HAUSTRA_ASSIGN(const SharedFile file, CreateSharedFile(path, mode, group, file_bytes, prepare));
  return std::unique_ptr<DepthTableWriter>(new DepthTableWriter(path, file.descriptor, file.memory, num_slots));
}

Result<std::unique_ptr<DepthTableWriter>> DepthTableWriter::Attach(int descriptor) {
  haustra_depth_header header{};
  const ssize_t count = ::pread(descriptor, &header, sizeof header, 0);
  if (haustra_depth_check_(&header, count, header.file_bytes) != HAUSTRA_OK) {
    return DataLoss("the depth table has another layout");
  }
  HAUSTRA_ASSIGN(void* const memory, AttachSharedFile(descriptor, header.file_bytes, "the depth table"));
  return std::unique_ptr<DepthTableWriter>(new DepthTableWriter("", -1, memory, header.num_slots));
}

DepthTableWriter::~DepthTableWriter() {
  if (descriptor_ >= 0) {
    Wipe();
    ::unlink(path_.c_str());
    ::close(descriptor_);
  }
  ::munmap(header_, haustra_depth_file_bytes(num_slots_));
}

void DepthTableWriter::SetChanged(std::uint64_t sequence) { StoreWord(&header_->num_changes, sequence); }

void DepthTableWriter::PublishCamera(const haustra_depth_camera& camera) {
  haustra_depth_camera record = camera;
  record.sequence = NextSequence();
  const SlotWriter slot(&camera_->lock, record.sequence);
  slot.Copy(&record, 0, sizeof record);
  slot.Commit();
  SetChanged(record.sequence);
}

void DepthTableWriter::PublishKeyframe(std::uint32_t slot, const haustra_depth_keyframe& keyframe) {
  haustra_depth_keyframe record = keyframe;
  record.sequence = NextSequence();
  const SlotWriter writer(&keyframes_[slot].lock, record.sequence);
  writer.Copy(&record, 0, sizeof record);
  writer.Commit();
  SetChanged(record.sequence);
}

std::uint64_t DepthTableWriter::PublishDepth(std::uint32_t slot, const haustra_depth& depth) {
  const std::uint64_t sequence = NextSequence();
  const std::size_t num_cells = std::min<std::size_t>(depth.num_cells, HAUSTRA_DEPTH_MAX_CELLS);
  const std::uint64_t head[2] = {sequence, num_cells};
  const SlotWriter writer(&depths_[slot].lock, sequence);
  writer.Copy(head, 0, sizeof head);
  writer.Copy(depth.codes, offsetof(haustra_depth, codes), InWholeWords(num_cells * sizeof depth.codes[0]));
  writer.Copy(depth.confidences, offsetof(haustra_depth, confidences), InWholeWords(num_cells));
  writer.Copy(depth.bgr, offsetof(haustra_depth, bgr), InWholeWords(3 * num_cells));
  writer.Commit();
  SetChanged(sequence);
  return sequence;
}

void DepthTableWriter::Clear(std::uint32_t slot) {
  WipeSlot(keyframes_[slot]);
  WipeSlot(depths_[slot]);
  SetChanged(NextSequence());
}

void DepthTableWriter::Wipe() {
  WipeRecords(header_, haustra_depth_file_bytes(num_slots_));
  SetChanged(NextSequence());
}

}  // namespace haustra
