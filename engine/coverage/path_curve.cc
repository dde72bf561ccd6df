#include "engine/coverage/path_curve.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <functional>
#include <limits>
#include <map>
#include <queue>
#include <utility>

#include "engine/coverage/lumen_line.h"

namespace haustra {
namespace {

constexpr double kCellShare = 0.2;       // of the scale
constexpr double kNeighbourShare = 0.6;  // places nearer than this are neighbours
constexpr double kJumpShare = 4.0;
constexpr double kCurveSmoothShare = 0.5;

struct Place {
  Eigen::Vector3d sum = Eigen::Vector3d::Zero();
  int count = 0;
  std::vector<std::pair<int, double>> neighbours;  // place, distance
  Eigen::Vector3d position() const { return sum / count; }
};

struct Ways {
  std::vector<double> length;  // from the start; infinite: no way
  std::vector<int> before;
};

// Dijkstra 1959.
Ways ShortestWays(const std::vector<Place>& places, int start) {
  Ways ways{std::vector<double>(places.size(), std::numeric_limits<double>::infinity()),
            std::vector<int>(places.size(), -1)};
  using Entry = std::pair<double, int>;
  std::priority_queue<Entry, std::vector<Entry>, std::greater<>> queue;
  ways.length[start] = 0.0;
  queue.emplace(0.0, start);
  while (!queue.empty()) {
    const auto [length, place] = queue.top();
    queue.pop();
    if (length > ways.length[place]) continue;
    for (const auto& [next, distance] : places[place].neighbours) {
      if (length + distance >= ways.length[next]) continue;
      ways.length[next] = length + distance;
      ways.before[next] = place;
      queue.emplace(ways.length[next], next);
    }
  }
  return ways;
}

int Farthest(const Ways& ways) {
  int farthest = -1;
  for (int i = 0; i < static_cast<int>(ways.length.size()); ++i) {
    if (std::isinf(ways.length[i])) continue;
    if (farthest < 0 || ways.length[i] > ways.length[farthest]) farthest = i;
  }
  return farthest;
}

// A place of the part that has most positions.
int StartOf(const std::vector<Place>& places) {
  std::vector<char> is_known(places.size(), 0);
  int best = 0;
  std::int64_t best_count = -1;
  for (int i = 0; i < static_cast<int>(places.size()); ++i) {
    if (is_known[i]) continue;
    std::int64_t count = 0;
    std::vector<int> open{i};
    is_known[i] = 1;
    while (!open.empty()) {
      const int place = open.back();
      open.pop_back();
      count += places[place].count;
      for (const auto& [next, distance] : places[place].neighbours) {
        if (is_known[next]) continue;
        is_known[next] = 1;
        open.push_back(next);
      }
    }
    if (count > best_count) best_count = count, best = i;
  }
  return best;
}

}  // namespace

std::vector<Eigen::Vector3d> SmoothCurve(const std::vector<Eigen::Vector3d>& points, double sigma_mu) {
  const int count = static_cast<int>(points.size());
  if (count < 3) return points;
  double total = 0.0;
  for (int i = 1; i < count; ++i) total += (points[i] - points[i - 1]).norm();
  const double sigma = sigma_mu / (total / (count - 1));  // steps
  const int reach = static_cast<int>(std::ceil(3.0 * sigma));
  const auto extended = [&](int i) -> Eigen::Vector3d {
    // Mirrored through the ends, so that they and the direction there stay.
    if (i < 0) return 2.0 * points[0] - points[std::min(-i, count - 1)];
    if (i >= count) return 2.0 * points[count - 1] - points[std::max(2 * count - 2 - i, 0)];
    return points[i];
  };
  std::vector<Eigen::Vector3d> smooth(points.size());
  for (int i = 0; i < count; ++i) {
    Eigen::Vector3d sum = Eigen::Vector3d::Zero();
    double weights = 0.0;
    for (int k = -reach; k <= reach; ++k) {
      const double weight = std::exp(-0.5 * k * k / std::max(sigma * sigma, 1e-12));
      sum += weight * extended(i + k);
      weights += weight;
    }
    smooth[i] = sum / weights;
  }
  return smooth;
}

std::vector<Eigen::Vector3d> CurveThroughPath(std::span<const Eigen::Vector3d> positions, double scale_mu) {
  std::vector<Place> places;
  std::map<std::array<double, 3>, int> place_of_cell;  // whole numbers: more than an integer holds
  std::vector<std::pair<int, int>> moves;              // from place to place
  const Eigen::Vector3d* first = nullptr;
  int last = -1;
  for (const Eigen::Vector3d& position : positions) {
    if (!position.allFinite()) continue;
    if (first == nullptr) first = &position;
    const Eigen::Vector3d cell = (position / (kCellShare * scale_mu)).array().floor();
    const auto [entry, is_new] =
        place_of_cell.try_emplace({cell.x(), cell.y(), cell.z()}, static_cast<int>(places.size()));
    if (is_new) places.emplace_back();
    places[entry->second].sum += position;
    ++places[entry->second].count;
    if (last >= 0 && last != entry->second) moves.emplace_back(last, entry->second);
    last = entry->second;
  }
  if (places.size() < 2) return {};
  const auto join = [&](int a, int b, double distance) {
    places[a].neighbours.emplace_back(b, distance);
    places[b].neighbours.emplace_back(a, distance);
  };
  for (int i = 0; i < static_cast<int>(places.size()); ++i) {
    for (int j = i + 1; j < static_cast<int>(places.size()); ++j) {
      const double distance = (places[i].position() - places[j].position()).norm();
      if (distance <= kNeighbourShare * scale_mu) join(i, j, distance);
    }
  }
  for (const auto& [a, b] : moves) {
    const double distance = (places[a].position() - places[b].position()).norm();
    if (distance > kNeighbourShare * scale_mu && distance <= kJumpShare * scale_mu) join(a, b, distance);
  }
  // The farthest place from anywhere is one end, and the farthest from there the other.
  const int end = Farthest(ShortestWays(places, StartOf(places)));
  const Ways ways = ShortestWays(places, end);
  std::vector<Eigen::Vector3d> curve;
  for (int i = Farthest(ways); i >= 0; i = ways.before[i]) curve.push_back(places[i].position());
  if (curve.size() < 2) return {};
  // In the direction in which the scope first went through it.
  if ((curve.front() - *first).norm() > (curve.back() - *first).norm()) {
    std::reverse(curve.begin(), curve.end());
  }
  const LumenLine even(curve, kCellShare * scale_mu);
  std::vector<Eigen::Vector3d> points;
  for (int i = 0; i < even.num_stations(); ++i) points.push_back(even.station(i).position);
  return SmoothCurve(points, kCurveSmoothShare * scale_mu);
}

}  // namespace haustra
