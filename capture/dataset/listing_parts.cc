#include "capture/dataset/listing_parts.h"

#include <cmath>

#include "capture/calibration_reader.h"
#include "capture/dataset/folder.h"

namespace haustra::capture::internal {

Status AddCalibration(const SequenceOptions& options, const std::string& own_path, const std::string& advice,
                      SequenceListing* listing) {
  if (options.calibration) {
    listing->calibration = *options.calibration;
    listing->calibration_path = "of the caller";
    return Status::Ok();
  }
  listing->calibration_path = options.calibration_path.empty() ? own_path : options.calibration_path;
  if (options.calibration_path.empty() && (own_path.empty() || !IsFile(own_path))) {
    return NotFound(listing->folder + ": no camera calibration: " + advice);
  }
  HAUSTRA_ASSIGN(listing->calibration, ReadCalibration(listing->calibration_path));
  return Status::Ok();
}

void AddMask(const SequenceOptions& options, SequenceListing* listing) {
  const std::string own_path = Joined(listing->folder, "mask.png");
  listing->mask_path = options.mask_path;
  if (listing->mask_path.empty() && IsFile(own_path)) listing->mask_path = own_path;
}

std::vector<std::int64_t> StampsAtRate(const std::vector<std::int64_t>& numbers, double rate_hz) {
  std::vector<std::int64_t> stamps;
  stamps.reserve(numbers.size());
  for (const std::int64_t number : numbers) {
    stamps.push_back(static_cast<std::int64_t>(std::llround(static_cast<double>(number) * 1e9 / rate_hz)));
  }
  return stamps;
}

}  // namespace haustra::capture::internal
