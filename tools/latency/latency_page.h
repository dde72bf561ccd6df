// A measurement on one page, and as text for the console. reentrant, deterministic.
#pragma once

#include <string>
#include <utility>
#include <vector>

#include "tools/latency/board_state.h"
#include "tools/latency/latency_record.h"
#include "tools/latency/requirement.h"

namespace haustra {

struct LatencyReport {
  std::string title;                                          // what was measured
  std::vector<std::pair<std::string, std::string>> settings;  // device, load, length
  double deadline_ms = 0;
  BoardState board_before;
  BoardState board_after;
  const LatencyRecord* record = nullptr;
  std::vector<RequirementLine> verdict;  // empty: nothing was required
  // Something was measured, and all lines are met.
  bool is_met() const;
};

std::string ToText(const LatencyReport& report);
std::string ToJson(const LatencyReport& report);
// One HTML file that needs nothing else.
std::string MakeLatencyPage(const LatencyReport& report);

}  // namespace haustra
