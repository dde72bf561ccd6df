// What `haustra evaluate` says of the result of a fixture, against the renderer's ground truth. reentrant.
#pragma once

#include <nlohmann/json.hpp>
#include <string>

namespace haustra::end_to_end {

// A failure of the command fails the test.
nlohmann::json Evaluate(const std::string& sequence);

struct Floors {
  std::string sequence;
  double coverage = 0.0;          // percent, at least
  double visible_coverage = 0.0;  // percent, at least
  double rms_ate_mm = 0.0;        // at most
  int maps = 0;                   // at most
};
// No false join either.
void ExpectAtLeast(const Floors& floors);

}  // namespace haustra::end_to_end
