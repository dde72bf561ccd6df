// What the search for a pose is tested with: a grown map without points, a frame without features, and the parts that
// the tracker has beside them, of the scripted colon.
#pragma once

#include <gtest/gtest.h>

#include "engine/tracking/pose_search.h"
#include "tests/tools/run/scripted_colon.h"

namespace haustra::test {

class SearchInMap : public ::testing::Test {
 protected:
  SearchInMap() {
    map_.map_id = 1;
    for (int i = 0; i < config_.mapping.min_map_keyframes; ++i) EXPECT_TRUE(map_.keyframes.PushBack({}));
    frame_.features.num = 0;
  }

  // The feature that the frame has of a point.
  void Show(const Eigen::Vector3d& in_cam, Keypoint* keypoint) const {
    Eigen::Vector2d pixel;
    ASSERT_TRUE(colon_.camera().Project(in_cam, &pixel));
    *keypoint = {};
    keypoint->x_px = static_cast<float>(pixel.x());
    keypoint->y_px = static_cast<float>(pixel.y());
    keypoint->scale_px = kScalePx;
  }
  // From now on the search sees the map as it is.
  void PublishMap() {
    snapshots_.WriteSlot() = map_;
    snapshots_.Publish();
    snapshots_.Refresh();
  }

  static constexpr float kScalePx = 2.0f;
  ScriptedColon colon_;
  const EngineConfig& config_ = colon_.config();
  LaneWait lane_{colon_.device()};
  FrameBudget budget_{config_.scheduler, nullptr};
  OverlayWatch overlay_{config_.initialisation, false, colon_.camera().width_px(), colon_.camera().height_px(),
                        config_.features.max};
  NoiseModel noise_{config_.noise};
  SceneRegion scene_{colon_.camera(), {}};
  MapSight sight_{config_.keyframes.low_inliers};
  LocalMap map_{config_.memory.max_local_points};
  LatestMailbox<LocalMap> snapshots_{map_};
  ProposedView frame_{config_.features.max};
  LastFrame last_{config_.features.max, std::pmr::get_default_resource()};
  const PoseSearch::Parts parts_{config_, colon_.camera(), scene_,     lane_,  budget_, overlay_,
                                 noise_,  sight_,          snapshots_, frame_, last_};
  PoseSearch search_{parts_};
  Rng rng_{5};
};

}  // namespace haustra::test
