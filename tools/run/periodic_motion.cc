#include "tools/run/periodic_motion.h"

#include <Eigen/Cholesky>
#include <algorithm>
#include <cmath>
#include <complex>
#include <cstddef>
#include <numbers>
#include <optional>
#include <span>

#include "hal/core/median.h"

namespace haustra {
namespace {

constexpr double kBinS = 0.2;     // velocities are averaged over so long: tracking noise is of frames, breaths are not
constexpr double kMaxGapS = 0.5;  // between samples, over which a velocity is known
constexpr double kWindowPeriods = 1.5;
constexpr int kMinWindows = 5;           // half overlapping: four and a half periods
constexpr double kMinShareKnown = 0.75;  // of a window
// A breath keeps its pace for so long. A longer path is searched in stretches that overlap by half.
constexpr double kStretchS = 60.0;
constexpr double kFrequencyStep = 0.25;  // of the resolution, which is one over the stretch
// Windows that overlap, and are clipped, tell less than as many that are apart: by so much. On random walks of the
// velocity one path in a hundred then passes kMaxChance (tools/run/decisions).
constexpr double kFreedomAWindow = 0.55;
constexpr double kSamePeriod = 0.1;  // of neighbouring stretches: relative difference

// Velocity along the optical axis over the depth, 1/s, in bins of kBinS.
struct Velocities {
  double begin_s = 0.0;
  std::vector<double> value;
  std::vector<double> known_s;  // of the bin; less than half of it: no velocity

  bool IsKnown(std::size_t i) const { return known_s[i] >= 0.5 * kBinS; }
  double TimeOf(std::size_t i) const { return begin_s + (static_cast<double>(i) + 0.5) * kBinS; }
  double duration_s() const { return static_cast<double>(value.size()) * kBinS; }
};

Velocities VelocitiesOf(std::span<const MotionSample> samples) {
  Velocities velocities;
  velocities.begin_s = samples.front().time_s;
  const auto num_bins =
      static_cast<std::size_t>(std::floor((samples.back().time_s - velocities.begin_s) / kBinS + 1e-9));
  std::vector<double> way(num_bins, 0.0);
  velocities.known_s.assign(num_bins, 0.0);
  for (std::size_t i = 1; i < samples.size(); ++i) {
    const MotionSample &a = samples[i - 1], &b = samples[i];
    const double duration_s = b.time_s - a.time_s;
    if (!(duration_s > 0.0) || duration_s > kMaxGapS) continue;
    const double velocity =
        (b.centre_mu - a.centre_mu).dot(0.5 * (a.axis + b.axis)) / (0.5 * (a.depth_mu + b.depth_mu) * duration_s);
    auto bin = static_cast<std::size_t>((a.time_s - velocities.begin_s) / kBinS);
    for (double from_s = a.time_s; bin < num_bins && from_s < b.time_s; ++bin) {
      const double to_s = std::min(b.time_s, velocities.begin_s + static_cast<double>(bin + 1) * kBinS);
      if (to_s <= from_s) continue;
      way[bin] += velocity * (to_s - from_s);
      velocities.known_s[bin] += to_s - from_s;
      from_s = to_s;
    }
  }
  velocities.value.assign(num_bins, 0.0);
  for (std::size_t i = 0; i < num_bins; ++i) {
    if (velocities.IsKnown(i)) velocities.value[i] = way[i] / velocities.known_s[i];
  }
  return velocities;
}

// The sinusoid of a window, as the velocity has it, against one phase of the whole path; nothing: too little is known.
std::optional<std::complex<double>> SinusoidOf(const Velocities& velocities, double begin_s, double length_s,
                                               double frequency_hz) {
  const double first = std::ceil((begin_s - velocities.begin_s) / kBinS - 0.5 - 1e-9);
  const double end = std::ceil((begin_s + length_s - velocities.begin_s) / kBinS - 0.5 - 1e-9);
  const auto size = static_cast<double>(velocities.value.size());
  Eigen::Matrix4d normal = Eigen::Matrix4d::Zero();
  Eigen::Vector4d right = Eigen::Vector4d::Zero();
  int num_known = 0;
  for (auto i = static_cast<std::size_t>(std::max(0.0, first)); i < static_cast<std::size_t>(std::min(end, size));
       ++i) {
    if (!velocities.IsKnown(i)) continue;
    ++num_known;
    const double time_s = velocities.TimeOf(i), place = (time_s - begin_s) / length_s;
    const double taper = std::sin(std::numbers::pi * std::clamp(place, 0.0, 1.0));  // squared: Hann
    const double phase = 2.0 * std::numbers::pi * frequency_hz * (time_s - velocities.begin_s);
    const Eigen::Vector4d row(1.0, place - 0.5, std::cos(phase), std::sin(phase));
    normal += taper * taper * row * row.transpose();
    right += taper * taper * velocities.value[i] * row;
  }
  if (num_known < kMinShareKnown * (end - first)) return std::nullopt;
  const Eigen::Vector4d fit = normal.ldlt().solve(right);
  if (!fit.allFinite()) return std::nullopt;
  return std::complex<double>(fit[2], -fit[3]);
}

// How far the wall goes to and fro, over the depth, and the chance of one test at one frequency.
struct Line {
  double frequency_hz = 0.0, amplitude = 0.0, chance = 1.0;
};

std::optional<Line> LineAt(const Velocities& velocities, double begin_s, double end_s, double frequency_hz) {
  const double length_s = kWindowPeriods / frequency_hz, hop_s = 0.5 * length_s;
  const int num_windows = static_cast<int>(std::floor((end_s - begin_s - length_s) / hop_s + 1e-9)) + 1;
  const double margin_s = 0.5 * (end_s - begin_s - length_s - (num_windows - 1) * hop_s);
  std::vector<std::complex<double>> windows;
  std::vector<double> sizes;
  for (int i = 0; i < num_windows; ++i) {
    const auto window = SinusoidOf(velocities, begin_s + margin_s + i * hop_s, length_s, frequency_hz);
    if (!window) continue;
    windows.push_back(*window);
    sizes.push_back(std::abs(*window));
  }
  if (static_cast<int>(windows.size()) < kMinWindows) return std::nullopt;
  // A turn of the scope is much larger than a breath: no window counts for more than the one in the middle.
  std::vector<double> by_size = sizes;
  const double most = MeanMedian(std::span<double>(by_size));
  std::complex<double> sum = 0.0;
  double squares = 0.0;
  for (std::size_t i = 0; i < windows.size(); ++i) {
    const std::complex<double> clipped = sizes[i] > most ? windows[i] * (most / sizes[i]) : windows[i];
    sum += clipped;
    squares += std::norm(clipped);
  }
  if (!(std::abs(sum) > 0.0)) return std::nullopt;
  const auto count = static_cast<double>(windows.size());
  const double coherence = std::min(1.0, std::norm(sum) / (count * squares));
  std::vector<double> in_phase;
  for (const std::complex<double>& window : windows)
    in_phase.push_back(std::real(window * std::conj(sum)) / std::abs(sum));
  // What the average over a bin takes from a sinusoid is given back.
  const double half_turn = std::numbers::pi * frequency_hz * kBinS;
  const double velocity = MeanMedian(std::span<double>(in_phase)) * half_turn / std::sin(half_turn);
  return Line{frequency_hz, velocity / (2.0 * std::numbers::pi * frequency_hz),
              std::pow(1.0 - coherence, kFreedomAWindow * (count - 1.0))};
}

// The surest line of a stretch, and how many tests that do not depend on each other were made for it.
struct Search {
  double num_tests = 0.0;
  double longest_period_s = 0.0;
  std::optional<Line> surest;
};

Search SearchStretch(const Velocities& velocities, double begin_s, double end_s) {
  Search search;
  const double step_hz = kFrequencyStep / (end_s - begin_s);
  for (double frequency_hz = 1.0 / kLongestPeriodS; frequency_hz <= 1.0 / kShortestPeriodS; frequency_hz += step_hz) {
    const auto line = LineAt(velocities, begin_s, end_s, frequency_hz);
    if (!line) continue;
    search.num_tests += kFrequencyStep;
    search.longest_period_s = std::max(search.longest_period_s, 1.0 / frequency_hz);
    if (line->amplitude < kMinPeriodicAmplitude) continue;
    if (!search.surest || line->chance < search.surest->chance) search.surest = line;
  }
  return search;
}

struct SearchedStretch {
  double from_s = 0.0, to_s = 0.0;
  Search search;
};

// Of a part of the path that has no long gap.
void SearchPart(const Velocities& velocities, std::vector<SearchedStretch>* out) {
  if (velocities.value.empty()) return;
  const double longest_s = std::min(kStretchS, velocities.duration_s());
  const double rest_s = velocities.duration_s() - longest_s;
  const int num_hops = static_cast<int>(std::ceil(rest_s / (0.5 * kStretchS) - 1e-9));
  for (int i = 0; i <= num_hops; ++i) {
    const double from_s = velocities.begin_s + (num_hops > 0 ? rest_s * i / num_hops : 0.0);
    out->push_back({from_s, from_s + longest_s, SearchStretch(velocities, from_s, from_s + longest_s)});
  }
}

bool AreOne(const PeriodicStretch& a, const PeriodicStretch& b) {
  return b.from_s <= a.to_s && std::abs(a.period_s - b.period_s) <= kSamePeriod * a.period_s;
}

}  // namespace

PeriodicMotion FindPeriodicMotion(std::span<const MotionSample> samples) {
  std::vector<SearchedStretch> searched;
  for (std::size_t begin = 0; begin < samples.size();) {
    std::size_t end = begin + 1;
    while (end < samples.size() && samples[end].time_s - samples[end - 1].time_s <= kLongestPeriodS) ++end;
    SearchPart(VelocitiesOf(samples.subspan(begin, end - begin)), &searched);
    begin = end;
  }
  PeriodicMotion motion;
  double num_tests = 0.0;
  for (const SearchedStretch& stretch : searched) {
    num_tests += stretch.search.num_tests;
    motion.longest_period_s = std::max(motion.longest_period_s, stretch.search.longest_period_s);
  }
  for (const SearchedStretch& stretch : searched) {
    if (!stretch.search.surest) continue;
    const Line& line = *stretch.search.surest;
    const double chance = line.chance * num_tests;
    if (chance > kMaxChance) continue;
    const PeriodicStretch found{stretch.from_s, stretch.to_s, 1.0 / line.frequency_hz, line.amplitude, chance};
    if (motion.stretches.empty() || !AreOne(motion.stretches.back(), found)) {
      motion.stretches.push_back(found);
      continue;
    }
    PeriodicStretch& before = motion.stretches.back();
    const double from_s = before.from_s;
    if (found.chance < before.chance) before = found;
    before.from_s = from_s;
    before.to_s = found.to_s;
  }
  return motion;
}

}  // namespace haustra
