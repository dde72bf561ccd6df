#include "tools/export/glb_file.h"

#include <utility>

#include "platform/version.h"

namespace haustra::exporting {
namespace {

// Numbers of the specification.
constexpr std::uint32_t kMagic = 0x46546c67, kVersion = 2, kJsonChunk = 0x4e4f534a, kBinaryChunk = 0x004e4942;
constexpr int kByte = 5121, kIndex = 5125, kFloat = 5126;  // component types
constexpr int kVertices = 34962, kIndices = 34963;         // targets

}  // namespace

GlbFile::GlbFile(int map_id) {
  json_["asset"] = {{"version", "2.0"}, {"generator", std::string("haustra ") + Version()}};
  json_["scene"] = 0;
  json_["scenes"] = {{{"nodes", {0}}}};
  json_["nodes"] = {{{"name", "map " + std::to_string(map_id)}, {"rotation", {1, 0, 0, 0}}}};
  json_["extensionsUsed"] = {"KHR_materials_unlit"};
  json_["materials"] = {{{"name", "unlit"}, {"extensions", {{"KHR_materials_unlit", nlohmann::json::object()}}}}};
}

int GlbFile::AddPositions(const std::vector<Eigen::Vector3f>& positions) {
  Begin();
  Eigen::Vector3f low = positions.front(), high = low;
  for (const Eigen::Vector3f& p : positions) {
    low = low.cwiseMin(p);
    high = high.cwiseMax(p);
    for (int axis = 0; axis < 3; ++axis) writer_.F32(p[axis]);
  }
  nlohmann::json accessor = {{"componentType", kFloat}, {"type", "VEC3"}};
  for (int axis = 0; axis < 3; ++axis) {
    accessor["min"].push_back(low[axis]);
    accessor["max"].push_back(high[axis]);
  }
  return End(std::move(accessor), kVertices, positions.size());
}

int GlbFile::AddColours(const std::vector<std::array<std::uint8_t, 3>>& colours) {
  Begin();
  for (const auto& rgb : colours) {
    for (const std::uint8_t channel : rgb) bytes_.push_back(static_cast<char>(channel));
    bytes_.push_back(static_cast<char>(255));  // alpha: a vertex begins at a multiple of four
  }
  return End({{"componentType", kByte}, {"normalized", true}, {"type", "VEC4"}}, kVertices, colours.size());
}

int GlbFile::AddIndices(const std::vector<std::uint32_t>& indices) {
  Begin();
  for (const std::uint32_t index : indices) writer_.U32(index);
  return End({{"componentType", kIndex}, {"type", "SCALAR"}}, kIndices, indices.size());
}

void GlbFile::AddMesh(const std::string& name, nlohmann::json primitive) {
  primitive["material"] = 0;
  json_["meshes"].push_back({{"name", name}, {"primitives", nlohmann::json::array({std::move(primitive)})}});
  json_["nodes"][0]["children"].push_back(json_["nodes"].size());
  json_["nodes"].push_back({{"name", name}, {"mesh", json_["meshes"].size() - 1}});
}

// All components here are of four bytes together, so that the next view begins at a multiple of four.
int GlbFile::End(nlohmann::json accessor, int target, std::size_t count) {
  json_["bufferViews"].push_back(
      {{"buffer", 0}, {"byteOffset", begin_}, {"byteLength", bytes_.size() - begin_}, {"target", target}});
  accessor["bufferView"] = json_["bufferViews"].size() - 1;
  accessor["count"] = count;
  json_["accessors"].push_back(std::move(accessor));
  return static_cast<int>(json_["accessors"].size()) - 1;
}

std::string GlbFile::Finish() {
  if (!bytes_.empty()) json_["buffers"].push_back({{"byteLength", bytes_.size()}});
  std::string text = json_.dump();
  text.resize((text.size() + 3) / 4 * 4, ' ');
  std::string file;
  ByteWriter writer(&file);
  const std::size_t binary = bytes_.empty() ? 0 : 8 + bytes_.size();
  for (const std::uint32_t value : {kMagic, kVersion, static_cast<std::uint32_t>(12 + 8 + text.size() + binary),
                                    static_cast<std::uint32_t>(text.size()), kJsonChunk}) {
    writer.U32(value);
  }
  file += text;
  if (!bytes_.empty()) {
    writer.U32(static_cast<std::uint32_t>(bytes_.size()));
    writer.U32(kBinaryChunk);
    file += bytes_;
  }
  return file;
}

}  // namespace haustra::exporting
