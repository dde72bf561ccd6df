// The depth file of a map: a chunk file (engine/io/chunk_file.h) with these sections in this order, little-endian.
//
//   GRID  u32 pixels from cell to cell, cells in a row, rows, number of keyframes
//   KEYF  one section a keyframe, in order of their ids: u32 id, u32 frame index; f64 inverse range of code 1, per map
//         unit; by rows, one after the other of all cells: u16 code (0: no depth); u8 confidence; 3 x u8 blue, green,
//         red
//
// Ranges lie along the rays of the camera (engine/surface/depth_map.h).
#pragma once

#include <cstdint>
#include <span>
#include <string>
#include <vector>

#include "engine/atlas/handles.h"
#include "engine/io/chunk_file.h"
#include "engine/surface/depth_map.h"
#include "hal/core/byte_sink.h"
#include "hal/core/status.h"

namespace haustra {

inline constexpr ChunkFileKind kDepthFileKind{"depth file", "\x8aHDEP\r\n\x1a", 1};

// What all keyframes of a file have in common.
struct DepthGrid {
  int step_px = 0;  // from cell to cell
  int width = 0;    // cells
  int height = 0;
};

struct SavedDepth {
  KeyframeId keyframe_id = 0;
  std::uint32_t frame_index = 0;  // of the run that wrote the file
  DepthMap depth;
  std::vector<std::uint8_t> bgr;  // 3 a cell
};

struct DepthFile {
  DepthGrid grid;
  std::vector<SavedDepth> keyframes;  // ids strictly increasing
};

// thread-bound(the writer), not rt-safe. Errors are those of the sink.
class DepthFileWriter {
 public:
  explicit DepthFileWriter(ByteSink& sink) : writer_(kDepthFileKind, sink) {}

  Status Begin(const DepthGrid& grid, int num_keyframes);
  // As often as was said, ids increasing. `bgr`: 3 a cell.
  Status Add(KeyframeId keyframe_id, std::uint32_t frame_index, const DepthMap& depth,
             std::span<const std::uint8_t> bgr);
  Status End() { return writer_.End(); }

 private:
  ChunkWriter writer_;
  std::string payload_;
};

// reentrant. kInvalidArgument: not such a file; kFailedPrecondition: of another version; kDataLoss: damaged, the
// message says where.
Result<DepthFile> ReadDepthFile(std::span<const std::uint8_t> file);

}  // namespace haustra
