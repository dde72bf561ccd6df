#include <utility>

#include "capture/dataset/folder.h"
#include "capture/dataset/listing_parts.h"
#include "capture/dataset/sequence_listing.h"
#include "capture/number.h"

namespace haustra {
namespace {

using namespace capture::internal;  // NOLINT(google-build-using-namespace): the parts of this library

constexpr std::string_view kSuffix = "_color.png";

// N of `N_color.png`; negative for other names.
std::int64_t FrameNumber(std::string_view name) {
  if (!name.ends_with(kSuffix)) return -1;
  const std::string_view digits = name.substr(0, name.size() - kSuffix.size());
  const Result<std::int64_t> number = ParseInteger(digits);
  // Bounded so that the time stamp fits.
  constexpr std::int64_t kMaxFrameNumber = 1'000'000'000;
  return number.ok() && digits.front() != '+' && *number <= kMaxFrameNumber ? *number : -1;
}

}  // namespace

bool LooksLikeC3vd(const std::string& folder) {
  const Result<std::vector<std::string>> names = FileNames(folder);
  if (!names.ok()) return false;
  for (const std::string& name : *names) {
    if (FrameNumber(name) >= 0) return true;
  }
  return false;
}

Result<SequenceListing> ListC3vd(const std::string& folder, const SequenceOptions& options) {
  HAUSTRA_TRY(options.RefuseFrameRate(folder));
  SequenceListing listing;
  listing.folder = folder;
  HAUSTRA_ASSIGN(const std::vector<std::string> names, FileNames(folder));
  std::vector<std::int64_t> numbers;
  for (const std::string& name : names) {  // in natural order, so by number
    const std::int64_t number = FrameNumber(name);
    if (number < 0) continue;
    if (!numbers.empty() && number == numbers.back()) {
      return InvalidArgument(Joined(folder, name) + ": frame " + std::to_string(number) + " is there twice, also as " +
                             FileName(listing.image_paths.back()));
    }
    numbers.push_back(number);
    listing.image_paths.push_back(Joined(folder, name));
  }
  if (numbers.empty()) return InvalidArgument(folder + ": the sequence is empty: no file named N_color.png");
  HAUSTRA_TRY(AddCalibration(options, Joined(folder, "calib.yaml"),
                             "C3VD sequences carry none; name one of config/cameras/c3vd_v1_*.yaml or c3vd_v2_*.yaml",
                             &listing));
  AddMask(options, &listing);
  listing.timestamps_ns = StampsAtRate(numbers, kC3vdRateHz);
  if (listing.calibration.rate_hz == 0.0) listing.calibration.rate_hz = kC3vdRateHz;
  return listing;
}

}  // namespace haustra
