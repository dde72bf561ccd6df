#include "engine/depth/depth_file.h"

#include <cmath>
#include <string_view>
#include <utility>

#include "engine/io/byte_order.h"

namespace haustra {
namespace {

constexpr std::string_view kGridTag = "GRID", kKeyframeTag = "KEYF";
constexpr std::uint32_t kMaxSide = 16384, kMaxStep = 8;
constexpr std::size_t kBytesPerCell = 6;  // code, confidence, colour

Status Damaged(const Chunk& chunk, const std::string& what) {
  return DataLoss("depth file: section '" + std::string(chunk.tag) + "' at byte " + std::to_string(chunk.offset) +
                  ": " + what);
}

Status CheckTag(const Chunk& chunk, std::string_view tag) {
  if (chunk.tag == tag) return Status::Ok();
  return Damaged(chunk, "section '" + std::string(tag) + "' expected here");
}

Result<SavedDepth> ReadKeyframe(const Chunk& chunk, const DepthGrid& grid) {
  const std::size_t num_cells = static_cast<std::size_t>(grid.width) * static_cast<std::size_t>(grid.height);
  ByteReader reader(chunk.payload, chunk.offset);
  SavedDepth saved;
  saved.keyframe_id = reader.U32();
  saved.frame_index = reader.U32();
  const double unit = reader.F64();
  if (reader.is_short() || reader.num_left() != kBytesPerCell * num_cells) {
    return Damaged(chunk,
                   std::to_string(chunk.payload.size()) + " bytes do not hold " + std::to_string(num_cells) + " cells");
  }
  if (!(unit > 0.0) || !std::isfinite(unit)) return Damaged(chunk, "the inverse range of code 1 is not above zero");
  const std::span<const std::uint8_t> code_bytes = reader.Bytes(2 * num_cells);
  const std::span<const std::uint8_t> confidences = reader.Bytes(num_cells);
  const std::span<const std::uint8_t> bgr = reader.Bytes(3 * num_cells);
  std::vector<std::uint16_t> codes(num_cells);
  for (std::size_t i = 0; i < num_cells; ++i) {
    codes[i] = static_cast<std::uint16_t>(code_bytes[2 * i] | code_bytes[2 * i + 1] << 8);
  }
  saved.depth = DepthMap(grid.width, grid.height);
  saved.depth.Restore(unit, codes, confidences);
  saved.bgr.assign(bgr.begin(), bgr.end());
  return saved;
}

}  // namespace

Status DepthFileWriter::Begin(const DepthGrid& grid, int num_keyframes) {
  HAUSTRA_TRY(writer_.Begin());
  payload_.clear();
  ByteWriter bytes(&payload_);
  for (const int value : {grid.step_px, grid.width, grid.height, num_keyframes})
    bytes.U32(static_cast<std::uint32_t>(value));
  return writer_.Write(kGridTag, payload_);
}

Status DepthFileWriter::Add(KeyframeId keyframe_id, std::uint32_t frame_index, const DepthMap& depth,
                            std::span<const std::uint8_t> bgr) {
  payload_.clear();
  ByteWriter bytes(&payload_);
  bytes.U32(keyframe_id);
  bytes.U32(frame_index);
  bytes.F64(depth.unit());
  for (const std::uint16_t code : depth.codes()) {
    payload_.push_back(static_cast<char>(code & 0xff));
    payload_.push_back(static_cast<char>(code >> 8));
  }
  for (const std::span<const std::uint8_t> part : {depth.confidences(), bgr}) {
    payload_.append(reinterpret_cast<const char*>(part.data()), part.size());
  }
  return writer_.Write(kKeyframeTag, payload_);
}

Result<DepthFile> ReadDepthFile(std::span<const std::uint8_t> file) {
  ChunkReader reader(kDepthFileKind, file);
  HAUSTRA_TRY(reader.Begin());
  HAUSTRA_ASSIGN(const Chunk head, reader.Next());
  HAUSTRA_TRY(CheckTag(head, kGridTag));
  ByteReader bytes(head.payload, head.offset);
  const std::uint32_t step_px = bytes.U32(), width = bytes.U32(), height = bytes.U32(), num_keyframes = bytes.U32();
  if (bytes.is_short() || bytes.num_left() != 0) return Damaged(head, "four numbers expected");
  if (step_px < 1 || step_px > kMaxStep || width < 1 || width > kMaxSide || height < 1 || height > kMaxSide) {
    return Damaged(head, "a grid of " + std::to_string(width) + "x" + std::to_string(height) + " cells of " +
                             std::to_string(step_px) + " pixels is not one");
  }
  DepthFile depths;
  depths.grid = {static_cast<int>(step_px), static_cast<int>(width), static_cast<int>(height)};
  for (std::uint32_t i = 0; i < num_keyframes; ++i) {
    HAUSTRA_ASSIGN(const Chunk chunk, reader.Next());
    HAUSTRA_TRY(CheckTag(chunk, kKeyframeTag));
    HAUSTRA_ASSIGN(SavedDepth saved, ReadKeyframe(chunk, depths.grid));
    if (!depths.keyframes.empty() && saved.keyframe_id <= depths.keyframes.back().keyframe_id) {
      return Damaged(chunk, "keyframe " + std::to_string(saved.keyframe_id) + " does not follow the one before");
    }
    depths.keyframes.push_back(std::move(saved));
  }
  HAUSTRA_ASSIGN(const Chunk end, reader.Next());
  HAUSTRA_TRY(CheckTag(end, kEndTag));
  return depths;
}

}  // namespace haustra
