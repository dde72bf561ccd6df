#include "tools/evaluate/colmap_reader.h"

#include <cmath>
#include <span>
#include <unordered_map>
#include <utility>

#include "capture/files/whole_file.h"
#include "engine/geometry/se3.h"
#include "tools/evaluate/colmap_text.h"
#include "tools/evaluate/statistics.h"
#include "tools/evaluate/text_input.h"

namespace haustra::evaluate {
namespace {

Status Bad(const std::string& path, std::size_t line, const std::string& what) {
  return InvalidArgument(path + ":" + std::to_string(line) + ": " + what);
}

// Lines that hold data, with their numbers; an empty line counts (an image may have no keypoints).
struct Line {
  std::size_t number;
  std::string_view text;
};

std::vector<Line> DataLines(std::string_view text) {
  std::vector<Line> lines;
  std::size_t number = 0;
  for (const std::string_view line : SplitLines(text)) {
    ++number;
    if (!line.starts_with('#')) lines.push_back({number, line});
  }
  return lines;
}

// Numbers of fields [first, first + count).
std::optional<std::vector<double>> Numbers(const std::vector<std::string_view>& fields, std::size_t first,
                                           std::size_t count) {
  if (fields.size() < first + count) return std::nullopt;
  std::vector<double> values;
  for (std::size_t i = first; i < first + count; ++i) {
    const std::optional<double> value = ParseNumber(fields[i]);
    if (!value) return std::nullopt;
    values.push_back(*value);
  }
  return values;
}

Result<CameraCalibration> ReadCamera(const std::string& path) {
  HAUSTRA_ASSIGN(const std::string text, ReadWholeText(path));
  const std::vector<Line> lines = DataLines(text);
  if (lines.empty()) return InvalidArgument(path + ": no camera in it");
  const std::vector<std::string_view> fields = SplitBlanks(lines[0].text);
  const std::string_view model = fields.size() > 1 ? fields[1] : std::string_view{};
  const std::size_t num_coefficients = model == "FULL_OPENCV" ? 8 : 4;
  if (model != "OPENCV_FISHEYE" && model != "OPENCV" && model != "FULL_OPENCV") {
    return Bad(path, lines[0].number, "camera model '" + std::string(model) + "' is not known here");
  }
  const auto values = Numbers(fields, 2, 6 + num_coefficients);
  if (!values) return Bad(path, lines[0].number, "not a camera: size and parameters must be numbers");
  const auto width = ParseInteger(fields[2]), height = ParseInteger(fields[3]);
  const auto is_size = [](std::optional<std::int64_t> size) { return size && *size > 0 && std::in_range<int>(*size); };
  if (!is_size(width) || !is_size(height)) return Bad(path, lines[0].number, "not the size of a picture");
  CameraCalibration camera;
  camera.kind = model == "OPENCV_FISHEYE" ? CameraModelKind::kKannalaBrandt : CameraModelKind::kPinhole;
  camera.width_px = static_cast<int>(*width);
  camera.height_px = static_cast<int>(*height);
  camera.fx = (*values)[2];
  camera.fy = (*values)[3];
  camera.cx = (*values)[4] - kColmapPixelOrigin;
  camera.cy = (*values)[5] - kColmapPixelOrigin;
  // FULL_OPENCV: k1 k2 p1 p2 k3 and the rational part, which the export never uses.
  const std::size_t num_used = num_coefficients == 8 ? 5 : 4;
  for (std::size_t i = 0; i < num_used; ++i) camera.coefficients[i] = (*values)[6 + i];
  return camera;
}

// Camera centres in the map, by image id.
Result<std::unordered_map<std::int64_t, Eigen::Vector3d>> ReadCentres(const std::string& path) {
  HAUSTRA_ASSIGN(const std::string text, ReadWholeText(path));
  const std::vector<Line> lines = DataLines(text);
  std::unordered_map<std::int64_t, Eigen::Vector3d> centres;
  for (std::size_t i = 0; i < lines.size(); i += 2) {
    const std::vector<std::string_view> fields = SplitBlanks(lines[i].text);
    const std::optional<std::int64_t> id = fields.empty() ? std::nullopt : ParseInteger(fields[0]);
    const auto pose = Numbers(fields, 1, 7);
    if (!id || *id < kFirstColmapImageId || !pose) {
      return Bad(path, lines[i].number, "not an image: id, quaternion and translation expected");
    }
    const std::optional<SE3> cam_from_map = ColmapPose(std::span<const double, 7>(*pose));
    if (!cam_from_map) return Bad(path, lines[i].number, "not a rotation");
    centres[*id] = cam_from_map->InverseTranslation();
  }
  return centres;
}

}  // namespace

Result<MapGeometry> ReadColmapGeometry(const std::string& folder) {
  MapGeometry geometry;
  HAUSTRA_ASSIGN(geometry.camera, ReadCamera(folder + "/cameras.txt"));
  HAUSTRA_ASSIGN(const auto centres, ReadCentres(folder + "/images.txt"));
  const std::string path = folder + "/points3D.txt";
  HAUSTRA_ASSIGN(const std::string text, ReadWholeText(path));
  std::map<std::int64_t, std::vector<double>> distances;  // by image id
  for (const Line& line : DataLines(text)) {
    const std::vector<std::string_view> fields = SplitBlanks(line.text);
    constexpr std::size_t kFirstOfTrack = 8;
    const auto position = Numbers(fields, 1, 3);
    if (!position || fields.size() < kFirstOfTrack) return Bad(path, line.number, "not a point");
    const Eigen::Vector3d point((*position)[0], (*position)[1], (*position)[2]);
    for (std::size_t i = kFirstOfTrack; i + 1 < fields.size(); i += 2) {
      const std::optional<std::int64_t> image_id = ParseInteger(fields[i]);
      const auto centre = image_id ? centres.find(*image_id) : centres.end();
      if (centre == centres.end()) {
        return Bad(path, line.number, "image '" + std::string(fields[i]) + "' is not in images.txt");
      }
      const double distance = (point - centre->second).norm();
      if (!std::isfinite(distance)) return Bad(path, line.number, "farther away than numbers reach");
      distances[*image_id].push_back(distance);
    }
  }
  std::vector<double> depths;
  for (auto& [image_id, values] : distances) {
    const double depth = Median(std::move(values));
    geometry.keyframe_depth_mu[image_id - kFirstColmapImageId] = depth;
    depths.push_back(depth);
  }
  if (!depths.empty()) geometry.depth_mu = Median(std::move(depths));
  return geometry;
}

}  // namespace haustra::evaluate
