#include "tools/report/motion_table.h"

#include <cstdio>
#include <string>

#include "tools/evaluate/number_text.h"

namespace haustra::report {
namespace {

using evaluate::Fixed;
using evaluate::kNothing;

// Two digits, however small.
std::string ChanceText(double chance) {
  char text[32];
  std::snprintf(text, sizeof(text), "%.1e", chance);
  return text;
}

}  // namespace

evaluate::TextTable MakeMotionTable(const evaluate::RunOutput& run) {
  evaluate::TextTable table;
  table.header = {"motion", "map", "period s", "amplitude, % of depth", "from s", "to s", "chance"};
  table.num_left = 1;
  for (const evaluate::MapMotionRow& of : run.figures.motions) {
    const std::string map = std::to_string(of.map_id);
    for (const evaluate::PeriodicStretchRow& found : of.found) {
      table.rows.push_back({"to and fro", map, Fixed(found.period_s, 2), Fixed(found.amplitude_percent, 1),
                            Fixed(found.from_s, 1), Fixed(found.to_s, 1), ChanceText(found.chance)});
    }
    if (!of.found.empty()) continue;
    const std::string why = of.longest_period_s > 0.0
                                ? "none found, up to a period of " + Fixed(of.longest_period_s, 1) + " s"
                                : std::string("the path is too short to tell");
    table.rows.push_back({why, map, kNothing, kNothing, kNothing, kNothing, kNothing});
  }
  return table;
}

}  // namespace haustra::report
