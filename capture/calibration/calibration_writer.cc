#include <string>
#include <string_view>
#include <vector>

#include "capture/calibration/formats.h"
#include "capture/calibration_reader.h"
#include "capture/files/file_sink.h"
#include "capture/number.h"

namespace haustra {
namespace {

using capture::internal::FormatDouble;

// Before any comment.
constexpr std::string_view kSettingsHead = "%YAML:1.0\n";

std::string SettingsText(const CameraCalibration& calibration) {
  const bool is_pinhole = calibration.kind == CameraModelKind::kPinhole;
  std::vector<std::string_view> names = {"k1", "k2", "k3", "k4"};
  if (is_pinhole) names = {"k1", "k2", "p1", "p2", "k3"};

  std::string text(kSettingsHead);
  text += is_pinhole
              ? "# Pinhole with radial-tangential distortion; pixel centres at integers\n"
              : "# Kannala-Brandt: r = f*(th + k1 th^3 + k2 th^5 + k3 th^7 + k4 th^9); pixel centres at integers\n";
  const auto line = [&text](std::string_view key, const std::string& value) {
    text += "Camera." + std::string(key) + ": " + value + "\n";
  };
  line("type", is_pinhole ? "\"PinHole\"" : "\"KannalaBrandt8\"");
  line("fx", FormatDouble(calibration.fx));
  line("fy", FormatDouble(calibration.fy));
  line("cx", FormatDouble(calibration.cx));
  line("cy", FormatDouble(calibration.cy));
  for (std::size_t i = 0; i < names.size(); ++i) {
    if (names[i] == "k3" && is_pinhole && calibration.coefficients[i] == 0.0) continue;
    line(names[i], FormatDouble(calibration.coefficients[i]));
  }
  line("width", std::to_string(calibration.width_px));
  line("height", std::to_string(calibration.height_px));
  if (calibration.rate_hz > 0.0) line("fps", FormatDouble(calibration.rate_hz));
  line("RGB", "1");
  if (calibration.focal_guess_sigma > 0.0) line("focal_guess_sigma", FormatDouble(calibration.focal_guess_sigma));
  return text;
}

std::string HaustraText(const CameraCalibration& calibration) {
  std::string_view model = "pinhole";
  std::vector<std::string_view> names = {"k1", "k2", "p1", "p2", "k3"};
  if (calibration.kind == CameraModelKind::kKannalaBrandt) {
    model = "kannala_brandt";
    names = {"k1", "k2", "k3", "k4"};
  } else if (calibration.kind == CameraModelKind::kOcamCalib) {
    model = "ocamcalib";
    names = {"a0", "a2", "a3", "a4", "c", "d", "e"};
  }

  std::string text = "model: " + std::string(model) + "\n";
  text += "width_px: " + std::to_string(calibration.width_px) + "\n";
  text += "height_px: " + std::to_string(calibration.height_px) + "\n";
  if (calibration.rate_hz > 0.0) text += "rate_hz: " + FormatDouble(calibration.rate_hz) + "\n";
  if (calibration.max_half_angle_deg > 0.0) {
    text += "max_half_angle_deg: " + FormatDouble(calibration.max_half_angle_deg) + "\n";
  }
  if (calibration.focal_guess_sigma > 0.0) {
    text += "focal_guess_sigma: " + FormatDouble(calibration.focal_guess_sigma) + "\n";
  }
  text += "intrinsics:\n";
  if (calibration.kind != CameraModelKind::kOcamCalib) {
    text += "  fx: " + FormatDouble(calibration.fx) + "\n";
    text += "  fy: " + FormatDouble(calibration.fy) + "\n";
  }
  text += "  cx: " + FormatDouble(calibration.cx) + "\n";
  text += "  cy: " + FormatDouble(calibration.cy) + "\n";
  text += "coefficients:\n";
  for (std::size_t i = 0; i < names.size(); ++i) {
    text += "  " + std::string(names[i]) + ": " + FormatDouble(calibration.coefficients[i]) + "\n";
  }
  return text;
}

}  // namespace

std::string CalibrationText(const CameraCalibration& calibration, std::string_view remark) {
  const bool needs_own_format = calibration.kind == CameraModelKind::kOcamCalib || calibration.max_half_angle_deg > 0.0;
  std::string text = needs_own_format ? HaustraText(calibration) : SettingsText(calibration);
  const std::size_t head = text.starts_with(kSettingsHead) ? kSettingsHead.size() : 0;
  if (!remark.empty()) text.insert(head, "# " + std::string(remark) + "\n");
  return text;
}

Status WriteCalibration(const std::string& path, const CameraCalibration& calibration, std::string_view remark) {
  HAUSTRA_TRY(capture::internal::CheckCalibration(
      calibration, [&path](std::string_view field) { return path + ": not written: " + std::string(field); }));
  return WriteWholeFile(path, CalibrationText(calibration, remark));
}

}  // namespace haustra
