// How often a breath is found in the path of a wandering scope, and how often one that is not there.
#include <algorithm>
#include <cmath>
#include <cstdint>
#include <cstdio>

#include "tests/tools/run/wandering_scope.h"

namespace haustra::test {
namespace {

constexpr int kPaths = 1000;

void Measure(double duration_s, double speed, double amplitude) {
  int num_found = 0, num_true = 0;
  double sum = 0.0;
  for (std::uint64_t seed = 1; seed <= kPaths; ++seed) {
    const PeriodicMotion motion = FindPeriodicMotion(Wander(seed, duration_s, speed, {amplitude}));
    num_found += motion.stretches.empty() ? 0 : 1;
    const auto surest = std::min_element(motion.stretches.begin(), motion.stretches.end(),
                                         [](const auto& a, const auto& b) { return a.chance < b.chance; });
    if (surest == motion.stretches.end() || std::abs(surest->period_s - kBreathS) > 0.1 * kBreathS) continue;
    ++num_true;
    sum += surest->amplitude;
  }
  std::printf("%8.0f %8.2f %8.0f %8.1f %12.1f %12.1f\n", duration_s, speed, 100.0 * amplitude,
              100.0 * num_found / kPaths, 100.0 * num_true / kPaths, num_true > 0 ? 100.0 * sum / num_true : 0.0);
}

}  // namespace
}  // namespace haustra::test

int main() {
  std::printf("%8s %8s %8s %8s %12s %12s\n", "path s", "speed", "breath %", "found %", "at 3.7 s, %", "amplitude %");
  for (const double speed : {0.05, 0.1, 0.4}) {
    for (const double duration_s : {30.0, 60.0, 180.0}) haustra::test::Measure(duration_s, speed, 0.0);
  }
  for (const double amplitude : {0.02, 0.04, 0.06, 0.08}) {
    for (const double duration_s : {20.0, 30.0, 60.0}) haustra::test::Measure(duration_s, 0.05, amplitude);
  }
  return 0;
}
