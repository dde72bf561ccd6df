#include "engine/surface/depth_fusion.h"

#include <Eigen/Geometry>
#include <algorithm>
#include <array>
#include <cmath>

namespace haustra {
namespace {

// Below this a wall is seen so much at a slant that its depth says little about where it is.
constexpr double kMinSquareness = 0.1;
// Cells beside each other whose ranges differ by more lie on two walls.
constexpr double kEdge = 0.12;
constexpr int kMaxVote = 8;  // of one keyframe at most: a voxel counts more of them than a map has

// The mean that had `weight`, with `vote` more of `value`.
double Mean(double mean, int weight, double value, int vote) {
  return (mean * weight + value * vote) / (weight + vote);
}

}  // namespace

DepthFusion::DepthFusion(const CameraModel& camera, int step_px, const FusionOptions& options, int max_blocks)
    : camera_(camera), step_px_(step_px), options_(options), blocks_(max_blocks) {
  const int width = camera.width_px() / step_px, height = camera.height_px() / step_px;
  bearings_.resize(std::size_t(width) * height, Eigen::Vector3d::Zero());
  squareness_.resize(bearings_.size());
  for (int i = 0; i < static_cast<int>(bearings_.size()); ++i) {
    Eigen::Vector3d bearing;
    if (camera_.Unproject({CellCentrePx(i % width, step_px), CellCentrePx(i / width, step_px)}, &bearing)) {
      bearings_[i] = bearing;
    }
  }
  touched_.reserve(max_blocks);
  last_touched_.resize(max_blocks, 0);
}

void DepthFusion::AddBlocksAlong(const Eigen::Vector3d& begin_in_map, const Eigen::Vector3d& end_in_map) {
  const double side = options_.voxel_mu * VoxelBlocks::kSide;
  const Eigen::Vector3d way = end_in_map - begin_in_map;
  const int steps = std::max(1, static_cast<int>(std::ceil(way.norm() / (0.25 * side))));
  VoxelBlocks::Place last = VoxelBlocks::Place::Zero();
  for (int i = 0; i <= steps; ++i) {
    const Eigen::Vector3d point = begin_in_map + way * (static_cast<double>(i) / steps);
    const VoxelBlocks::Place place = (point / side).array().floor().cast<int>();
    if (i > 0 && place == last) continue;
    last = place;
    const int block = blocks_.FindOrAdd(place);
    if (block == VoxelBlocks::kNoBlock || last_touched_[block] == call_) continue;
    last_touched_[block] = call_;
    touched_.push_back(block);
  }
}

double DepthFusion::Squareness(const DepthMap& depth, int cell) const {
  const int width = depth.width();
  const int x = cell % width, y = cell / width;
  if (x == 0 || y == 0 || x + 1 == width || y + 1 == depth.height()) return 0.0;
  const double range = depth.range_mu(cell);
  std::array<Eigen::Vector3d, 4> points;
  int k = 0;
  for (const int other : {cell - 1, cell + 1, cell - width, cell + width}) {
    if (!depth.has_depth(other)) return 0.0;
    const double other_range = depth.range_mu(other);
    if (std::abs(other_range - range) > kEdge * range) return 0.0;
    points[k++] = other_range * bearings_[other];
  }
  const Eigen::Vector3d normal = (points[1] - points[0]).cross(points[3] - points[2]);
  const double norm = normal.norm();
  return norm > 0.0 ? std::abs(normal.dot(bearings_[cell])) / norm : 0.0;
}

void DepthFusion::UpdateBlock(int block, const DepthMap& depth, ImageView colour, const SE3& cam_from_map) {
  const double truncation = options_.truncation_voxels * options_.voxel_mu;
  const Eigen::Vector3i first = blocks_.place(block) * VoxelBlocks::kSide;
  const Eigen::Matrix3d rotation = cam_from_map.matrix3();
  VoxelBlocks::Block& voxels = blocks_.block(block);
  const double offset = CellCentrePx(0, step_px_);
  for (int i = 0; i < VoxelBlocks::kVoxels; ++i) {
    const Eigen::Vector3i inside(i % VoxelBlocks::kSide, i / VoxelBlocks::kSide % VoxelBlocks::kSide,
                                 i / (VoxelBlocks::kSide * VoxelBlocks::kSide));
    const Eigen::Vector3d point_in_map = ((first + inside).cast<double>().array() + 0.5).matrix() * options_.voxel_mu;
    const Eigen::Vector3d point = rotation * point_in_map + cam_from_map.translation;
    Eigen::Vector2d pixel;
    if (!camera_.Project(point, &pixel)) continue;
    // Between four cells of one wall.
    const double u = (pixel.x() - offset) / step_px_, v = (pixel.y() - offset) / step_px_;
    if (!(u >= 0.0 && v >= 0.0 && u < depth.width() - 1 && v < depth.height() - 1)) continue;
    const int x = static_cast<int>(u), y = static_cast<int>(v);
    const double fu = u - x, fv = v - y;
    const std::array<int, 4> cells{y * depth.width() + x, y * depth.width() + x + 1, (y + 1) * depth.width() + x,
                                   (y + 1) * depth.width() + x + 1};
    const std::array<double, 4> shares{(1 - fu) * (1 - fv), fu * (1 - fv), (1 - fu) * fv, fu * fv};
    double inverse_range = 0.0, squareness = 0.0, confidence = 0.0;
    double low = 1e300, high = 0.0;
    for (int k = 0; k < 4; ++k) {
      const double value = depth.inverse_range(cells[k]);
      low = std::min(low, value);
      high = std::max(high, value);
      inverse_range += shares[k] * value;
      squareness += shares[k] * squareness_[cells[k]];
      confidence += shares[k] * depth.confidence(cells[k]);
    }
    if (low == 0.0 || high > low * (1.0 + kEdge) || squareness < kMinSquareness) continue;
    // Distance to the wall and not along the ray: the wall is taken as a plane near the ray.
    const double distance = (1.0 / inverse_range - point.norm()) * squareness;
    if (distance < -truncation) continue;  // hidden behind the wall
    const double share = std::min(distance / truncation, 1.0);
    const double vote = 1.0 + (kMaxVote - 1) * (confidence / 255.0) * squareness;
    const int weight = static_cast<int>(std::lround(vote));
    Voxel& voxel = voxels[i];
    voxel.distance =
        static_cast<std::int16_t>(std::lround(Mean(voxel.distance, voxel.weight, share * Voxel::kUnit, weight)));
    voxel.weight = static_cast<std::uint16_t>(std::min(voxel.weight + weight, Voxel::kMaxWeight));
    // What is seen through has not the colour of what lies behind it.
    const int colour_vote = std::min(weight, Voxel::kMaxColourWeight - voxel.colour_weight);
    if (share < 1.0 && colour_vote > 0) {
      const Eigen::Vector2d place = colour.width == depth.width() ? Eigen::Vector2d(u, v) : pixel;
      const std::uint8_t* p =
          colour.row(static_cast<int>(std::lround(place.y()))) + std::lround(place.x()) * BytesPerPixel(colour.format);
      const bool is_colour = colour.format == PixelFormat::kBgr8;
      for (int c = 0; c < 3; ++c) {
        const double value = is_colour ? p[2 - c] : p[0];
        voxel.rgb[c] =
            static_cast<std::uint8_t>(std::lround(Mean(voxel.rgb[c], voxel.colour_weight, value, colour_vote)));
      }
      voxel.colour_weight = static_cast<std::uint8_t>(voxel.colour_weight + colour_vote);
    }
  }
}

void DepthFusion::Integrate(const DepthMap& depth, ImageView colour, const SE3& cam_from_map) {
  ++call_;
  touched_.clear();
  const SE3 map_from_cam = cam_from_map.Inverse();
  const double truncation = options_.truncation_voxels * options_.voxel_mu;
  for (int i = 0; i < depth.num_cells(); ++i) {
    squareness_[i] = 0.0f;
    if (!depth.has_depth(i)) continue;
    const double squareness = Squareness(depth, i);
    if (squareness < kMinSquareness) continue;
    squareness_[i] = static_cast<float>(squareness);
    const double range = depth.range_mu(i);
    // Along the ray the band is wider where the ray meets the wall at a slant, but not without end.
    const double reach = truncation / std::max(squareness, 0.3);
    const Eigen::Vector3d begin = map_from_cam * Eigen::Vector3d(std::max(range - reach, 0.1 * range) * bearings_[i]);
    const Eigen::Vector3d end = map_from_cam * Eigen::Vector3d((range + reach) * bearings_[i]);
    AddBlocksAlong(begin, end);
  }
  for (const int block : touched_) UpdateBlock(block, depth, colour, cam_from_map);
}

}  // namespace haustra
