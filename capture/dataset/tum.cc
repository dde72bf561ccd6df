#include <utility>

#include "capture/dataset/folder.h"
#include "capture/dataset/listing_parts.h"
#include "capture/dataset/sequence_listing.h"
#include "capture/files/whole_file.h"
#include "capture/number.h"

namespace haustra {
namespace {

using namespace capture::internal;  // NOLINT(google-build-using-namespace): the parts of this library

Status ReadImageList(SequenceListing* listing) {
  const std::string path = Joined(listing->folder, "rgb.txt");
  HAUSTRA_ASSIGN(const std::string text, ReadWholeText(path, kMaxTextFileBytes));
  StampList stamps(path);
  for (const TextLine& line : ContentLines(text)) {
    const std::string here = path + ":" + std::to_string(line.number) + ": ";
    const std::vector<std::string_view> fields = SplitFields(line.text, ' ');
    if (fields.size() != 2) return InvalidArgument(here + "not a time in seconds and a file name");
    const Result<std::int64_t> stamp = ParseSeconds(fields[0]);
    if (!stamp.ok()) return InvalidArgument(here + stamp.status().message());
    HAUSTRA_TRY(stamps.Add(line.number, *stamp));
    listing->image_paths.push_back(Joined(listing->folder, fields[1]));
  }
  if (listing->image_paths.empty()) return InvalidArgument(path + ": the sequence is empty: no image is listed");
  listing->timestamps_ns = std::move(stamps.values());
  return Status::Ok();
}

}  // namespace

bool LooksLikeTum(const std::string& folder) { return IsFile(Joined(folder, "rgb.txt")); }

Result<SequenceListing> ListTum(const std::string& folder, const SequenceOptions& options) {
  HAUSTRA_TRY(options.RefuseFrameRate(folder));
  SequenceListing listing;
  listing.folder = folder;
  HAUSTRA_TRY(ReadImageList(&listing));
  HAUSTRA_TRY(AddCalibration(options, Joined(folder, "calib.yaml"),
                             "TUM sequences carry none; put a calib.yaml there or name a calibration file", &listing));
  AddMask(options, &listing);
  return listing;
}

}  // namespace haustra
