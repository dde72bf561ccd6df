// Depths of keyframes into one signed distance volume with colour (Curless and Levoy 1996). Frame: the map, map units.
#pragma once

#include <cstdint>
#include <vector>

#include "engine/camera/camera_model.h"
#include "engine/geometry/se3.h"
#include "engine/surface/depth_map.h"
#include "engine/surface/voxel_blocks.h"
#include "hal/core/views.h"

namespace haustra {

struct FusionOptions {
  // Side of a voxel, > 0. Nothing finer than it is in the mesh.
  double voxel_mu = 0.01;
  // Truncation, voxels, >= 2. Depths of two keyframes that differ by less become one wall.
  double truncation_voxels = 4.0;
};

// thread-bound(its owner). Memory is taken at construction; Integrate does not allocate.
class DepthFusion {
 public:
  // `camera`: whose grid has step_px pixels a cell.
  DepthFusion(const CameraModel& camera, int step_px, const FusionOptions& options, int max_blocks);

  void Reset() { blocks_.Reset(); }
  // colour: kBgr8 or kGrey8, of the camera's size or a pixel a cell. A voxel counts a depth by its confidence and by
  // how squarely the ray meets the wall. Its distance depends on the order of the calls by rounding only. Its colour is
  // that of the first 32 keyframes or more that see it near the wall: later ones would no longer move eight bits. Same
  // order, same bits.
  void Integrate(const DepthMap& depth, ImageView colour, const SE3& cam_from_map);

  const VoxelBlocks& blocks() const { return blocks_; }
  const FusionOptions& options() const { return options_; }

 private:
  void AddBlocksAlong(const Eigen::Vector3d& begin_in_map, const Eigen::Vector3d& end_in_map);
  // Cosine of the angle between ray and wall, from the depths beside it; 0: a cell without a depth beside it.
  double Squareness(const DepthMap& depth, int cell) const;
  void UpdateBlock(int block, const DepthMap& depth, ImageView colour, const SE3& cam_from_map);

  CameraModel camera_;
  int step_px_;
  FusionOptions options_;
  VoxelBlocks blocks_;
  std::vector<Eigen::Vector3d> bearings_;    // of the cells; zero: none
  std::vector<float> squareness_;            // of the cells of the map that is integrated
  std::vector<int> touched_;                 // blocks, in the order in which they were met
  std::vector<std::uint32_t> last_touched_;  // by which call, of each block
  std::uint32_t call_ = 0;
};

}  // namespace haustra
