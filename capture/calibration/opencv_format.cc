#include <algorithm>
#include <string>
#include <vector>

#include "capture/calibration/formats.h"
#include "capture/number.h"

namespace haustra::capture::internal {
namespace {

struct Matrix {
  int rows = 0;
  int cols = 0;
  std::vector<double> data;  // row-major
};

Result<Matrix> ReadMatrix(const YamlMap& file, std::string_view key) {
  HAUSTRA_ASSIGN(const YamlMap map, file.Map(key));
  HAUSTRA_TRY(map.RequireKnown({"rows", "cols", "dt", "data"}));
  Matrix matrix;
  HAUSTRA_ASSIGN(const std::int64_t rows, map.IntegerIn("rows", 1, 16));
  HAUSTRA_ASSIGN(const std::int64_t cols, map.IntegerIn("cols", 1, 16));
  matrix.rows = static_cast<int>(rows);
  matrix.cols = static_cast<int>(cols);
  HAUSTRA_ASSIGN(matrix.data, map.Numbers("data"));
  if (matrix.data.size() != static_cast<std::size_t>(rows * cols)) {
    return InvalidArgument(map.Where("data") + " holds " + std::to_string(matrix.data.size()) + " numbers, not " +
                           std::to_string(rows) + " x " + std::to_string(cols));
  }
  return matrix;
}

// Which model the file itself claims.
Result<CameraModelKind> ReadModel(const YamlMap& file, std::string_view coefficients_key) {
  for (const std::string_view key : {"model", "distortion_model"}) {
    if (!file.Has(key)) continue;
    HAUSTRA_ASSIGN(const std::string name, file.Text(key));
    if (IsOneOf(name, {"pinhole", "radtan", "plumb_bob"})) return CameraModelKind::kPinhole;
    if (IsOneOf(name, {"fisheye", "equidistant", "kannala_brandt"})) return CameraModelKind::kKannalaBrandt;
    return InvalidArgument(file.Where(key) + " is '" + name +
                           "'; known: pinhole (radtan, plumb_bob), fisheye (equidistant, kannala_brandt)");
  }
  for (const std::string_view key : {"fisheye", "fisheye_model"}) {
    if (!file.Has(key)) continue;
    HAUSTRA_ASSIGN(const std::string value, file.Text(key));
    if (IsOneOf(value, {"1", "true"})) return CameraModelKind::kKannalaBrandt;
    if (IsOneOf(value, {"0", "false"})) return CameraModelKind::kPinhole;
    return InvalidArgument(file.Where(key) + " is '" + value + "', not 0 or 1");
  }
  return InvalidArgument(
      file.Where(coefficients_key) +
      ": the file does not say which distortion model these belong to, and their number does not tell: "
      "add a line 'model: pinhole' or 'model: fisheye'");
}

Status ReadCameraMatrix(const YamlMap& file, std::string_view key, CameraCalibration* calibration) {
  HAUSTRA_ASSIGN(const Matrix k, ReadMatrix(file, key));
  if (k.rows != 3 || k.cols != 3) return InvalidArgument(file.Where(key) + " is not 3 x 3");
  const std::vector<double>& m = k.data;
  if (m[1] != 0.0)
    return InvalidArgument(file.Where(key) + " has a skew of " + FormatDouble(m[1]) + ", which is not supported");
  if (m[3] != 0.0 || m[6] != 0.0 || m[7] != 0.0 || m[8] != 1.0) {
    return InvalidArgument(file.Where(key) + " is not of the form [fx 0 cx; 0 fy cy; 0 0 1]");
  }
  calibration->fx = m[0];
  calibration->fy = m[4];
  calibration->cx = m[2];
  calibration->cy = m[5];
  return Status::Ok();
}

Status ReadDistortion(const YamlMap& file, std::string_view key, CameraCalibration* calibration) {
  HAUSTRA_ASSIGN(const Matrix matrix, ReadMatrix(file, key));
  const std::size_t num = matrix.data.size();
  if (matrix.rows != 1 && matrix.cols != 1) return InvalidArgument(file.Where(key) + " is not a row or a column");
  if (calibration->kind == CameraModelKind::kKannalaBrandt) {
    if (num != kNumKannalaBrandtCoefficients) {
      return InvalidArgument(file.Where(key) + " holds " + std::to_string(num) + " numbers; a fisheye model has 4");
    }
  } else {
    if (num != 4 && num != 5 && num != 8 && num != 12 && num != 14) {
      return InvalidArgument(file.Where(key) + " holds " + std::to_string(num) +
                             " numbers; OpenCV's pinhole model has 4 or 5");
    }
    for (std::size_t i = kNumPinholeCoefficients; i < num; ++i) {
      if (matrix.data[i] == 0.0) continue;
      return InvalidArgument(file.Where(key) + " number " + std::to_string(i + 1) +
                             " is not zero: rational, thin-prism and tilted models are not supported");
    }
  }
  const std::size_t num_used = std::min<std::size_t>(num, kNumPinholeCoefficients);
  std::copy_n(matrix.data.begin(), num_used, calibration->coefficients.begin());
  return Status::Ok();
}

}  // namespace

Result<CameraCalibration> ReadOpencvFormat(const YamlMap& file) {
  const std::string_view matrix_key = file.Has("Camera_Matrix") ? "Camera_Matrix" : "camera_matrix";
  const std::string_view distortion_key =
      file.Has("Distortion_Coefficients") ? "Distortion_Coefficients" : "distortion_coefficients";
  const std::string_view width_key = file.Has("image_Width") ? "image_Width" : "image_width";
  const std::string_view height_key = file.Has("image_Height") ? "image_Height" : "image_height";
  HAUSTRA_TRY(file.RequireNoMisspelling({matrix_key, distortion_key, width_key, height_key}));

  CameraCalibration calibration;
  HAUSTRA_ASSIGN(const std::int64_t width, file.IntegerIn(width_key, kMinImageSidePx, kMaxImageSidePx));
  HAUSTRA_ASSIGN(const std::int64_t height, file.IntegerIn(height_key, kMinImageSidePx, kMaxImageSidePx));
  calibration.width_px = static_cast<int>(width);
  calibration.height_px = static_cast<int>(height);
  HAUSTRA_ASSIGN(calibration.kind, ReadModel(file, distortion_key));
  HAUSTRA_TRY(ReadCameraMatrix(file, matrix_key, &calibration));
  HAUSTRA_TRY(ReadDistortion(file, distortion_key, &calibration));
  if (file.Has("rate_hz")) {
    HAUSTRA_ASSIGN(calibration.rate_hz, file.Number("rate_hz"));
  }
  HAUSTRA_TRY(CheckCalibration(calibration, [&](std::string_view field) {
    if (field == "rate_hz") return file.Where(field);
    return file.Where(IsDistortion(field) ? distortion_key : matrix_key) + ": " + std::string(field);
  }));
  return calibration;
}

}  // namespace haustra::capture::internal
