#include "tools/export/glb_writer.h"

#include <algorithm>
#include <nlohmann/json.hpp>
#include <string_view>
#include <vector>

#include "engine/io/byte_order.h"
#include "platform/version.h"

namespace haustra::exporting {
namespace {

// Numbers of the specification.
constexpr std::uint32_t kMagic = 0x46546c67, kVersion = 2, kJsonChunk = 0x4e4f534a, kBinaryChunk = 0x004e4942;
constexpr int kByte = 5121, kIndex = 5125, kFloat = 5126;  // component types
constexpr int kVertices = 34962, kIndices = 34963;         // targets
constexpr int kPointsMode = 0, kLinesMode = 1;

// The binary part and the JSON that describes it, as they grow.
class GlbFile {
 public:
  // Returns the accessor.
  int AddPositions(const std::vector<Eigen::Vector3d>& positions) {
    Begin();
    Eigen::Vector3f low = positions.front().cast<float>(), high = low;
    for (const Eigen::Vector3d& position : positions) {
      const Eigen::Vector3f p = position.cast<float>();
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
  int AddColours(const std::vector<std::array<std::uint8_t, 3>>& colours) {
    Begin();
    for (const auto& rgb : colours) {
      for (const std::uint8_t channel : rgb) bytes_.push_back(static_cast<char>(channel));
      bytes_.push_back(static_cast<char>(255));  // alpha: a vertex begins at a multiple of four
    }
    return End({{"componentType", kByte}, {"normalized", true}, {"type", "VEC4"}}, kVertices, colours.size());
  }
  int AddIndices(const std::vector<std::uint32_t>& indices) {
    Begin();
    for (const std::uint32_t index : indices) writer_.U32(index);
    return End({{"componentType", kIndex}, {"type", "SCALAR"}}, kIndices, indices.size());
  }
  // A mesh of one primitive, and its node below the map's.
  void AddMesh(const std::string& name, nlohmann::json primitive) {
    primitive["material"] = 0;
    json_["meshes"].push_back({{"name", name}, {"primitives", nlohmann::json::array({std::move(primitive)})}});
    json_["nodes"][0]["children"].push_back(json_["nodes"].size());
    json_["nodes"].push_back({{"name", name}, {"mesh", json_["meshes"].size() - 1}});
  }
  nlohmann::json& json() { return json_; }

  std::string Finish() {
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

 private:
  void Begin() { begin_ = bytes_.size(); }
  // All components here are of four bytes together, so that the next view begins at a multiple of four.
  int End(nlohmann::json accessor, int target, std::size_t count) {
    json_["bufferViews"].push_back(
        {{"buffer", 0}, {"byteOffset", begin_}, {"byteLength", bytes_.size() - begin_}, {"target", target}});
    accessor["bufferView"] = json_["bufferViews"].size() - 1;
    accessor["count"] = count;
    json_["accessors"].push_back(std::move(accessor));
    return static_cast<int>(json_["accessors"].size()) - 1;
  }

  nlohmann::json json_;
  std::string bytes_;
  ByteWriter writer_{&bytes_};
  std::size_t begin_ = 0;
};

}  // namespace

std::string GlbBytes(const ExportedMap& map) {
  GlbFile file;
  nlohmann::json& json = file.json();
  json["asset"] = {{"version", "2.0"}, {"generator", std::string("haustra ") + Version()}};
  json["scene"] = 0;
  json["scenes"] = {{{"nodes", {0}}}};
  json["nodes"] = {{{"name", "map " + std::to_string(map.map_id)}, {"rotation", {1, 0, 0, 0}}}};
  // As the camera saw them: no light falls on them.
  json["extensionsUsed"] = {"KHR_materials_unlit"};
  json["materials"] = {{{"name", "unlit"}, {"extensions", {{"KHR_materials_unlit", nlohmann::json::object()}}}}};
  if (!map.points.empty()) {
    const int positions = file.AddPositions(map.points), colours = file.AddColours(map.rgb);
    file.AddMesh("points", {{"mode", kPointsMode}, {"attributes", {{"POSITION", positions}, {"COLOR_0", colours}}}});
  }
  std::vector<Eigen::Vector3d> path;
  std::vector<std::uint32_t> lines;
  for (std::size_t i = 0; i < map.frames.size(); ++i) {
    path.push_back(map.frames[i].world_from_cam.translation);
    if (i == 0 || map.frames[i].frame_idx != map.frames[i - 1].frame_idx + 1) continue;
    lines.insert(lines.end(), {static_cast<std::uint32_t>(i - 1), static_cast<std::uint32_t>(i)});
  }
  if (!lines.empty()) {
    const int positions = file.AddPositions(path), indices = file.AddIndices(lines);
    file.AddMesh("camera path",
                 {{"mode", kLinesMode}, {"attributes", {{"POSITION", positions}}}, {"indices", indices}});
  }
  return file.Finish();
}

}  // namespace haustra::exporting
