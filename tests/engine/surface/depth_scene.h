// A textured wall, a reference picture of it and sources around it under another light, for tests of depth on any
// device.
#pragma once

#include <algorithm>
#include <cmath>
#include <memory>
#include <vector>

#include "engine/surface/depth_matcher.h"
#include "tests/engine/surface/textured_scene.h"

namespace haustra {

class DepthScene {
 public:
  // The reference, and sources around it that are turned a little, too.
  DepthScene(const CameraCalibration& calibration, Wall wall, double texture)
      : camera_(*CameraModel::Create(calibration)), wall_(std::move(wall)) {
    matcher_ = std::make_unique<DepthMatcher>(camera_, ImageView{}, DepthOptions());
    poses_ = {SE3()};
    const std::vector<Eigen::Vector3d> centres{{0.25, 0, 0}, {-0.2, 0.1, 0}, {0.05, -0.25, 0.05}, {0.1, 0.15, -0.1}};
    for (std::size_t i = 0; i < centres.size(); ++i) {
      const SE3 map_from_cam(ExpSO3(0.02 * static_cast<double>(i) * Eigen::Vector3d(1, -1, 2)), centres[i]);
      poses_.push_back(map_from_cam.Inverse());
    }
    for (std::size_t i = 0; i < poses_.size(); ++i) {
      pictures_.push_back(TakePicture(wall_, camera_, poses_[i], texture, 1.0 - 0.1 * static_cast<double>(i)));
    }
  }

  const CameraModel& camera() const { return camera_; }
  DepthMatcher& matcher() const { return *matcher_; }
  const SE3& pose(int i) const { return poses_[i]; }
  std::vector<Picture>& pictures() { return pictures_; }
  DepthView View(int i) const { return {pictures_[i].view(), poses_[i]}; }
  std::vector<DepthView> Sources() const { return {View(1), View(2), View(3), View(4)}; }
  // 0: no wall there.
  double TrueRange(int cell) const { return wall_(Eigen::Vector3d::Zero(), matcher_->bearing(cell)); }
  // Every 23rd cell has a point, off by up to 8 % in turn: the seeds are no answer.
  std::vector<DepthSeed> Seeds() const {
    std::vector<DepthSeed> seeds;
    for (int cell = 11; cell < matcher_->width() * matcher_->height(); cell += 23) {
      if (!(TrueRange(cell) > 0.0)) continue;
      const double off = 1.0 + 0.04 * (static_cast<int>(seeds.size()) % 5 - 2);
      seeds.push_back({Eigen::Vector2d(cell % matcher_->width(), cell / matcher_->width()), matcher_->bearing(cell),
                       off / TrueRange(cell)});
    }
    return seeds;
  }

  struct Score {
    double median = 1.0;          // relative error
    double share_within_3 = 0.0;  // of all cells: answered, and off by at most 3 %
  };
  Score Judge(const DepthMap& depth) const {
    std::vector<double> errors;
    int num_good = 0, num_cells = 0;
    for (int cell = 0; cell < depth.num_cells(); ++cell) {
      if (!(TrueRange(cell) > 0.0)) continue;
      ++num_cells;
      if (!depth.has_depth(cell)) continue;
      errors.push_back(std::abs(depth.range_mu(cell) / TrueRange(cell) - 1.0));
      num_good += errors.back() <= 0.03 ? 1 : 0;
    }
    if (errors.empty()) return {};
    std::nth_element(errors.begin(), errors.begin() + errors.size() / 2, errors.end());
    return {errors[errors.size() / 2], static_cast<double>(num_good) / num_cells};
  }

 private:
  CameraModel camera_;
  Wall wall_;
  std::unique_ptr<DepthMatcher> matcher_;
  std::vector<SE3> poses_;
  std::vector<Picture> pictures_;
};

}  // namespace haustra
