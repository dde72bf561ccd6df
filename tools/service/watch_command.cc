#include "tools/service/watch_command.h"

#include <sys/ioctl.h>
#include <unistd.h>

#include <cstdio>
#include <memory>
#include <string>
#include <thread>

#include "tools/command/console.h"
#include "tools/exit_codes.h"
#include "tools/service/runtime_folder.h"
#include "tools/service/watch_view.h"
#include "tools/service/watcher.h"

namespace haustra {
namespace {

using std::chrono::milliseconds;

constexpr milliseconds kStep{200};

struct WatchArguments {
  std::string folder = kRuntimeFolder;
  bool once = false;
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
    } else if (step % Watcher::kLooksPerStatus == 0) {
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
