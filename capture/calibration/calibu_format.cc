// The rig XML of Calibu and Vicalib, in which EndoMapper publishes its geometrical calibrations:
// <rig><camera><camera_model type=".."> with <width>, <height> and <params> [ a; b; .. ] in the order that the type's
// name gives.
#include <algorithm>
#include <string>
#include <vector>

#include "capture/calibration/formats.h"
#include "capture/calibration/xml_elements.h"
#include "capture/number.h"

namespace haustra::capture::internal {
namespace {

std::string Where(const std::string& path, const XmlElement& element) {
  return path + ":" + std::to_string(element.line) + ": <" + element.name + ">";
}

// The one child of this name; the files that are read hold one camera, so a flat list is enough.
Result<const XmlElement*> FindOne(const std::string& path, const std::vector<XmlElement>& elements,
                                  std::string_view name) {
  const XmlElement* found = nullptr;
  for (const XmlElement& element : elements) {
    if (element.name != name) continue;
    if (found != nullptr) {
      return InvalidArgument(Where(path, element) + " comes twice; rigs with more than one camera are not supported");
    }
    found = &element;
  }
  if (found == nullptr)
    return InvalidArgument(path + ": no <" + std::string(name) + ">; this is not a Calibu camera rig");
  return found;
}

// "[ 717.2; 717.5 ]": numbers between brackets, separated by semicolons, commas or spaces.
Result<std::vector<double>> ParseList(const std::string& path, const XmlElement& element) {
  std::vector<double> numbers;
  std::string word;
  for (const char c : element.text + " ") {
    const bool separates =
        c == ' ' || c == '\t' || c == '\n' || c == '\r' || c == ';' || c == ',' || c == '[' || c == ']';
    if (!separates) {
      word += c;
      continue;
    }
    if (word.empty()) continue;
    const Result<double> number = ParseDouble(word);
    if (!number.ok()) {
      return InvalidArgument(Where(path, element) + " number " + std::to_string(numbers.size() + 1) + ": " +
                             number.status().message());
    }
    numbers.push_back(*number);
    word.clear();
  }
  return numbers;
}

Result<int> ParseSide(const std::string& path, const std::vector<XmlElement>& elements, std::string_view name) {
  HAUSTRA_ASSIGN(const XmlElement* element, FindOne(path, elements, name));
  HAUSTRA_ASSIGN(const std::vector<double> numbers, ParseList(path, *element));
  const bool is_side = numbers.size() == 1 && numbers[0] >= kMinImageSidePx && numbers[0] <= kMaxImageSidePx &&
                       numbers[0] == static_cast<int>(numbers[0]);
  if (is_side) return static_cast<int>(numbers[0]);
  return InvalidArgument(Where(path, *element) + " is not one number of pixels, " + std::to_string(kMinImageSidePx) +
                         " to " + std::to_string(kMaxImageSidePx));
}

}  // namespace

Result<CameraCalibration> ReadCalibuFormat(const std::string& path, std::string_view text) {
  HAUSTRA_ASSIGN(const std::vector<XmlElement> elements, ParseXml(path, text));
  HAUSTRA_ASSIGN(const XmlElement* model, FindOne(path, elements, "camera_model"));
  HAUSTRA_ASSIGN(const XmlElement* params, FindOne(path, elements, "params"));
  HAUSTRA_ASSIGN(const std::vector<double> values, ParseList(path, *params));

  CameraCalibration calibration;
  const std::string type = model->Attribute("type");
  // Positions of the coefficients after the first four (or two) numbers, in the order of hal/camera_calibration.h.
  std::vector<std::size_t> slots;
  std::size_t num_intrinsics = 4;
  if (type == "calibu_fu_fv_u0_v0") {
    calibration.kind = CameraModelKind::kPinhole;
  } else if (type == "calibu_fu_fv_u0_v0_k1_k2") {
    calibration.kind = CameraModelKind::kPinhole;
    slots = {0, 1};
  } else if (type == "calibu_fu_fv_u0_v0_k1_k2_k3") {
    calibration.kind = CameraModelKind::kPinhole;
    slots = {0, 1, 4};
  } else if (type == "calibu_fu_fv_u0_v0_kb4") {
    calibration.kind = CameraModelKind::kKannalaBrandt;
    slots = {0, 1, 2, 3};
  } else if (type == "ocamcalib_cx_cy_a0_a2_a3_a4_e_f_g") {
    calibration.kind = CameraModelKind::kOcamCalib;
    num_intrinsics = 2;
    slots = {0, 1, 2, 3, 4, 5, 6};  // its e f g are our c d e
  } else {
    return InvalidArgument(Where(path, *model) + " has type '" + type +
                           "'; supported: calibu_fu_fv_u0_v0 and that with _k1_k2, _k1_k2_k3 or _kb4, "
                           "ocamcalib_cx_cy_a0_a2_a3_a4_e_f_g");
  }
  if (values.size() != num_intrinsics + slots.size()) {
    return InvalidArgument(Where(path, *params) + " holds " + std::to_string(values.size()) + " numbers; type '" +
                           type + "' has " + std::to_string(num_intrinsics + slots.size()));
  }

  if (num_intrinsics == 4) {
    calibration.fx = values[0];
    calibration.fy = values[1];
  }
  calibration.cx = values[num_intrinsics - 2];
  calibration.cy = values[num_intrinsics - 1];
  for (std::size_t i = 0; i < slots.size(); ++i) calibration.coefficients[slots[i]] = values[num_intrinsics + i];
  HAUSTRA_ASSIGN(calibration.width_px, ParseSide(path, elements, "width"));
  HAUSTRA_ASSIGN(calibration.height_px, ParseSide(path, elements, "height"));
  HAUSTRA_TRY(CheckCalibration(
      calibration, [&](std::string_view field) { return Where(path, *params) + ": " + std::string(field); }));
  return calibration;
}

}  // namespace haustra::capture::internal
