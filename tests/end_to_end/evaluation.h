// What `haustra evaluate` says of a result, against the renderer's ground truth. reentrant.
#pragma once

#include <nlohmann/json.hpp>
#include <string>

namespace haustra::end_to_end {

// Of a fixture (the scratch folder is emptied), or of another run of its sequence, where the evaluation stays. A
// failure of the command fails the test.
nlohmann::json Evaluate(const std::string& sequence);
nlohmann::json Evaluate(const std::string& sequence, const std::string& result_folder);

struct Floors {
  std::string sequence;
  double coverage = 0.0;               // percent, at least
  double visible_coverage = 0.0;       // percent, at least
  double live_visible_coverage = 0.0;  // percent, at least
  double rms_ate_mm = 0.0;             // at most
  int maps = 0;                        // at most
  int joins = 0;                       // judged true, at least
};
// Of `losses` on any device. Five seeds on one processor had 82.0 to 83.0 % (all that can be seen; 98.3 % of it live),
// 0.15 to 0.36 mm, one map after three relocalisations.
inline Floors LossesFloors() {
  return {.sequence = "losses",
          .coverage = 80,
          .visible_coverage = 98,
          .live_visible_coverage = 96,
          .rms_ate_mm = 0.47,
          .maps = 1,
          .joins = 3};
}

// No false join either, of maps or of a frame with a map. Without a folder: of the fixture.
void ExpectAtLeast(const Floors& floors, const std::string& result_folder = "");
// The part of it that looks at the evaluation's joins. One that nobody judged does not count.
void ExpectJoins(const nlohmann::json& joins, int at_least);

}  // namespace haustra::end_to_end
