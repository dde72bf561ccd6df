#include "tools/report/map_model.h"

#include <zlib.h>

#include <cstdio>
#include <filesystem>
#include <optional>

#include "capture/files/whole_file.h"
#include "tools/evaluate/colmap_text.h"
#include "tools/evaluate/text_input.h"
#include "tools/run/map_name.h"

namespace haustra::report {
namespace {

using evaluate::kColmapPixelOrigin;
using evaluate::kFirstColmapImageId;
using evaluate::ParseInteger;
using evaluate::ParseNumber;

Status Bad(const std::string& path, std::size_t line, const char* what) {
  return InvalidArgument(path + ":" + std::to_string(line) + ": " + what);
}

Status ReadKeyframes(const std::string& path, MapModel* model) {
  HAUSTRA_ASSIGN(const std::string text, ReadWholeText(path));
  MapModel::Keyframe* keyframe = nullptr;  // whose second line comes next
  std::size_t number = 0;
  for (const std::string_view line : evaluate::SplitLines(text)) {
    ++number;
    if (line.starts_with('#')) continue;
    const std::vector<std::string_view> fields = evaluate::SplitBlanks(line);
    if (keyframe == nullptr) {
      if (fields.empty()) continue;
      const auto id = ParseInteger(fields[0]);
      if (!id || *id < kFirstColmapImageId || fields.size() != 10)
        return Bad(path, number, "not an image: ten fields expected");
      std::array<double, 7> pose{};  // qw qx qy qz, x y z
      for (std::size_t i = 0; i < pose.size(); ++i) {
        const auto value = ParseNumber(fields[1 + i]);
        if (!value) return Bad(path, number, "not a pose");
        pose[i] = *value;
      }
      const std::optional<SE3> cam_from_map = evaluate::ColmapPose(pose);
      if (!cam_from_map) return Bad(path, number, "not a rotation");
      keyframe = &model->keyframes[*id - kFirstColmapImageId];
      keyframe->cam_from_map = *cam_from_map;
      keyframe->image_name = fields[9];
      continue;
    }
    if (fields.size() % 3 != 0) return Bad(path, number, "keypoints come in threes: x, y, point");
    for (std::size_t i = 0; i < fields.size(); i += 3) {
      const auto x = ParseNumber(fields[i]), y = ParseNumber(fields[i + 1]);
      const auto point_id = ParseInteger(fields[i + 2]);
      if (!x || !y || !point_id) return Bad(path, number, "not a keypoint");
      if (*point_id >= 0) keyframe->pixels[*point_id] = {*x - kColmapPixelOrigin, *y - kColmapPixelOrigin};
    }
    keyframe = nullptr;
  }
  return Status::Ok();
}

Status ReadPoints(const std::string& path, MapModel* model) {
  HAUSTRA_ASSIGN(const std::string text, ReadWholeText(path));
  std::size_t number = 0;
  for (const std::string_view line : evaluate::SplitLines(text)) {
    ++number;
    const std::vector<std::string_view> fields = evaluate::SplitBlanks(line);
    if (fields.empty() || fields[0].starts_with('#')) continue;
    if (fields.size() < 7) return Bad(path, number, "not a point");
    const auto id = ParseInteger(fields[0]);
    const auto x = ParseNumber(fields[1]), y = ParseNumber(fields[2]), z = ParseNumber(fields[3]);
    if (!id || !x || !y || !z) return Bad(path, number, "not a point");
    model->point_ids.push_back(*id);
    model->points.emplace_back(*x, *y, *z);
    std::array<std::uint8_t, 3> rgb{};
    for (std::size_t i = 0; i < 3; ++i) {
      const auto channel = ParseInteger(fields[4 + i]);
      if (!channel || *channel < 0 || *channel > 255) return Bad(path, number, "not a colour");
      rgb[i] = static_cast<std::uint8_t>(*channel);
    }
    model->rgb.push_back(rgb);
  }
  return Status::Ok();
}

}  // namespace

Result<MapModel> ReadMapModel(const std::string& folder) {
  MapModel model;
  HAUSTRA_TRY(ReadKeyframes(folder + "/images.txt", &model));
  HAUSTRA_TRY(ReadPoints(folder + "/points3D.txt", &model));
  return model;
}

Result<std::map<int, MapModel>> ReadMapModels(const evaluate::RunOutput& run) {
  std::map<int, MapModel> models;
  const std::filesystem::path maps = std::filesystem::path(run.folder) / "maps";
  std::error_code error;
  if (!run.maps.empty() && !std::filesystem::is_directory(maps, error)) {
    return NotFound(maps.string() + ": no such folder");
  }
  for (const auto& [map_id, geometry] : run.geometry) {
    HAUSTRA_ASSIGN(models[map_id], ReadMapModel((maps / MapName(map_id)).string()));
  }
  return models;
}

std::string ChecksumOfPoses(const MapModel& model) {
  auto crc = ::crc32_z(0, nullptr, 0);
  const auto add = [&crc](const void* bytes, std::size_t num) {
    crc = ::crc32_z(crc, static_cast<const Bytef*>(bytes), num);
  };
  for (const auto& [keyframe_id, keyframe] : model.keyframes) {
    add(&keyframe_id, sizeof(keyframe_id));
    add(keyframe.cam_from_map.rotation.coeffs().data(), 4 * sizeof(double));
    add(keyframe.cam_from_map.translation.data(), 3 * sizeof(double));
  }
  char text[16];
  std::snprintf(text, sizeof(text), "%08lx", static_cast<unsigned long>(crc));
  return text;
}

}  // namespace haustra::report
