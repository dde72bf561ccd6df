#include "tools/service/watch_command.h"

#include <sys/ioctl.h>
#include <unistd.h>

#include <cstdio>
#include <cstring>
#include <memory>
#include <optional>
#include <string>
#include <thread>

#include "platform/control/control_client.h"
#include "tools/command/console.h"
#include "tools/exit_codes.h"
#include "tools/service/runtime_folder.h"
#include "tools/service/watch_view.h"

namespace haustra {
namespace {

using std::chrono::milliseconds;

constexpr std::size_t kKeptLatencies = 250;  // ten seconds
constexpr std::size_t kKeptEvents = 8;
constexpr int kStepsPerStatus = 5;
constexpr milliseconds kStep{200};

struct WatchArguments {
  std::string folder = kRuntimeFolder;
  bool once = false;
};

class Watcher {
 public:
  explicit Watcher(std::string folder) : folder_(std::move(folder)), snapshot_(std::make_unique<haustra_snapshot>()) {}
  ~Watcher() { haustra_ring_close(&ring_); }
  Watcher(const Watcher&) = delete;
  Watcher& operator=(const Watcher&) = delete;

  const WatchModel& Look() {
    const std::string path = folder_ + "/poses";
    if (ring_.file == nullptr || haustra_ring_is_replaced(&ring_, path.c_str()) != 0) {
      haustra_ring_close(&ring_);
      model_ = WatchModel{};
      cursor_ = event_cursor_ = 0;
      if (haustra_ring_open(&ring_, path.c_str()) == HAUSTRA_OK) {
        // From now on, but for the last second.
        const std::uint64_t newest = haustra_ring_newest_pose(&ring_);
        cursor_ = newest > 25 ? newest - 25 : 0;
      }
    }
    model_.is_connected = ring_.file != nullptr;
    if (model_.is_connected) ReadRing();
    if (num_steps_++ % kStepsPerStatus == 0) AskStatus();
    return model_;
  }

 private:
  void ReadRing() {
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

  void AskStatus() {
    if (!client_) {
      Result<ControlClient> client = ControlClient::Connect(folder_ + "/" + std::string(kStatusSocket));
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

  std::string folder_;
  haustra_ring ring_{};
  std::unique_ptr<haustra_snapshot> snapshot_;
  std::optional<ControlClient> client_;
  WatchModel model_;
  std::uint64_t cursor_ = 0;
  std::uint64_t event_cursor_ = 0;
  std::int64_t last_look_ns_ = 0;
  int num_steps_ = 0;
};

int TerminalColumns() {
  winsize size{};
  return ::ioctl(STDOUT_FILENO, TIOCGWINSZ, &size) == 0 && size.ws_col > 0 ? size.ws_col : 100;
}

int Watch(const WatchArguments& arguments) {
  Watcher watcher(arguments.folder);
  if (arguments.once) {
    const WatchModel& model = watcher.Look();
    console::Print("%s", WatchPage(model, 1000).c_str());
    return model.is_connected ? kExitOk : kExitUnavailable;
  }
  const bool is_terminal = ::isatty(STDOUT_FILENO) != 0;
  // Nothing is written: a stop may end it here and now (stop_signal.h).
  for (int step = 0;; ++step) {
    const WatchModel& model = watcher.Look();
    if (is_terminal) {
      // Home, then each line cleared to its end, then what is below: nothing flickers.
      std::string page = WatchPage(model, TerminalColumns());
      for (std::size_t at = 0; (at = page.find('\n', at)) != std::string::npos; at += 4) page.insert(at, "\x1b[K");
      console::Print("\x1b[H%s\x1b[J", page.c_str());
    } else if (step % kStepsPerStatus == 0) {
      console::Print("%s", WatchLine(model).c_str());
    }
    if (std::fflush(stdout) != 0) break;
    std::this_thread::sleep_for(kStep);
  }
  return kExitOk;
}

}  // namespace

void AddWatchCommand(CLI::App& app, std::function<int()>& action) {
  const auto arguments = std::make_shared<WatchArguments>();
  CLI::App* command = app.add_subcommand("watch", "What a running haustrad sees, live");
  command->add_option("--folder", arguments->folder, "Runtime folder of the daemon")->capture_default_str();
  command->add_flag("--once", arguments->once, "Prints it once and ends (69 when there is no daemon)");
  command->callback([arguments, &action] { action = [arguments] { return Watch(*arguments); }; });
}

}  // namespace haustra
