// Kalibr camchains and the sensor.yaml of EuRoC name the same things nearly alike.
#include <algorithm>
#include <string>
#include <vector>

#include "capture/calibration/formats.h"
#include "capture/number.h"

namespace haustra::capture::internal {
namespace {

struct Keys {
  std::string_view coefficients;
  std::string_view radtan;  // what the format calls the radial-tangential model
};

Status ReadDistortion(const YamlMap& camera, const Keys& keys, CameraCalibration* calibration) {
  HAUSTRA_ASSIGN(const std::string model, camera.Text("distortion_model"));
  if (IsOneOf(model, {"none"})) {
    calibration->kind = CameraModelKind::kPinhole;
    return Status::Ok();
  }
  if (model == keys.radtan) {
    calibration->kind = CameraModelKind::kPinhole;  // k1 k2 p1 p2, as in OpenCV
  } else if (IsOneOf(model, {"equidistant"})) {
    calibration->kind = CameraModelKind::kKannalaBrandt;
  } else {
    return InvalidArgument(camera.Where("distortion_model") + " is '" + model +
                           "'; supported: " + std::string(keys.radtan) + ", equidistant, none");
  }
  HAUSTRA_ASSIGN(const std::vector<double> coefficients, camera.Numbers(keys.coefficients));
  if (coefficients.size() != 4) {
    return InvalidArgument(camera.Where(keys.coefficients) + " holds " + std::to_string(coefficients.size()) +
                           " numbers, not 4");
  }
  std::copy(coefficients.begin(), coefficients.end(), calibration->coefficients.begin());
  return Status::Ok();
}

Result<CameraCalibration> ReadCamera(const YamlMap& camera, const Keys& keys) {
  HAUSTRA_TRY(camera.RequireNoMisspelling(
      {"camera_model", "intrinsics", "distortion_model", keys.coefficients, "resolution", "rate_hz"}));
  HAUSTRA_ASSIGN(const std::string model, camera.Text("camera_model"));
  if (model != "pinhole") {
    return InvalidArgument(camera.Where("camera_model") + " is '" + model +
                           "', which is not supported; calibrate as pinhole-equi (Kannala-Brandt) for a wide lens or "
                           "pinhole-radtan for a narrow one");
  }
  CameraCalibration calibration;
  HAUSTRA_TRY(ReadDistortion(camera, keys, &calibration));

  HAUSTRA_ASSIGN(const std::vector<double> intrinsics, camera.Numbers("intrinsics"));
  if (intrinsics.size() != 4) {
    return InvalidArgument(camera.Where("intrinsics") + " holds " + std::to_string(intrinsics.size()) +
                           " numbers, not 4 (fx, fy, cx, cy)");
  }
  calibration.fx = intrinsics[0];
  calibration.fy = intrinsics[1];
  calibration.cx = intrinsics[2];
  calibration.cy = intrinsics[3];

  HAUSTRA_ASSIGN(const std::vector<double> resolution, camera.Numbers("resolution"));
  const auto is_side = [](double v) {
    return v >= kMinImageSidePx && v <= kMaxImageSidePx && v == static_cast<int>(v);
  };
  if (resolution.size() != 2 || !is_side(resolution[0]) || !is_side(resolution[1])) {
    return InvalidArgument(camera.Where("resolution") + " is not a width and a height in pixels, " +
                           std::to_string(kMinImageSidePx) + " to " + std::to_string(kMaxImageSidePx));
  }
  calibration.width_px = static_cast<int>(resolution[0]);
  calibration.height_px = static_cast<int>(resolution[1]);
  if (camera.Has("rate_hz")) {
    HAUSTRA_ASSIGN(calibration.rate_hz, camera.Number("rate_hz"));
  }
  HAUSTRA_TRY(CheckCalibration(calibration, [&](std::string_view field) {
    if (field == "rate_hz") return camera.Where(field);
    return camera.Where(IsDistortion(field) ? keys.coefficients : "intrinsics") + ": " + std::string(field);
  }));
  return calibration;
}

}  // namespace

Result<CameraCalibration> ReadKalibrFormat(const YamlMap& file) {
  std::vector<std::string> cameras;
  for (const std::string& key : file.Keys()) {
    if (key.starts_with("cam")) cameras.push_back(key);
  }
  if (cameras.size() > 1) {
    return InvalidArgument(file.Where(cameras[1]) + ": the chain holds " + std::to_string(cameras.size()) +
                           " cameras; keep the one that is used");
  }
  HAUSTRA_ASSIGN(const YamlMap camera, file.Map(cameras.empty() ? "cam0" : cameras[0]));
  return ReadCamera(camera, {.coefficients = "distortion_coeffs", .radtan = "radtan"});
}

Result<CameraCalibration> ReadEurocFormat(const YamlMap& file) {
  if (file.Has("sensor_type")) {
    HAUSTRA_ASSIGN(const std::string type, file.Text("sensor_type"));
    if (type != "camera") return InvalidArgument(file.Where("sensor_type") + " is '" + type + "', not 'camera'");
  }
  return ReadCamera(file, {.coefficients = "distortion_coefficients", .radtan = "radial-tangential"});
}

Result<std::array<double, 16>> ReadEurocBodyFromCam(const YamlMap& file) {
  HAUSTRA_ASSIGN(const YamlMap matrix, file.Map("T_BS"));
  HAUSTRA_ASSIGN(const std::vector<double> data, matrix.Numbers("data"));
  std::array<double, 16> body_from_cam{};
  if (data.size() != body_from_cam.size()) {
    return InvalidArgument(matrix.Where("data") + " holds " + std::to_string(data.size()) + " numbers, not 16");
  }
  std::copy(data.begin(), data.end(), body_from_cam.begin());
  return body_from_cam;
}

}  // namespace haustra::capture::internal
