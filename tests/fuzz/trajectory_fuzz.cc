#include <cmath>

#include "capture/ground_truth.h"
#include "hal/core/check.h"
#include "tests/fuzz/fuzz_entries.h"
#include "tests/fuzz/memory_file.h"

namespace haustra::test {

void FuzzTrajectory(std::span<const std::uint8_t> bytes) {
  const MemoryFile file(bytes);
  const Result<std::vector<GroundTruthPose>> poses = ReadGroundTruth(file.path());
  if (!poses.ok()) {
    HAUSTRA_CHECK(!poses.status().message().empty());
    return;
  }
  HAUSTRA_CHECK(!poses->empty());
  for (std::size_t i = 0; i < poses->size(); ++i) {
    const GroundTruthPose& pose = (*poses)[i];
    HAUSTRA_CHECK(i == 0 || pose.timestamp_ns > (*poses)[i - 1].timestamp_ns);
    double norm = 0.0;
    for (const double q : pose.world_from_cam_xyzw) norm += q * q;
    HAUSTRA_CHECK(std::abs(norm - 1.0) < 1e-6);
    for (const double p : pose.position_in_world) HAUSTRA_CHECK(std::isfinite(p));
  }
}

}  // namespace haustra::test
