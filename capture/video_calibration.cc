#include "capture/video_calibration.h"

#include <filesystem>
#include <system_error>
#include <utility>
#include <vector>

#include "capture/calibration/yaml_map.h"
#include "capture/calibration_reader.h"
#include "capture/concat.h"
#include "capture/dataset/folder.h"
#include "capture/files/whole_file.h"
#include "capture/number.h"

namespace haustra::capture::internal {
namespace {

constexpr std::string_view kGeometrical = "_geometrical.xml";
constexpr std::size_t kMaxInfoBytes = std::size_t{16} << 20;

// EndoMapper keeps recordings in Sequences/Seq_NNN and calibrations in Calibrations/Endoscope_NN; Seq_NNN_info.json
// beside the recording says which endoscope it was. Empty when there is no such file.
Result<std::string> FindByEndoscopeNumber(const std::string& folder, const std::string& stem) {
  const std::string info_path = Joined(folder, stem + "_info.json");
  if (!IsFile(info_path)) return std::string();
  HAUSTRA_ASSIGN(std::string text, ReadWholeText(info_path, kMaxInfoBytes));
  HAUSTRA_ASSIGN(const YamlMap info, YamlMap::Parse(info_path, std::move(text)));  // JSON is YAML, too
  HAUSTRA_ASSIGN(const std::string value, info.Text("endoscope_number"));
  const Result<std::int64_t> number = ParseInteger(value);
  if (!number.ok() || *number < 0) {
    return InvalidArgument(info.Where("endoscope_number") + " is '" + value +
                           "': the endoscope was not recorded; name a calibration file");
  }
  const std::string endoscope = Concat("Endoscope_", *number < 10 ? "0" : "", std::to_string(*number));
  std::error_code error;
  const std::filesystem::path absolute = std::filesystem::absolute(info_path, error);
  if (error) return Unavailable(info_path + ": " + error.message());
  const std::filesystem::path sequence = absolute.lexically_normal().parent_path();
  const std::filesystem::path data_set = sequence.parent_path().parent_path();
  const std::string path = (data_set / "Calibrations" / endoscope / (endoscope + std::string(kGeometrical))).string();
  if (!IsFile(path))
    return NotFound(Concat(path, ": no such file; ", info_path, " says that it belongs to the recording"));
  return path;
}

// The calibration file that belongs to the video; empty when there is none.
Result<std::string> FindCalibration(const std::string& folder, const std::string& stem) {
  const std::string own = Joined(folder, stem + std::string(kGeometrical));
  if (IsFile(own)) return own;
  HAUSTRA_ASSIGN(const std::vector<std::string> names, FileNames(folder));
  std::string geometrical;
  for (const std::string& name : names) {
    if (!name.ends_with(kGeometrical)) continue;
    if (!geometrical.empty()) {
      return InvalidArgument(
          Concat(folder, ": more than one calibration (", FileName(geometrical), ", ", name, "); name the one to use"));
    }
    geometrical = Joined(folder, name);
  }
  if (!geometrical.empty()) return geometrical;
  for (const std::string& name : {stem + ".yaml", std::string("calib.yaml")}) {
    if (IsFile(Joined(folder, name))) return Joined(folder, name);
  }
  return FindByEndoscopeNumber(folder, stem);
}

}  // namespace

Result<VideoCompanions> FindVideoCompanions(const std::string& video_path, const SequenceOptions& options) {
  const std::filesystem::path path(video_path);
  const std::string folder = path.has_parent_path() ? path.parent_path().string() : ".";
  VideoCompanions companions;
  if (options.calibration) {
    companions.calibration = *options.calibration;
    companions.calibration_path = "of the caller";
  } else {
    companions.calibration_path = options.calibration_path;
    if (companions.calibration_path.empty()) {
      HAUSTRA_ASSIGN(companions.calibration_path, FindCalibration(folder, path.stem().string()));
    }
    if (companions.calibration_path.empty()) {
      return NotFound(video_path + ": no camera calibration: put calib.yaml or " + path.stem().string() +
                      "_geometrical.xml beside it, or name a calibration file");
    }
    HAUSTRA_ASSIGN(companions.calibration, ReadCalibration(companions.calibration_path));
  }
  companions.mask_path = options.mask_path;
  const std::string own_mask = Joined(folder, "mask.png");
  if (companions.mask_path.empty() && IsFile(own_mask)) companions.mask_path = own_mask;
  return companions;
}

}  // namespace haustra::capture::internal
