#include "capture/calibration_reader.h"
#include "hal/core/check.h"
#include "tests/fuzz/fuzz_entries.h"
#include "tests/fuzz/memory_file.h"

namespace haustra::test {

void FuzzCalibration(std::span<const std::uint8_t> bytes) {
  const MemoryFile file(bytes);
  const Result<CameraCalibration> read = ReadCalibration(file.path());
  if (!read.ok()) {
    HAUSTRA_CHECK(!read.status().message().empty());
    return;
  }
  HAUSTRA_CHECK(read->width_px > 0 && read->height_px > 0);
  // What was taken can be written, and is the same then.
  const MemoryFile copy(CalibrationText(*read));
  const Result<CameraCalibration> again = ReadCalibration(copy.path());
  HAUSTRA_CHECK(again.ok());
  HAUSTRA_CHECK(again->kind == read->kind && again->width_px == read->width_px && again->height_px == read->height_px);
  HAUSTRA_CHECK(again->cx == read->cx && again->cy == read->cy && again->coefficients == read->coefficients);
}

}  // namespace haustra::test
