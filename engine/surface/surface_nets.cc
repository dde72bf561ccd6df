#include "engine/surface/surface_nets.h"

#include <array>
#include <cmath>
#include <limits>
#include <numeric>
#include <utility>

namespace haustra {
namespace {

constexpr int kSide = VoxelBlocks::kSide;
constexpr std::uint32_t kNoVertex = std::numeric_limits<std::uint32_t>::max();

// A block and those beyond its upper faces, so that a voxel at most one step outside is found at once.
class Neighbourhood {
 public:
  Neighbourhood(const VoxelBlocks& blocks, int block) : blocks_(blocks) {
    for (int i = 0; i < 27; ++i) {
      const VoxelBlocks::Place step(i % 3 - 1, i / 3 % 3 - 1, i / 9 - 1);
      block_[i] = blocks.Find(blocks.place(block) + step);
    }
  }
  // Block and index of a voxel, each coordinate of [-1, kSide]; the block is kNoBlock where there is none.
  std::pair<int, int> At(int x, int y, int z) const {
    const auto part = [](int i) { return i < 0 ? 0 : (i < kSide ? 1 : 2); };
    const int block = block_[(part(z) * 3 + part(y)) * 3 + part(x)];
    const auto inside = [](int i) { return (i + kSide) % kSide; };
    return {block, VoxelBlocks::Index(inside(x), inside(y), inside(z))};
  }
  const Voxel* Find(int x, int y, int z) const {
    const auto [block, index] = At(x, y, z);
    return block == VoxelBlocks::kNoBlock ? nullptr : &blocks_.block(block)[index];
  }

 private:
  const VoxelBlocks& blocks_;
  std::array<int, 27> block_;
};

Eigen::Vector3i Corner(int k) { return {k & 1, (k >> 1) & 1, k >> 2}; }

// The vertex of the cell whose lowest voxel is (x, y, z).
bool AddVertex(const Neighbourhood& near, const Eigen::Vector3i& first, int x, int y, int z, double voxel_mu,
               int min_weight, TriangleMesh* mesh) {
  std::array<const Voxel*, 8> voxels;
  int num_behind = 0;
  for (int k = 0; k < 8; ++k) {
    const Eigen::Vector3i corner = Corner(k);
    voxels[k] = near.Find(x + corner.x(), y + corner.y(), z + corner.z());
    if (voxels[k] == nullptr || voxels[k]->weight < min_weight) return false;
    num_behind += voxels[k]->distance < 0 ? 1 : 0;
  }
  if (num_behind == 0 || num_behind == 8) return false;
  Eigen::Vector3d sum = Eigen::Vector3d::Zero(), rgb = Eigen::Vector3d::Zero();
  double colour_sum = 0.0;
  int count = 0;
  for (int a = 0; a < 8; ++a) {
    for (int axis = 0; axis < 3; ++axis) {
      const int b = a | (1 << axis);
      if (b == a || (voxels[a]->distance < 0) == (voxels[b]->distance < 0)) continue;
      const double da = voxels[a]->distance, db = voxels[b]->distance;
      const double share = da / (da - db);
      Eigen::Vector3d place = Corner(a).cast<double>();
      place[axis] += share;
      sum += place;
      for (const auto& [voxel, part] : {std::pair(voxels[a], 1.0 - share), std::pair(voxels[b], share)}) {
        // One that was only ever seen through has no colour.
        if (voxel->colour_weight == 0) continue;
        for (int c = 0; c < 3; ++c) rgb[c] += part * voxel->rgb[c];
        colour_sum += part;
      }
      ++count;
    }
  }
  const Eigen::Vector3d lowest = (first + Eigen::Vector3i(x, y, z)).cast<double>();
  // The value of a voxel is that of its middle.
  const Eigen::Vector3d position = ((lowest + sum / count).array() + 0.5).matrix() * voxel_mu;
  mesh->positions.push_back(position.cast<float>());
  auto& colour = mesh->rgb.emplace_back();
  for (int c = 0; c < 3 && colour_sum > 0.0; ++c) {
    colour[c] = static_cast<std::uint8_t>(std::lround(rgb[c] / colour_sum));
  }
  return true;
}

// Keeps the parts that hang together and have enough triangles, and the vertices that they use.
void KeepLargeParts(int min_triangles, TriangleMesh* mesh) {
  std::vector<std::uint32_t> root(mesh->positions.size());
  std::iota(root.begin(), root.end(), 0u);
  const auto find = [&](std::uint32_t i) {
    while (root[i] != i) i = root[i] = root[root[i]];
    return i;
  };
  for (const auto& triangle : mesh->triangles) {
    for (int k = 1; k < 3; ++k) {
      const std::uint32_t a = find(triangle[0]), b = find(triangle[k]);
      root[std::max(a, b)] = std::min(a, b);
    }
  }
  std::vector<int> size(root.size(), 0);
  for (const auto& triangle : mesh->triangles) ++size[find(triangle[0])];
  TriangleMesh kept;
  std::vector<std::uint32_t> renamed(root.size(), kNoVertex);
  for (const auto& triangle : mesh->triangles) {
    if (size[find(triangle[0])] < min_triangles) continue;
    auto& renamed_triangle = kept.triangles.emplace_back();
    for (int k = 0; k < 3; ++k) {
      const std::uint32_t old = triangle[k];
      if (renamed[old] == kNoVertex) {
        renamed[old] = static_cast<std::uint32_t>(kept.positions.size());
        kept.positions.push_back(mesh->positions[old]);
        kept.rgb.push_back(mesh->rgb[old]);
      }
      renamed_triangle[k] = renamed[old];
    }
  }
  *mesh = std::move(kept);
}

}  // namespace

TriangleMesh ExtractMesh(const VoxelBlocks& blocks, double voxel_mu, const MeshOptions& options) {
  TriangleMesh mesh;
  std::vector<std::uint32_t> vertex_of(std::size_t(blocks.num_blocks()) * VoxelBlocks::kVoxels, kNoVertex);
  const auto for_each_voxel = [](const auto& body) {
    for (int z = 0; z < kSide; ++z) {
      for (int y = 0; y < kSide; ++y) {
        for (int x = 0; x < kSide; ++x) body(x, y, z);
      }
    }
  };
  for (int block = 0; block < blocks.num_blocks(); ++block) {
    const Neighbourhood near(blocks, block);
    const Eigen::Vector3i first = blocks.place(block) * kSide;
    for_each_voxel([&](int x, int y, int z) {
      const auto vertex = static_cast<std::uint32_t>(mesh.positions.size());
      if (AddVertex(near, first, x, y, z, voxel_mu, options.min_weight, &mesh)) {
        vertex_of[std::size_t(block) * VoxelBlocks::kVoxels + VoxelBlocks::Index(x, y, z)] = vertex;
      }
    });
  }
  for (int block = 0; block < blocks.num_blocks(); ++block) {
    const Neighbourhood near(blocks, block);
    const auto vertex_at = [&](const Eigen::Vector3i& cell) {
      const auto [owner, index] = near.At(cell.x(), cell.y(), cell.z());
      return owner == VoxelBlocks::kNoBlock ? kNoVertex : vertex_of[std::size_t(owner) * VoxelBlocks::kVoxels + index];
    };
    for_each_voxel([&](int x, int y, int z) {
      const Voxel& here = blocks.block(block)[VoxelBlocks::Index(x, y, z)];
      if (here.weight < options.min_weight) return;
      for (int axis = 0; axis < 3; ++axis) {
        Eigen::Vector3i at(x, y, z), next = at;
        ++next[axis];
        const Voxel* there = near.Find(next.x(), next.y(), next.z());
        if (there == nullptr || there->weight < options.min_weight) continue;
        if ((here.distance < 0) == (there->distance < 0)) continue;
        const int u = (axis + 1) % 3, v = (axis + 2) % 3;
        Eigen::Vector3i below_u = at, below_v = at, below_both = at;
        --below_u[u];
        --below_v[v];
        --below_both[u];
        --below_both[v];
        std::array<std::uint32_t, 4> quad{vertex_at(below_both), vertex_at(below_v), vertex_at(at), vertex_at(below_u)};
        if (quad[0] == kNoVertex || quad[1] == kNoVertex || quad[2] == kNoVertex || quad[3] == kNoVertex) continue;
        // As listed, the quad turns about +axis. Cameras are where the distance is positive.
        if (here.distance >= 0) std::swap(quad[1], quad[3]);
        mesh.triangles.push_back({quad[0], quad[1], quad[2]});
        mesh.triangles.push_back({quad[0], quad[2], quad[3]});
      }
    });
  }
  KeepLargeParts(options.min_part_triangles, &mesh);
  return mesh;
}

}  // namespace haustra
