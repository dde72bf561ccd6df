// A straight tube whose keyframes and depths lie in the shared memory, as a running engine would have put them: its
// geometry is known in closed form. thread-bound(the test).
#pragma once

#include <gtest/gtest.h>

#include <cmath>
#include <memory>
#include <string>

#include "engine/camera/camera_model.h"
#include "engine/surface/depth_map.h"
#include "platform/publish/depth_table_writer.h"
#include "platform/publish/pose_ring_writer.h"

namespace haustra::view {

// Along z, of radius 1 map unit; cameras look along it. 96x72 cells of 8 pixels.
class PublishedTube {
 public:
  static constexpr int kStepPx = 8, kWidth = 60, kHeight = 60;
  static constexpr std::uint32_t kSlots = 64;

  explicit PublishedTube(const std::string& folder) {
    auto poses = PoseRingWriter::Create(folder + "/poses", 0600, static_cast<gid_t>(-1));
    auto table = DepthTableWriter::Create(folder + "/depth", 0600, static_cast<gid_t>(-1), kSlots);
    EXPECT_TRUE(poses.ok() && table.ok());
    poses_ = std::move(*poses);
    table_ = std::move(*table);
    calibration_.kind = CameraModelKind::kKannalaBrandt;
    calibration_.width_px = kStepPx * kWidth;
    calibration_.height_px = kStepPx * kHeight;
    calibration_.fx = calibration_.fy = 200.0;
    calibration_.cx = calibration_.cy = 0.5 * (kStepPx * kWidth - 1);
    camera_ = std::make_unique<CameraModel>(*CameraModel::Create(calibration_));
  }

  PoseRingWriter& poses() { return *poses_; }
  DepthTableWriter& table() { return *table_; }

  // is_scene: whether the picture shows the scene where its y points (downwards).
  void Begin(std::uint64_t procedure, bool has_lower_half = true) {
    procedure_ = procedure;
    poses_->SetService(HAUSTRA_SERVICE_RUNNING);
    poses_->SetProcedure(procedure);
    poses_->Beat();
    haustra_depth_camera record{};
    record.procedure = procedure;
    record.model = HAUSTRA_CAMERA_KANNALA_BRANDT;
    record.width_px = static_cast<std::uint32_t>(calibration_.width_px);
    record.height_px = static_cast<std::uint32_t>(calibration_.height_px);
    record.step_px = kStepPx;
    record.grid_width = kWidth;
    record.grid_height = kHeight;
    record.fx = record.fy = calibration_.fx;
    record.cx = record.cy = calibration_.cx;
    for (int i = 0; i < kWidth * kHeight; ++i) record.is_scene[i] = has_lower_half || i < kWidth * kHeight / 2 ? 1 : 0;
    has_lower_half_ = has_lower_half;
    table_->PublishCamera(record);
  }

  haustra_depth_keyframe Keyframe(std::uint32_t id, double z, std::uint32_t map_id = 0) const {
    haustra_depth_keyframe keyframe{};
    keyframe.procedure = procedure_;
    keyframe.source_ns = id * kFrame_ns;
    keyframe.keyframe_id = keyframe.frame_index = id;
    keyframe.map_id = map_id;
    keyframe.is_of_this_run = 1;
    keyframe.position_mu[2] = z;
    keyframe.orientation_xyzw[3] = 1.0;
    keyframe.scale = 1.0;
    return keyframe;
  }
  void Publish(std::uint32_t slot, haustra_depth_keyframe keyframe, bool has_depth) {
    if (has_depth) {
      DepthMap depth(kWidth, kHeight);
      depth.Clear(0.2);
      for (int cell = 0; cell < depth.num_cells(); ++cell) {
        const int x = cell % kWidth, y = cell / kWidth;
        Eigen::Vector3d bearing;
        if (!camera_->Unproject({CellCentrePx(x, kStepPx), CellCentrePx(y, kStepPx)}, &bearing)) continue;
        const double range = 1.0 / std::hypot(bearing.x(), bearing.y());
        if (bearing.z() < 0.0 || range > 4.0 || (!has_lower_half_ && y >= kHeight / 2)) continue;
        depth.Set(cell, 1.0 / range, 200);
      }
      auto record = std::make_unique<haustra_depth>();
      record->num_cells = static_cast<std::uint64_t>(depth.num_cells());
      std::copy(depth.codes().begin(), depth.codes().end(), record->codes);
      std::copy(depth.confidences().begin(), depth.confidences().end(), record->confidences);
      std::fill(std::begin(record->bgr), std::end(record->bgr), std::uint8_t{120});
      keyframe.depth = table_->PublishDepth(slot, *record);
      keyframe.inverse_range_unit = depth.unit();
    }
    table_->PublishKeyframe(slot, keyframe);
  }
  void PublishPose(std::uint32_t frame, double z, std::uint32_t map_id = 0, std::uint64_t epoch = 0) {
    haustra_pose pose{};
    pose.source_ns = pose.captured_ns = frame * kFrame_ns;
    pose.frame_index = frame;
    pose.procedure = procedure_;
    pose.map_id = map_id;
    pose.map_epoch = epoch;
    pose.flags = HAUSTRA_POSE_VALID;
    pose.position_mu[2] = z;
    pose.orientation_xyzw[3] = 1.0;
    poses_->PublishPose(pose);
  }

  static constexpr std::int64_t kFrame_ns = 40'000'000;

 private:
  std::unique_ptr<PoseRingWriter> poses_;
  std::unique_ptr<DepthTableWriter> table_;
  CameraCalibration calibration_;
  std::unique_ptr<CameraModel> camera_;
  std::uint64_t procedure_ = 0;
  bool has_lower_half_ = true;
};

}  // namespace haustra::view
