#include "engine/atlas/view_choice.h"

#include <algorithm>
#include <array>
#include <limits>

#include "hal/core/check.h"

namespace haustra {

int LeastWorthyView(std::span<const PointView> views, const Eigen::Vector3d& position) {
  const int num = static_cast<int>(views.size());
  HAUSTRA_CHECK(num > kRecentViews && num <= kMaxViewsChosenFrom);
  // By age, so that the order of the list does not matter.
  std::array<int, kMaxViewsChosenFrom> order;
  for (int i = 0; i < num; ++i) order[static_cast<std::size_t>(i)] = i;
  std::sort(order.begin(), order.begin() + num, [&](int a, int b) { return views[a].keyframe < views[b].keyframe; });
  std::array<Eigen::Vector3d, kMaxViewsChosenFrom> rays;
  std::array<double, kMaxViewsChosenFrom> sizes;
  const int num_old = num - kRecentViews;
  for (int i = 0; i < num; ++i) {
    const PointView& view = views[order[i]];
    const Eigen::Vector3d to_camera = view.centre - position;
    const double distance = to_camera.norm();
    // A camera inside the point says nothing.
    if (!(distance > 0.0) && i < num_old) return order[i];
    rays[i] = distance > 0.0 ? Eigen::Vector3d(to_camera / distance) : Eigen::Vector3d::Zero();
    sizes[i] = view.scale_px * distance;
  }
  double closest = std::numeric_limits<double>::infinity();
  int least = 0;
  for (int i = 0; i < num_old; ++i) {
    for (int j = i + 1; j < num; ++j) {
      const double distance2 = (rays[i] - rays[j]).squaredNorm();
      if (!(distance2 < closest)) continue;
      closest = distance2;
      const bool is_i_offered = order[i] == num - 1, is_j_offered = order[j] == num - 1;
      const bool is_j_less = j < num_old && (is_j_offered || (sizes[j] > sizes[i] && !is_i_offered));
      least = is_j_less ? j : i;
    }
  }
  return order[least];
}

}  // namespace haustra
