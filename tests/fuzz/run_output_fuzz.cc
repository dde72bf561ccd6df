#include <nlohmann/json.hpp>

#include "hal/core/check.h"
#include "tests/fuzz/fuzz_entries.h"
#include "tests/fuzz/memory_file.h"
#include "tools/evaluate/evaluate_run.h"
#include "tools/evaluate/report_json.h"

namespace haustra::test {

void FuzzRunOutput(std::span<const std::uint8_t> bytes) {
  const MemoryFolder folder(bytes, {"frames.csv", "maps.csv", "events.csv", "summary.json", "trajectory/map_0000.tum",
                                    "times.csv", "marks.csv"});
  const Result<evaluate::RunOutput> run = evaluate::ReadRunOutput(folder.path());
  if (!run.ok()) {
    HAUSTRA_CHECK(!run.status().message().empty());
    return;
  }
  HAUSTRA_CHECK(!run->frames.empty() && run->figures.part.Validate().ok());
  for (std::size_t i = 0; i < run->frames.size(); ++i) {
    const evaluate::RunFrame& frame = run->frames[i];
    HAUSTRA_CHECK(frame.frame_idx > (i == 0 ? -1 : run->frames[i - 1].frame_idx));
    HAUSTRA_CHECK(frame.map_id >= -1 && frame.live_map_id >= -1);
    HAUSTRA_CHECK(frame.world_from_cam.translation.allFinite());
  }
  for (const evaluate::RunMarkSighting& sighting : run->marks.sightings) {
    HAUSTRA_CHECK(sighting.mark < run->marks.set.size());
  }
  // The frames of a sequence of hours, each of them missing, are work and no fault.
  constexpr std::int64_t kManyFrames = 10'000;
  if (run->frames.back().frame_idx > kManyFrames || run->figures.sequence_frames.value_or(0) > kManyFrames) return;
  const std::string json = evaluate::ToJson(evaluate::EvaluateRun(*run, {}, {}));
  HAUSTRA_CHECK(nlohmann::json::accept(json));
}

}  // namespace haustra::test
