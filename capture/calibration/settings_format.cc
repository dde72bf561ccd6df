#include <string>
#include <vector>

#include "capture/calibration/formats.h"

namespace haustra::capture::internal {
namespace {

constexpr std::string_view kPrefix = "Camera.";

std::string KeyOf(std::string_view field) {
  if (field == "width_px") return "Camera.width";
  if (field == "height_px") return "Camera.height";
  if (field == "rate_hz") return "Camera.fps";
  return std::string(kPrefix) + std::string(field);
}

Status ReadCoefficients(const YamlMap& file, const std::vector<std::string_view>& names,
                        CameraCalibration* calibration) {
  for (std::size_t i = 0; i < names.size(); ++i) {
    HAUSTRA_ASSIGN(calibration->coefficients[i], file.Number(std::string(kPrefix) + std::string(names[i])));
  }
  return Status::Ok();
}

}  // namespace

Result<CameraCalibration> ReadSettingsFormat(const YamlMap& file) {
  std::vector<std::string_view> known = {"Camera.type",   "Camera.fx",  "Camera.fy",  "Camera.cx",
                                         "Camera.cy",     "Camera.k1",  "Camera.k2",  "Camera.k3",
                                         "Camera.k4",     "Camera.p1",  "Camera.p2",  "Camera.width",
                                         "Camera.height", "Camera.fps", "Camera.RGB", "Camera.focal_guess_sigma"};
  HAUSTRA_TRY(file.RequireKnown(known));
  HAUSTRA_ASSIGN(const std::string type, file.Text("Camera.type"));

  CameraCalibration calibration;
  if (type == "KannalaBrandt8") {
    calibration.kind = CameraModelKind::kKannalaBrandt;
    std::erase(known, "Camera.p1");
    std::erase(known, "Camera.p2");
    HAUSTRA_TRY(file.RequireKnown(known));
    HAUSTRA_TRY(ReadCoefficients(file, {"k1", "k2", "k3", "k4"}, &calibration));
  } else if (type == "PinHole") {
    calibration.kind = CameraModelKind::kPinhole;
    std::erase(known, "Camera.k4");
    HAUSTRA_TRY(file.RequireKnown(known));
    if (file.HasAny({"Camera.k1", "Camera.k2", "Camera.p1", "Camera.p2", "Camera.k3"})) {
      HAUSTRA_TRY(ReadCoefficients(file, {"k1", "k2", "p1", "p2"}, &calibration));
      if (file.Has("Camera.k3")) {
        HAUSTRA_ASSIGN(calibration.coefficients[4], file.Number("Camera.k3"));
      }
    }
  } else {
    return InvalidArgument(file.Where("Camera.type") + " is '" + type + "'; known: KannalaBrandt8, PinHole");
  }

  HAUSTRA_ASSIGN(const std::int64_t width, file.IntegerIn("Camera.width", kMinImageSidePx, kMaxImageSidePx));
  HAUSTRA_ASSIGN(const std::int64_t height, file.IntegerIn("Camera.height", kMinImageSidePx, kMaxImageSidePx));
  calibration.width_px = static_cast<int>(width);
  calibration.height_px = static_cast<int>(height);
  HAUSTRA_ASSIGN(calibration.fx, file.Number("Camera.fx"));
  HAUSTRA_ASSIGN(calibration.fy, file.Number("Camera.fy"));
  HAUSTRA_ASSIGN(calibration.cx, file.Number("Camera.cx"));
  HAUSTRA_ASSIGN(calibration.cy, file.Number("Camera.cy"));
  if (file.Has("Camera.fps")) {
    HAUSTRA_ASSIGN(calibration.rate_hz, file.Number("Camera.fps"));
  }
  if (file.Has("Camera.focal_guess_sigma")) {
    HAUSTRA_ASSIGN(calibration.focal_guess_sigma, file.Number("Camera.focal_guess_sigma"));
  }
  if (file.Has("Camera.RGB")) {
    // The order of the channels in the maker's memory; image files say theirs themselves.
    HAUSTRA_TRY(file.IntegerIn("Camera.RGB", 0, 1).status());
  }
  HAUSTRA_TRY(CheckCalibration(calibration, [&](std::string_view field) { return file.Where(KeyOf(field)); }));
  return calibration;
}

}  // namespace haustra::capture::internal
