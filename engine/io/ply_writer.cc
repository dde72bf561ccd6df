#include "engine/io/ply_writer.h"

#include <bit>

#include "engine/io/text_writer.h"

namespace haustra {
namespace {

void AppendLittleEndian(std::uint32_t value, std::string* bytes) {
  for (int shift = 0; shift < 32; shift += 8) bytes->push_back(static_cast<char>((value >> shift) & 0xff));
}

void AppendLittleEndian(float value, std::string* bytes) {
  AppendLittleEndian(std::bit_cast<std::uint32_t>(value), bytes);
}

}  // namespace

Status WritePly(ByteSink& sink, const MapExport& map) {
  TextWriter writer(sink);
  writer.Text("ply\nformat binary_little_endian 1.0\ncomment haustra map ").Integer(map.map_id);
  writer.Text(", lengths in map units (monocular, no metric scale)\nelement vertex ");
  writer.Integer(static_cast<std::int64_t>(map.points.size()));
  writer.Text(
      "\nproperty float x\nproperty float y\nproperty float z\n"
      "property uchar red\nproperty uchar green\nproperty uchar blue\n"
      "property int num_observations\nproperty int map_id\nend_header\n");
  std::string vertex;
  for (const PointExport& point : map.points) {
    vertex.clear();
    for (int axis = 0; axis < 3; ++axis) AppendLittleEndian(static_cast<float>(point.position[axis]), &vertex);
    for (const std::uint8_t channel : point.rgb) vertex.push_back(static_cast<char>(channel));
    AppendLittleEndian(static_cast<std::uint32_t>(point.track.size()), &vertex);
    AppendLittleEndian(static_cast<std::uint32_t>(map.map_id), &vertex);
    writer.Text(vertex);
  }
  return writer.Finish();
}

Status WriteMeshPly(ByteSink& sink, const TriangleMesh& mesh, int map_id) {
  TextWriter writer(sink);
  writer.Text("ply\nformat binary_little_endian 1.0\ncomment haustra surface of map ").Integer(map_id);
  writer.Text(", lengths in map units (monocular, no metric scale)\nelement vertex ");
  writer.Integer(static_cast<std::int64_t>(mesh.positions.size()));
  writer.Text(
      "\nproperty float x\nproperty float y\nproperty float z\n"
      "property uchar red\nproperty uchar green\nproperty uchar blue\nelement face ");
  writer.Integer(static_cast<std::int64_t>(mesh.triangles.size()));
  writer.Text("\nproperty list uchar int vertex_indices\nend_header\n");
  std::string bytes;
  for (std::size_t i = 0; i < mesh.positions.size(); ++i) {
    bytes.clear();
    for (int axis = 0; axis < 3; ++axis) AppendLittleEndian(mesh.positions[i][axis], &bytes);
    for (const std::uint8_t channel : mesh.rgb[i]) bytes.push_back(static_cast<char>(channel));
    writer.Text(bytes);
  }
  for (const auto& triangle : mesh.triangles) {
    bytes.assign(1, '\x03');
    for (const std::uint32_t vertex : triangle) AppendLittleEndian(vertex, &bytes);
    writer.Text(bytes);
  }
  return writer.Finish();
}

}  // namespace haustra
