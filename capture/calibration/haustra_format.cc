#include <string>
#include <vector>

#include "capture/calibration/formats.h"

namespace haustra::capture::internal {
namespace {

// Model name, and the names of its intrinsics and coefficients.
struct ModelKeys {
  std::string_view name;
  CameraModelKind kind;
  std::vector<std::string_view> intrinsics;
  std::vector<std::string_view> coefficients;
  std::size_t num_required_coefficients;
};

const std::vector<ModelKeys>& Models() {
  static const std::vector<ModelKeys> models = {
      {"pinhole", CameraModelKind::kPinhole, {"fx", "fy", "cx", "cy"}, {"k1", "k2", "p1", "p2", "k3"}, 4},
      {"kannala_brandt", CameraModelKind::kKannalaBrandt, {"fx", "fy", "cx", "cy"}, {"k1", "k2", "k3", "k4"}, 4},
      {"ocamcalib", CameraModelKind::kOcamCalib, {"cx", "cy"}, {"a0", "a2", "a3", "a4", "c", "d", "e"}, 7},
  };
  return models;
}

Result<const ModelKeys*> FindModel(const YamlMap& file) {
  HAUSTRA_ASSIGN(const std::string name, file.Text("model"));
  std::string known;
  for (const ModelKeys& model : Models()) {
    if (model.name == name) return &model;
    known += (known.empty() ? "" : ", ") + std::string(model.name);
  }
  return InvalidArgument(file.Where("model") + " is '" + name + "'; known: " + known);
}

double* Intrinsic(std::string_view name, CameraCalibration* calibration) {
  if (name == "fx") return &calibration->fx;
  if (name == "fy") return &calibration->fy;
  if (name == "cx") return &calibration->cx;
  return &calibration->cy;
}

}  // namespace

Result<CameraCalibration> ReadHaustraFormat(const YamlMap& file) {
  HAUSTRA_TRY(file.RequireKnown({"model", "width_px", "height_px", "rate_hz", "max_half_angle_deg", "focal_guess_sigma",
                                 "intrinsics", "coefficients"}));
  HAUSTRA_ASSIGN(const ModelKeys* model, FindModel(file));

  CameraCalibration calibration;
  calibration.kind = model->kind;
  HAUSTRA_ASSIGN(const std::int64_t width, file.IntegerIn("width_px", kMinImageSidePx, kMaxImageSidePx));
  HAUSTRA_ASSIGN(const std::int64_t height, file.IntegerIn("height_px", kMinImageSidePx, kMaxImageSidePx));
  calibration.width_px = static_cast<int>(width);
  calibration.height_px = static_cast<int>(height);
  if (file.Has("rate_hz")) {
    HAUSTRA_ASSIGN(calibration.rate_hz, file.Number("rate_hz"));
  }
  if (file.Has("max_half_angle_deg")) {
    HAUSTRA_ASSIGN(calibration.max_half_angle_deg, file.Number("max_half_angle_deg"));
  }
  if (file.Has("focal_guess_sigma")) {
    HAUSTRA_ASSIGN(calibration.focal_guess_sigma, file.Number("focal_guess_sigma"));
  }

  HAUSTRA_ASSIGN(const YamlMap intrinsics, file.Map("intrinsics"));
  HAUSTRA_TRY(intrinsics.RequireKnown(model->intrinsics));
  for (const std::string_view name : model->intrinsics) {
    HAUSTRA_ASSIGN(*Intrinsic(name, &calibration), intrinsics.Number(name));
  }

  HAUSTRA_ASSIGN(const YamlMap coefficients, file.Map("coefficients"));
  HAUSTRA_TRY(coefficients.RequireKnown(model->coefficients));
  for (std::size_t i = 0; i < model->coefficients.size(); ++i) {
    const std::string_view name = model->coefficients[i];
    if (i >= model->num_required_coefficients && !coefficients.Has(name)) continue;
    HAUSTRA_ASSIGN(calibration.coefficients[i], coefficients.Number(name));
  }

  HAUSTRA_TRY(CheckCalibration(calibration, [&](std::string_view field) {
    if (intrinsics.Has(field)) return intrinsics.Where(field);
    if (coefficients.Has(field)) return coefficients.Where(field);
    return file.Where(field);
  }));
  return calibration;
}

}  // namespace haustra::capture::internal
