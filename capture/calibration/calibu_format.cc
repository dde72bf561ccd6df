// The rig XML of Calibu and Vicalib, in which EndoMapper publishes its geometrical calibrations:
// <rig><camera><camera_model type=".."> with <width>, <height> and <params> [ a; b; .. ] in the order that the type's
// name gives.
#include <algorithm>
#include <cstddef>
#include <pugixml.hpp>
#include <string>
#include <string_view>
#include <vector>

#include "capture/calibration/formats.h"
#include "capture/number.h"

namespace haustra::capture::internal {
namespace {

// Of a place in the file, from 1.
std::string LineOf(std::string_view text, std::ptrdiff_t offset) {
  const auto end = text.begin() + std::clamp<std::ptrdiff_t>(offset, 0, std::ssize(text));
  return std::to_string(1 + std::count(text.begin(), end, '\n'));
}

struct Element {
  std::string text;   // directly inside it, comments left out
  std::string type;   // its attribute of this name
  std::string where;  // for messages
};

// The one element of this name, wherever it is; the files that are read hold one camera.
class OneElement final : public pugi::xml_tree_walker {
 public:
  explicit OneElement(std::string_view name) : name_(name) {}
  bool for_each(pugi::xml_node& node) override {
    if (node.type() != pugi::node_element || node.name() != name_) return true;
    if (found_) second_ = node;
    if (!found_) found_ = node;
    return !second_;
  }
  pugi::xml_node found() const { return found_; }
  pugi::xml_node second() const { return second_; }

 private:
  std::string_view name_;
  pugi::xml_node found_, second_;
};

class Rig {
 public:
  Rig(const std::string& path, std::string_view text) : path_(path), text_(text) {}

  // kInvalidArgument: not well formed.
  Status Parse() {
    const pugi::xml_parse_result result =
        document_.load_buffer(text_.data(), text_.size(), pugi::parse_default, pugi::encoding_utf8);
    if (result) return Status::Ok();
    return InvalidArgument(path_ + ":" + LineOf(text_, result.offset) + ": not valid XML: " + result.description());
  }

  Result<Element> One(std::string_view name) {
    OneElement search(name);
    document_.traverse(search);
    if (search.second()) {
      return InvalidArgument(Where(search.second()) + " comes twice; rigs with more than one camera are not supported");
    }
    const pugi::xml_node node = search.found();
    if (!node) return InvalidArgument(path_ + ": no <" + std::string(name) + ">; this is not a Calibu camera rig");
    Element element{"", node.attribute("type").value(), Where(node)};
    for (const pugi::xml_node& child : node.children()) {
      if (child.type() == pugi::node_pcdata) element.text += child.value();
    }
    return element;
  }

 private:
  std::string Where(const pugi::xml_node& node) const {
    return path_ + ":" + LineOf(text_, node.offset_debug()) + ": <" + node.name() + ">";
  }

  const std::string& path_;
  std::string_view text_;
  pugi::xml_document document_;
};

// "[ 717.2; 717.5 ]": numbers between brackets, separated by semicolons, commas or spaces.
Result<std::vector<double>> ParseList(const Element& element) {
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
      return InvalidArgument(element.where + " number " + std::to_string(numbers.size() + 1) + ": " +
                             number.status().message());
    }
    numbers.push_back(*number);
    word.clear();
  }
  return numbers;
}

Result<int> ParseSide(Rig* rig, std::string_view name) {
  HAUSTRA_ASSIGN(const Element element, rig->One(name));
  HAUSTRA_ASSIGN(const std::vector<double> numbers, ParseList(element));
  const bool is_side = numbers.size() == 1 && numbers[0] >= kMinImageSidePx && numbers[0] <= kMaxImageSidePx &&
                       numbers[0] == static_cast<int>(numbers[0]);
  if (is_side) return static_cast<int>(numbers[0]);
  return InvalidArgument(element.where + " is not one number of pixels, " + std::to_string(kMinImageSidePx) + " to " +
                         std::to_string(kMaxImageSidePx));
}

}  // namespace

Result<CameraCalibration> ReadCalibuFormat(const std::string& path, std::string_view text) {
  Rig rig(path, text);
  HAUSTRA_TRY(rig.Parse());
  HAUSTRA_ASSIGN(const Element model, rig.One("camera_model"));
  HAUSTRA_ASSIGN(const Element params, rig.One("params"));
  HAUSTRA_ASSIGN(const std::vector<double> values, ParseList(params));

  CameraCalibration calibration;
  const std::string type = model.type;
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
    return InvalidArgument(model.where + " has type '" + type +
                           "'; supported: calibu_fu_fv_u0_v0 and that with _k1_k2, _k1_k2_k3 or _kb4, "
                           "ocamcalib_cx_cy_a0_a2_a3_a4_e_f_g");
  }
  if (values.size() != num_intrinsics + slots.size()) {
    return InvalidArgument(params.where + " holds " + std::to_string(values.size()) + " numbers; type '" + type +
                           "' has " + std::to_string(num_intrinsics + slots.size()));
  }

  if (num_intrinsics == 4) {
    calibration.fx = values[0];
    calibration.fy = values[1];
  }
  calibration.cx = values[num_intrinsics - 2];
  calibration.cy = values[num_intrinsics - 1];
  for (std::size_t i = 0; i < slots.size(); ++i) calibration.coefficients[slots[i]] = values[num_intrinsics + i];
  HAUSTRA_ASSIGN(calibration.width_px, ParseSide(&rig, "width"));
  HAUSTRA_ASSIGN(calibration.height_px, ParseSide(&rig, "height"));
  HAUSTRA_TRY(
      CheckCalibration(calibration, [&](std::string_view field) { return params.where + ": " + std::string(field); }));
  return calibration;
}

}  // namespace haustra::capture::internal
