#include "capture/calibration_reader.h"

#include <algorithm>
#include <exception>
#include <utility>
#include <vector>

#include "capture/calibration/formats.h"
#include "capture/calibration/yaml_map.h"
#include "capture/files/whole_file.h"

namespace haustra {
namespace {

using capture::internal::YamlMap;

constexpr std::size_t kMaxCalibrationBytes = std::size_t{1} << 20;

bool IsXml(const std::string& text) {
  const std::size_t first = text.find_first_not_of(" \t\r\n\xef\xbb\xbf");
  return first != std::string::npos && text[first] == '<';
}

Result<CameraCalibration> ReadXml(const std::string& path, const std::string& text) {
  if (text.find("<opencv_storage>") != std::string::npos) {
    return InvalidArgument(path + ": OpenCV XML is not supported; write it as YAML (a file name that ends in .yaml)");
  }
  return capture::internal::ReadCalibuFormat(path, text);
}

Status UnknownFormat(const std::string& path, const YamlMap& file) {
  std::string keys;
  for (const std::string& key : file.Keys()) {
    if (keys.size() > 60) {
      keys += ", ...";
      break;
    }
    keys += (keys.empty() ? "" : ", ") + key;
  }
  return InvalidArgument(path +
                         ": not a camera calibration that is known here; looked for Camera.type (settings), model "
                         "with width_px (haustra), camera_matrix (OpenCV), cam0 (Kalibr), T_BS or sensor_type (EuRoC); "
                         "found: " +
                         keys);
}

Result<CameraCalibration> ReadYaml(const std::string& path, std::string text) {
  HAUSTRA_ASSIGN(const YamlMap file, YamlMap::Parse(path, std::move(text)));
  // The keys that only one format has come first; `model` alone may also be in an OpenCV file.
  if (file.HasPrefix("Camera.")) return capture::internal::ReadSettingsFormat(file);
  if (file.HasAny({"camera_matrix", "Camera_Matrix", "Distortion_Coefficients"})) {
    return capture::internal::ReadOpencvFormat(file);
  }
  if (file.HasAny({"sensor_type", "T_BS"})) return capture::internal::ReadEurocFormat(file);
  if (file.HasPrefix("cam0") || file.HasPrefix("cam1")) return capture::internal::ReadKalibrFormat(file);
  if (file.HasAny({"model", "width_px", "height_px", "coefficients"}))
    return capture::internal::ReadHaustraFormat(file);
  if (file.Has("distortion_coefficients")) return capture::internal::ReadOpencvFormat(file);
  return UnknownFormat(path, file);
}

}  // namespace

Result<CameraCalibration> ReadCalibration(const std::string& path) {
  HAUSTRA_ASSIGN(std::string text, ReadWholeText(path, kMaxCalibrationBytes));
  if (text.find('\0') != std::string::npos) return InvalidArgument(path + ": a binary file, not a calibration");
  // yaml-cpp's nodes may throw also when they are read.
  try {
    return IsXml(text) ? ReadXml(path, text) : ReadYaml(path, std::move(text));
  } catch (const std::exception& e) {
    return InvalidArgument(path + ": cannot be read as a calibration: " + e.what());
  }
}

}  // namespace haustra
