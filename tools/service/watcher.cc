#include "tools/service/watcher.h"

#include <chrono>
#include <cstddef>
#include <cstring>
#include <utility>

#include "platform/publish/ring_error.h"

namespace haustra {
namespace {

constexpr std::size_t kKeptLatencies = 250;  // ten seconds
constexpr std::size_t kKeptEvents = 8;

}  // namespace

Watcher::Watcher(const std::string& folder)
    : ring_path_(folder + "/poses"),
      status_path_(folder + "/" + std::string(kStatusSocket)),
      snapshot_(std::make_unique<haustra_snapshot>()) {}

Watcher::~Watcher() { haustra_ring_close(&ring_); }

const WatchModel& Watcher::Look() {
  if (ring_.file == nullptr || haustra_ring_is_replaced(&ring_, ring_path_.c_str()) != 0) Reopen();
  if (model_.is_connected) ReadRing();
  if (num_looks_++ % kLooksPerStatus == 0) AskStatus();
  return model_;
}

void Watcher::Reopen() {
  if (model_.is_connected) {
    haustra_ring_close(&ring_);
    // The rest is the ring's.
    WatchModel kept;
    kept.status = std::move(model_.status);
    kept.control_error = std::move(model_.control_error);
    model_ = std::move(kept);
    event_cursor_ = 0;
    last_look_ns_ = 0;
  }
  const int result = haustra_ring_open(&ring_, ring_path_.c_str());
  model_.ring_error = RingOpenError(ring_path_, result);
  model_.is_connected = result == HAUSTRA_OK;
  if (!model_.is_connected) return;
  // From now on, but for the last second.
  const std::uint64_t newest = haustra_ring_newest_pose(&ring_);
  cursor_ = newest > 25 ? newest - 25 : 0;
}

void Watcher::ReadRing() {
  model_.is_alive = haustra_ring_is_alive(&ring_, 1'000'000'000) != 0;
  model_.service = haustra_ring_service(&ring_);
  haustra_pose pose;
  std::uint64_t num_missed = 0;
  int num_poses = 0;
  while (haustra_ring_next_pose(&ring_, &cursor_, &pose, &num_missed) == HAUSTRA_OK) {
    ++num_poses;
    model_.num_missed += num_missed;
    model_.latencies_ms.push_back(static_cast<double>(pose.published_ns - pose.captured_ns) * 1e-6);
    if (model_.latencies_ms.size() > kKeptLatencies) model_.latencies_ms.pop_front();
  }
  const std::int64_t now_ns = haustra_now_ns();
  if (last_look_ns_ != 0 && now_ns > last_look_ns_) {
    const double rate = num_poses / (static_cast<double>(now_ns - last_look_ns_) * 1e-9);
    model_.poses_per_s = 0.8 * model_.poses_per_s + 0.2 * rate;
  }
  last_look_ns_ = now_ns;
  model_.has_pose = haustra_ring_latest_pose(&ring_, &model_.pose) == HAUSTRA_OK;
  model_.age_ms = static_cast<double>(now_ns - model_.pose.captured_ns) * 1e-6;
  haustra_event event;
  while (haustra_ring_next_event(&ring_, &event_cursor_, &event, &num_missed) == HAUSTRA_OK) {
    if (event.kind == HAUSTRA_EVENT_FRAME_NOT_FOUND || event.kind == HAUSTRA_EVENT_MERGE_REJECTED) continue;
    model_.events.push_back(event);
    if (model_.events.size() > kKeptEvents) model_.events.pop_front();
  }
  model_.has_snapshot = haustra_ring_latest_snapshot(&ring_, snapshot_.get()) == HAUSTRA_OK;
  if (model_.has_snapshot) std::memcpy(&model_.snapshot, snapshot_.get(), offsetof(haustra_snapshot, keyframes));
}

void Watcher::AskStatus() {
  if (!client_) {
    Result<ControlClient> client = ControlClient::Connect(status_path_);
    if (!client.ok()) {
      model_.control_error = client.status().message();
      model_.status.clear();
      return;
    }
    client_.emplace(std::move(*client));
  }
  const Result<std::string> reply = client_->Ask("status", std::chrono::seconds(2));
  if (reply.ok()) {
    model_.status = ParseStatusText(*reply);
    model_.control_error.clear();
  } else {
    model_.control_error = reply.status().message();
    client_.reset();
  }
}

}  // namespace haustra
