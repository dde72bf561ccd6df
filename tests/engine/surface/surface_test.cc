// From true depths to a mesh: volume, fusion, triangles.
#include <gtest/gtest.h>

#include <algorithm>
#include <map>
#include <set>

#include "engine/surface/depth_fusion.h"
#include "engine/surface/surface_nets.h"
#include "tests/engine/surface/textured_scene.h"

namespace haustra {
namespace {

TEST(VoxelBlocks, FullPoolRefusesAndCountsAndKeepsWhatIsThere) {
  VoxelBlocks blocks(3);
  for (int i = 0; i < 3; ++i) EXPECT_EQ(blocks.FindOrAdd({i, -i, 5 * i}), i);
  blocks.block(1)[7].weight = 9;
  EXPECT_EQ(blocks.FindOrAdd({9, 9, 9}), VoxelBlocks::kNoBlock);
  EXPECT_EQ(blocks.num_refused(), 1);
  EXPECT_EQ(blocks.FindOrAdd({1, -1, 5}), 1);
  EXPECT_EQ(blocks.Find({9, 9, 9}), VoxelBlocks::kNoBlock);
  blocks.Reset();
  EXPECT_EQ(blocks.num_blocks(), 0);
  EXPECT_EQ(blocks.num_refused(), 0);
  EXPECT_EQ(blocks.Find({1, -1, 5}), VoxelBlocks::kNoBlock);
  // What was in a block before is not in the new one.
  EXPECT_EQ(blocks.FindOrAdd({2, 2, 2}), 0);
  EXPECT_EQ(blocks.FindOrAdd({3, 3, 3}), 1);
  EXPECT_EQ(blocks.block(1)[7].weight, 0);
}

TEST(VoxelBlocks, ManyPlacesAreFoundAgainAndFarOnesRefused) {
  VoxelBlocks blocks(1000);
  for (int i = 0; i < 1000; ++i) ASSERT_EQ(blocks.FindOrAdd({i % 10 - 5, i / 10 % 10 - 5, i / 100 - 5}), i);
  for (int i = 0; i < 1000; ++i) ASSERT_EQ(blocks.Find({i % 10 - 5, i / 10 % 10 - 5, i / 100 - 5}), i);
  VoxelBlocks one(1);
  EXPECT_EQ(one.FindOrAdd({1 << 20, 0, 0}), VoxelBlocks::kNoBlock);
  EXPECT_GE(VoxelBlocks::BytesFor(1000), 1000u * 512u * sizeof(Voxel));
}

class FusionTest : public ::testing::Test {
 protected:
  static constexpr double kRadius = 1.5;
  void Fuse(int max_blocks) {
    FusionOptions options;
    options.voxel_mu = 0.05;
    fusion_ = std::make_unique<DepthFusion>(camera_, kStep, options, max_blocks);
    const int width = camera_.width_px() / kStep, height = camera_.height_px() / kStep;
    const Wall wall = SphereWall(Eigen::Vector3d::Zero(), kRadius);
    // Grey by the side: what is seen at x > 0 is bright.
    std::vector<std::uint8_t> grey(std::size_t(camera_.width_px()) * camera_.height_px());
    for (const Eigen::Vector3d& centre : {Eigen::Vector3d(0, 0, 0), Eigen::Vector3d(0.3, 0.1, -0.2)}) {
      const SE3 cam_from_map(Eigen::Quaterniond::Identity(), -centre);
      DepthMap depth(width, height);
      depth.Clear(0.5);
      for (int i = 0; i < depth.num_cells(); ++i) {
        Eigen::Vector3d bearing;
        ASSERT_TRUE(camera_.Unproject({CellCentrePx(i % width, kStep), CellCentrePx(i / width, kStep)}, &bearing));
        depth.Set(i, 1.0 / wall(centre, bearing), 255);
      }
      for (int y = 0; y < camera_.height_px(); ++y) {
        for (int x = 0; x < camera_.width_px(); ++x) {
          Eigen::Vector3d bearing;
          ASSERT_TRUE(camera_.Unproject(Eigen::Vector2d(x, y), &bearing));
          const Eigen::Vector3d point = centre + wall(centre, bearing) * bearing;
          grey[std::size_t(y) * camera_.width_px() + x] = point.x() > 0 ? 200 : 50;
        }
      }
      fusion_->Integrate(depth, {grey.data(), camera_.width_px(), camera_.height_px(), camera_.width_px()},
                         cam_from_map);
    }
  }
  CameraModel camera_ = *CameraModel::Create(SmallFisheye());
  std::unique_ptr<DepthFusion> fusion_;
};

TEST_F(FusionTest, TheMeshLiesOnTheWallAndFacesTheCameras) {
  Fuse(20000);
  const TriangleMesh mesh = ExtractMesh(fusion_->blocks(), 0.05, {});
  ASSERT_GT(mesh.triangles.size(), 1000u);
  EXPECT_EQ(fusion_->blocks().num_refused(), 0);
  double worst = 0.0, sum = 0.0;
  for (const Eigen::Vector3f& position : mesh.positions) {
    const double off = position.norm() - kRadius;
    worst = std::max(worst, std::abs(off));
    sum += off;
  }
  EXPECT_LT(worst, 0.02);
  EXPECT_NEAR(sum / static_cast<double>(mesh.positions.size()), 0.0, 0.003);
  int num_wrong_colours = 0;
  for (std::size_t i = 0; i < mesh.positions.size(); ++i) {
    const float x = mesh.positions[i].x();
    if (std::abs(x) > 0.1f) num_wrong_colours += std::abs(mesh.rgb[i][1] - (x > 0 ? 200 : 50)) > 10 ? 1 : 0;
  }
  EXPECT_LT(num_wrong_colours, static_cast<int>(mesh.positions.size()) / 100);
  std::map<std::pair<std::uint32_t, std::uint32_t>, int> edges;
  for (const auto& t : mesh.triangles) {
    const Eigen::Vector3f a = mesh.positions[t[0]], b = mesh.positions[t[1]], c = mesh.positions[t[2]];
    ASSERT_LT((b - a).cross(c - a).dot(a), 0.0f);  // towards the middle of the sphere
    for (int k = 0; k < 3; ++k) ++edges[{t[k], t[(k + 1) % 3]}];
  }
  // No edge is used twice in one direction: a manifold, turned the same way everywhere.
  for (const auto& [edge, count] : edges) ASSERT_EQ(count, 1);
}

TEST_F(FusionTest, TheSameDepthsGiveTheSameMesh) {
  Fuse(20000);
  const TriangleMesh first = ExtractMesh(fusion_->blocks(), 0.05, {});
  Fuse(20000);
  const TriangleMesh second = ExtractMesh(fusion_->blocks(), 0.05, {});
  EXPECT_EQ(first.triangles, second.triangles);
  EXPECT_EQ(first.rgb, second.rgb);
  ASSERT_EQ(first.positions.size(), second.positions.size());
  for (std::size_t i = 0; i < first.positions.size(); ++i) ASSERT_EQ(first.positions[i], second.positions[i]);
}

// Of one colour, and seen from the middle: a wall at each of the ranges in turn.
class FusionOrderTest : public ::testing::Test {
 protected:
  static constexpr std::uint8_t kGrey = 200;
  // A keyframe for each range, in the grey of its number; those beyond the greys in the last one.
  DepthFusion Fuse(const std::vector<double>& ranges, const std::vector<std::uint8_t>& greys = {kGrey}) const {
    const int width = camera_.width_px() / kStep, height = camera_.height_px() / kStep;
    FusionOptions options;
    options.voxel_mu = 0.05;
    DepthFusion fusion(camera_, kStep, options, 20000);
    DepthMap depth(width, height);
    for (std::size_t k = 0; k < ranges.size(); ++k) {
      depth.Clear(0.4);
      for (int i = 0; i < depth.num_cells(); ++i) depth.Set(i, 1.0 / ranges[k], 255);
      const std::vector<std::uint8_t> grey(std::size_t(width) * height, greys[std::min(k, greys.size() - 1)]);
      fusion.Integrate(depth, {grey.data(), width, height, width}, SE3());
    }
    return fusion;
  }
  // Of all voxels that both have.
  static int LargestDifference(const VoxelBlocks& a, const VoxelBlocks& b) {
    int largest = 0;
    for (int block = 0; block < a.num_blocks(); ++block) {
      const int other = b.Find(a.place(block));
      for (int i = 0; other != VoxelBlocks::kNoBlock && i < VoxelBlocks::kVoxels; ++i) {
        largest = std::max(largest, std::abs(a.block(block)[i].distance - b.block(other)[i].distance));
      }
    }
    return largest;
  }

  CameraModel camera_ = *CameraModel::Create(SmallFisheye());
};

TEST_F(FusionOrderTest, AVoxelThatWasFirstSeenThroughHasTheColourOfItsWall) {
  const DepthFusion fusion = Fuse({1.8, 1.5});
  int num_coloured = 0;
  for (int block = 0; block < fusion.blocks().num_blocks(); ++block) {
    for (const Voxel& voxel : fusion.blocks().block(block)) {
      ASSERT_TRUE(voxel.rgb[0] == 0 || voxel.rgb[0] == kGrey) << static_cast<int>(voxel.rgb[0]);
      num_coloured += voxel.rgb[0] == kGrey ? 1 : 0;
    }
  }
  EXPECT_GT(num_coloured, 10000);
}

// A voxel before the wall may have been seen through only: it has no colour.
TEST(SurfaceNets, AVertexBesideAVoxelWithoutColourHasTheOthers) {
  VoxelBlocks blocks(1);
  VoxelBlocks::Block& block = blocks.block(blocks.FindOrAdd({0, 0, 0}));
  for (int i = 0; i < VoxelBlocks::kVoxels; ++i) {
    const bool is_before = i < VoxelBlocks::kVoxels / 2;
    block[i].distance = is_before ? 20000 : -10000;
    block[i].weight = 100;
    block[i].colour_weight = is_before ? 0 : 100;
    if (!is_before) block[i].rgb = {200, 100, 50};
  }
  MeshOptions options;
  options.min_part_triangles = 1;
  const TriangleMesh mesh = ExtractMesh(blocks, 0.05, options);
  ASSERT_EQ(mesh.rgb.size(), 49u);
  for (const auto& rgb : mesh.rgb) EXPECT_EQ(rgb, (std::array<std::uint8_t, 3>{200, 100, 50}));
}

TEST_F(FusionOrderTest, KeyframesThatSeeAWallAlikeShareInItsColour) {
  const DepthFusion fusion = Fuse({1.5, 1.5}, {100, 200});
  int num_coloured = 0;
  for (int block = 0; block < fusion.blocks().num_blocks(); ++block) {
    for (const Voxel& voxel : fusion.blocks().block(block)) {
      ASSERT_TRUE(voxel.rgb[0] == 0 || voxel.rgb[0] == 150) << static_cast<int>(voxel.rgb[0]);
      num_coloured += voxel.rgb[0] == 150 ? 1 : 0;
    }
  }
  EXPECT_GT(num_coloured, 10000);
}

TEST_F(FusionOrderTest, ManyKeyframesCountAlikeInAnyOrder) {
  std::vector<double> ranges(80, 1.45);
  std::fill(ranges.begin() + 40, ranges.end(), 1.55);
  const DepthFusion fusion = Fuse(ranges);
  std::reverse(ranges.begin(), ranges.end());
  EXPECT_LT(LargestDifference(fusion.blocks(), Fuse(ranges).blocks()), Voxel::kUnit / 100);
}

TEST_F(FusionTest, AFullPoolKeepsAPartOfTheWall) {
  Fuse(60);
  EXPECT_EQ(fusion_->blocks().num_blocks(), 60);
  EXPECT_GT(fusion_->blocks().num_refused(), 0);
  MeshOptions options;
  options.min_part_triangles = 1;
  for (const Eigen::Vector3f& position : ExtractMesh(fusion_->blocks(), 0.05, options).positions) {
    ASSERT_NEAR(position.norm(), kRadius, 0.03);
  }
}

TEST_F(FusionTest, SmallPartsAndUncertainVoxelsAreLeftOut) {
  Fuse(20000);
  MeshOptions options;
  options.min_part_triangles = 1000000;
  EXPECT_TRUE(ExtractMesh(fusion_->blocks(), 0.05, options).positions.empty());
  options = {};
  options.min_weight = 255;
  EXPECT_TRUE(ExtractMesh(fusion_->blocks(), 0.05, options).triangles.empty());
}

}  // namespace
}  // namespace haustra
