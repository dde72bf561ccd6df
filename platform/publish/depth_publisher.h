// Keeps the depth table (haustra_depth_table.h) as the atlas is: writes what has changed since the last call.
#pragma once

#include <cstdint>
#include <memory>
#include <vector>

#include "engine/engine.h"
#include "hal/camera_calibration.h"
#include "hal/core/views.h"
#include "platform/publish/depth_table_writer.h"

namespace haustra {

// Every n-th cell of n-th row, n the smallest that fits into HAUSTRA_DEPTH_MAX_CELLS.
int PublishedCellStep(int grid_width, int grid_height);

// The cells of a depth that are published, with the inverse range in the middle of each. For an even step that is the
// mean of the four cells around it: what a plane has there. It is not known where one of the four is not, or where they
// differ by more than a tenth, at an edge. bgr: 3 a cell.
void FillDepth(const DepthMap& depth, std::span<const std::uint8_t> bgr, int step, haustra_depth* record);

// thread-bound(mapping) after construction, which takes all its memory.
class DepthPublisher {
 public:
  // `table` outlives it and has a slot for each keyframe of the atlas. mask: 255 where pictures show the scene, of the
  // camera's size; empty: everywhere.
  DepthPublisher(DepthTableWriter& table, const CameraCalibration& calibration, ImageView mask, int depth_step_px,
                 int max_keyframes);
  static std::size_t BytesFor(int max_keyframes);

  // What a worker that died has left in the table is wiped.
  void Begin(std::uint64_t procedure);
  // Keyframes that came, moved or went, and at most kDepthsAtOnce new depths. True: there are more.
  bool Publish(const Engine& engine);
  static constexpr int kDepthsAtOnce = 8;

 private:
  struct Told {
    KeyframeHandle keyframe;  // invalid: the slot is empty
    haustra_depth_keyframe record{};
    std::uint64_t turned_at = 0;  // KeptDepth::turned_at of its depth
  };

  bool Tell(const Engine& engine, KeyframeHandle handle, int* depths_left);

  DepthTableWriter& table_;
  haustra_depth_camera camera_{};
  int cell_step_;
  std::uint64_t procedure_ = 0;
  std::vector<Told> told_;  // by keyframe slot
  std::vector<bool> is_there_;
  std::unique_ptr<haustra_depth> depth_;  // workspace
};

}  // namespace haustra
