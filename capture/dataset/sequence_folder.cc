#include <numeric>
#include <utility>

#include "capture/dataset/folder.h"
#include "capture/dataset/listing_parts.h"
#include "capture/dataset/sequence_listing.h"
#include "capture/file_io.h"
#include "capture/number.h"

namespace haustra {
namespace {

using namespace capture::internal;  // NOLINT(google-build-using-namespace): the parts of this library

// `frames/`, or the folder itself when the images lie there.
std::string ImageFolder(const std::string& folder) {
  const std::string frames = Joined(folder, "frames");
  return IsFolder(frames) ? frames : folder;
}

Result<std::vector<std::string>> ListImages(const std::string& folder) {
  HAUSTRA_ASSIGN(const std::vector<std::string> names, FileNames(folder));
  std::vector<std::string> paths;
  for (const std::string& name : names) {
    if (HasImageExtension(name) && name != "mask.png") paths.push_back(Joined(folder, name));
  }
  return paths;
}

Result<std::vector<std::int64_t>> ReadTimes(const std::string& path) {
  HAUSTRA_ASSIGN(const std::string text, ReadTextFile(path, kMaxTextFileBytes));
  StampList stamps(path);
  for (const TextLine& line : ContentLines(text)) {
    const Result<std::int64_t> stamp = ParseSeconds(line.text);
    if (!stamp.ok()) {
      return InvalidArgument(path + ":" + std::to_string(line.number) + ": " + stamp.status().message() +
                             "; each line holds one time in seconds");
    }
    HAUSTRA_TRY(stamps.Add(line.number, *stamp));
  }
  return std::move(stamps.values());
}

Status AddTimes(SequenceListing* listing) {
  const std::size_t num_images = listing->image_paths.size();
  const std::string path = Joined(listing->folder, "times.txt");
  if (IsFile(path)) {
    HAUSTRA_ASSIGN(listing->timestamps_ns, ReadTimes(path));
    if (listing->timestamps_ns.size() == num_images) return Status::Ok();
    return InvalidArgument(path + ": " + std::to_string(listing->timestamps_ns.size()) + " time stamps for " +
                           std::to_string(num_images) + " images in " + ImageFolder(listing->folder));
  }
  if (listing->calibration.rate_hz <= 0.0) {
    return NotFound(path + ": no such file, and " + listing->calibration_path +
                    " states no frame rate to count the times from");
  }
  std::vector<std::int64_t> numbers(num_images);
  std::iota(numbers.begin(), numbers.end(), std::int64_t{0});
  listing->timestamps_ns = StampsAtRate(numbers, listing->calibration.rate_hz);
  return Status::Ok();
}

}  // namespace

bool LooksLikeSequenceFolder(const std::string& folder) {
  if (IsFolder(Joined(folder, "frames"))) return true;
  const Result<std::vector<std::string>> images = ListImages(folder);
  return images.ok() && !images->empty();
}

Result<SequenceListing> ListSequenceFolder(const std::string& folder, const SequenceOptions& options) {
  SequenceListing listing;
  listing.folder = folder;
  HAUSTRA_ASSIGN(listing.image_paths, ListImages(ImageFolder(folder)));
  if (listing.image_paths.empty()) {
    return InvalidArgument(ImageFolder(folder) + ": the sequence is empty: no .png, .jpg or .jpeg file");
  }
  HAUSTRA_TRY(AddCalibration(options, Joined(folder, "calib.yaml"), "put a calib.yaml there or name a calibration file",
                             &listing));
  AddMask(options, &listing);
  HAUSTRA_TRY(AddTimes(&listing));
  return listing;
}

}  // namespace haustra
