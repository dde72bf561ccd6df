#include <utility>

#include "capture/dataset/folder.h"
#include "capture/dataset/listing_parts.h"
#include "capture/dataset/sequence_listing.h"
#include "capture/files/whole_file.h"
#include "capture/number.h"

namespace haustra {
namespace {

using namespace capture::internal;  // NOLINT(google-build-using-namespace): the parts of this library

// The folder of the camera, whether `folder` holds mav0 or is it.
std::string CameraFolder(const std::string& folder) {
  const std::string inside = Joined(folder, "mav0/cam0");
  return IsFolder(inside) ? inside : Joined(folder, "cam0");
}

Status ReadImageList(const std::string& camera_folder, SequenceListing* listing) {
  const std::string path = Joined(camera_folder, "data.csv");
  HAUSTRA_ASSIGN(const std::string text, ReadWholeText(path, kMaxTextFileBytes));
  StampList stamps(path);
  for (const TextLine& line : ContentLines(text)) {
    const std::string here = path + ":" + std::to_string(line.number) + ": ";
    const std::vector<std::string_view> fields = SplitFields(line.text, ',');
    if (fields.size() != 2 || fields[1].empty()) {
      return InvalidArgument(here + "not a time in nanoseconds and a file name with a comma between");
    }
    const Result<std::int64_t> stamp = ParseInteger(fields[0]);
    if (!stamp.ok()) return InvalidArgument(here + stamp.status().message());
    HAUSTRA_TRY(stamps.Add(line.number, *stamp));
    listing->image_paths.push_back(Joined(Joined(camera_folder, "data"), fields[1]));
  }
  if (listing->image_paths.empty()) return InvalidArgument(path + ": the sequence is empty: no image is listed");
  listing->timestamps_ns = std::move(stamps.values());
  return Status::Ok();
}

}  // namespace

bool LooksLikeEuroc(const std::string& folder) { return IsFile(Joined(CameraFolder(folder), "data.csv")); }

Result<SequenceListing> ListEuroc(const std::string& folder, const SequenceOptions& options) {
  HAUSTRA_TRY(options.RefuseFrameRate(folder));
  const std::string camera_folder = CameraFolder(folder);
  SequenceListing listing;
  listing.folder = folder;
  HAUSTRA_TRY(ReadImageList(camera_folder, &listing));
  HAUSTRA_TRY(AddCalibration(options, Joined(camera_folder, "sensor.yaml"),
                             "cam0/sensor.yaml is missing; name a calibration file", &listing));
  AddMask(options, &listing);
  return listing;
}

}  // namespace haustra
