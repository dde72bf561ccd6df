#include <cmath>
#include <vector>

#include "hal/core/check.h"
#include "tests/fuzz/fuzz_entries.h"
#include "tests/fuzz/memory_file.h"
#include "tools/run/mark_file.h"
#include "tools/surface/coverage_truth.h"

namespace haustra::test {

void FuzzTable(std::span<const std::uint8_t> bytes) {
  const MemoryFile file(bytes);
  const Result<std::vector<MarkRequest>> marks = ReadMarkFile(file.path());
  if (!marks.ok()) {
    HAUSTRA_CHECK(!marks.status().message().empty());
  } else {
    for (std::size_t i = 0; i < marks->size(); ++i) {
      HAUSTRA_CHECK((*marks)[i].pixel.allFinite());
      HAUSTRA_CHECK(i == 0 || (*marks)[i].frame_index >= (*marks)[i - 1].frame_index);
    }
  }
  const Result<surface::TrueWall> wall = surface::ReadTrueWall(file.path());
  if (!wall.ok()) {
    HAUSTRA_CHECK(!wall.status().message().empty());
  } else {
    HAUSTRA_CHECK(wall->columns > 0 && wall->num_rows() > 0);
    HAUSTRA_CHECK(wall->cells.size() == std::size_t(wall->columns) * static_cast<std::size_t>(wall->num_rows()));
    for (const surface::TrueWall::Cell& cell : wall->cells) HAUSTRA_CHECK(cell.position.allFinite());
  }
}

}  // namespace haustra::test
