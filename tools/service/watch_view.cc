#include "tools/service/watch_view.h"

#include <algorithm>
#include <cstdarg>
#include <cstdio>
#include <span>
#include <sstream>
#include <vector>

#include "hal/core/percentile.h"

namespace haustra {
namespace {

class Page {
 public:
  explicit Page(int columns) : columns_(static_cast<std::size_t>(std::max(20, columns))) {}
  [[gnu::format(printf, 2, 3)]] void Line(const char* format, ...) {
    char text[512];
    va_list arguments;
    va_start(arguments, format);
    std::vsnprintf(text, sizeof text, format, arguments);
    va_end(arguments);
    // What the daemon quotes is not to move the cursor.
    for (char* c = text; *c != '\0'; ++c) {
      if (static_cast<unsigned char>(*c) < 0x20 || *c == 0x7f) *c = '?';
    }
    text_ += std::string(text).substr(0, columns_) + "\n";
  }
  const std::string& text() const { return text_; }

 private:
  std::size_t columns_;
  std::string text_;
};

std::string Service(const WatchModel& model) {
  if (!model.is_connected) return model.ring_error.empty() ? "no daemon" : model.ring_error;
  if (!model.is_alive) return model.service == HAUSTRA_SERVICE_CLOSED ? "stopped" : "silent: crashed or hanging";
  return haustra_service_name(model.service);
}

}  // namespace

std::map<std::string, std::string> ParseStatusText(const std::string& text) {
  std::map<std::string, std::string> values;
  std::istringstream lines(text);
  for (std::string line; std::getline(lines, line);) {
    const std::size_t space = line.find(' ');
    if (space != std::string::npos) values[line.substr(0, space)] = line.substr(space + 1);
  }
  return values;
}

std::string WatchPage(const WatchModel& model, int columns) {
  Page page(columns);
  const auto value = [&](const char* key) {
    const auto it = model.status.find(key);
    return it == model.status.end() ? std::string("-") : it->second;
  };
  page.Line("haustra    %s", Service(model).c_str());
  if (!model.control_error.empty()) {
    page.Line("control    %s", model.control_error.c_str());
  } else {
    page.Line("procedure  %s  label %s  up %s s", value("procedure").c_str(), value("label").c_str(),
              value("uptime_s").c_str());
    page.Line("frames     %s  dropped %s  damaged %s  checkpoints %s (last %s s ago)", value("frames").c_str(),
              value("frames_dropped").c_str(), value("frames_damaged").c_str(), value("checkpoints").c_str(),
              value("checkpoint_age_s").c_str());
    for (const char* key : {"hang", "trouble", "checkpoint_error", "needs_restart"}) {
      if (model.status.contains(key)) page.Line("%-10s %s", key, value(key).c_str());
    }
  }
  page.Line("%s", "");
  if (model.has_pose) {
    const haustra_pose& pose = model.pose;
    page.Line("tracking   %s (%s)  frame %llu  %s", haustra_state_name(pose.state), haustra_reason_name(pose.reason),
              static_cast<unsigned long long>(pose.frame_index),
              (pose.flags & HAUSTRA_POSE_PREDICTED) != 0 ? "PREDICTED" : "");
    if ((pose.flags & HAUSTRA_POSE_VALID) != 0) {
      page.Line("pose       map %u.%llu  at %.3f %.3f %.3f map units  quaternion %.3f %.3f %.3f %.3f", pose.map_id,
                static_cast<unsigned long long>(pose.map_epoch), pose.position_mu[0], pose.position_mu[1],
                pose.position_mu[2], pose.orientation_xyzw[0], pose.orientation_xyzw[1], pose.orientation_xyzw[2],
                pose.orientation_xyzw[3]);
    } else {
      page.Line("pose       none");
    }
    page.Line("points     %u features, %u inliers", pose.num_features, pose.num_inliers);
    std::vector<double> latencies_ms(model.latencies_ms.begin(), model.latencies_ms.end());
    std::sort(latencies_ms.begin(), latencies_ms.end());
    const std::span<const double> sorted(latencies_ms);
    page.Line("latency    last %.1f ms  median %.1f  p99 %.1f  max %.1f  (%zu frames)",
              model.latencies_ms.empty() ? 0.0 : model.latencies_ms.back(), Percentile(sorted, 500),
              Percentile(sorted, 990), Percentile(sorted, 1000), sorted.size());
    page.Line("age        %.0f ms  %.1f poses/s  missed here %llu", model.age_ms, model.poses_per_s,
              static_cast<unsigned long long>(model.num_missed));
  } else {
    page.Line("tracking   no pose");
  }
  if (model.has_snapshot) {
    page.Line("map        %d: %u keyframes, %u points; %u maps in all", static_cast<int>(model.snapshot.map_id),
              model.snapshot.num_map_keyframes, model.snapshot.num_map_points, model.snapshot.num_maps);
  }
  page.Line("%s", "");
  for (const haustra_event& event : model.events) {
    page.Line("event      %s map %d frame %llu", haustra_event_name(event.kind), static_cast<int>(event.map_id),
              static_cast<unsigned long long>(event.frame_index));
  }
  return page.text();
}

std::string WatchLine(const WatchModel& model) {
  std::ostringstream line;
  line << Service(model);
  if (model.has_pose) {
    line << " " << haustra_state_name(model.pose.state) << " " << haustra_reason_name(model.pose.reason) << " frame "
         << model.pose.frame_index;
    if ((model.pose.flags & HAUSTRA_POSE_VALID) != 0) {
      line << " map " << model.pose.map_id << " at " << model.pose.position_mu[0] << " " << model.pose.position_mu[1]
           << " " << model.pose.position_mu[2];
    }
    line << " latency_ms " << (model.latencies_ms.empty() ? 0.0 : model.latencies_ms.back());
  }
  return line.str() + "\n";
}

}  // namespace haustra
