#include <map>
#include <numeric>
#include <utility>

#include "capture/dataset/folder.h"
#include "capture/dataset/listing_parts.h"
#include "capture/dataset/sequence_listing.h"
#include "capture/files/whole_file.h"
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
  HAUSTRA_ASSIGN(const std::string text, ReadWholeText(path, kMaxTextFileBytes));
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

// The images whose times were stored, and these times from the first one on.
Status KeepRecorded(SequenceListing* listing) {
  const std::string path = Joined(listing->folder, kRecordedTimesName);
  HAUSTRA_ASSIGN(std::string text, ReadWholeText(path, kMaxTextFileBytes));
  text.erase(text.rfind('\n') + 1);  // the line that was being written
  std::map<std::string, std::int64_t> times;
  for (const TextLine& line : ContentLines(text)) {
    const std::vector<std::string_view> fields = SplitFields(line.text, ' ');
    const Result<std::int64_t> stamp = ParseSeconds(fields.back());
    if (fields.size() != 2 || !stamp.ok()) {
      return InvalidArgument(path + ":" + std::to_string(line.number) + ": not a file name and a time in seconds");
    }
    times[std::string(fields.front())] = *stamp;
  }
  std::erase_if(listing->image_paths, [&](const std::string& image) { return !times.contains(FileName(image)); });
  if (listing->image_paths.empty()) return InvalidArgument(path + ": the recording was cut before its first frame");
  const std::int64_t first = times[FileName(listing->image_paths.front())];
  for (const std::string& image : listing->image_paths) {
    const std::int64_t stamp = times[FileName(image)] - first;
    if (!listing->timestamps_ns.empty() && stamp <= listing->timestamps_ns.back()) {
      return InvalidArgument(path + ": the time of " + FileName(image) + " is not after that of the image before it");
    }
    listing->timestamps_ns.push_back(stamp);
  }
  return Status::Ok();
}

Status AddTimes(const SequenceOptions& options, SequenceListing* listing) {
  const std::size_t num_images = listing->image_paths.size();
  if (IsCutRecording(listing->folder)) {
    HAUSTRA_TRY(options.RefuseFrameRate(Joined(listing->folder, kRecordedTimesName)));
    return KeepRecorded(listing);
  }
  const std::string path = Joined(listing->folder, "times.txt");
  if (IsFile(path)) {
    HAUSTRA_TRY(options.RefuseFrameRate(path));
    HAUSTRA_ASSIGN(listing->timestamps_ns, ReadTimes(path));
    if (listing->timestamps_ns.size() == num_images) return Status::Ok();
    return InvalidArgument(path + ": " + std::to_string(listing->timestamps_ns.size()) + " time stamps for " +
                           std::to_string(num_images) + " images in " + ImageFolder(listing->folder));
  }
  if (options.frame_rate_hz > 0.0) listing->calibration.rate_hz = options.frame_rate_hz;
  if (listing->calibration.rate_hz <= 0.0) {
    const bool is_calibrated = !options.calibration || options.calibration->width_px > 0;
    return NotFound(path + ": no such file, and " +
                    (is_calibrated ? "the calibration states no frame rate to count the times from"
                                   : "no calibration that could state a frame rate") +
                    "; give --frame-rate HZ" + (is_calibrated ? "" : ", or a calibration with a rate"));
  }
  std::vector<std::int64_t> numbers(num_images);
  std::iota(numbers.begin(), numbers.end(), std::int64_t{0});
  listing->timestamps_ns = StampsAtRate(numbers, listing->calibration.rate_hz);
  return Status::Ok();
}

}  // namespace

bool IsCutRecording(const std::string& folder) { return IsFile(Joined(folder, kRecordedTimesName)); }

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
  HAUSTRA_TRY(AddTimes(options, &listing));
  return listing;
}

}  // namespace haustra
