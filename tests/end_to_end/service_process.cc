#include "tests/end_to_end/service_process.h"

#include <gtest/gtest.h>
#include <poll.h>
#include <sys/socket.h>
#include <sys/un.h>
#include <unistd.h>

#include <algorithm>
#include <array>
#include <cstdlib>
#include <cstring>
#include <filesystem>
#include <sstream>
#include <thread>

namespace haustra::end_to_end {

using Clock = std::chrono::steady_clock;

// For one step of a service; a machine under load and a sanitizer are slow.
constexpr std::chrono::seconds kStepLimit{HAUSTRA_SANITIZED ? 300 : 100};

ServiceProcess::ServiceProcess(const std::string& folder) : folder_(folder) {
  std::filesystem::create_directories(state_folder());
  std::string pattern = testing::TempDir() + "haustrad_XXXXXX";
  runtime_folder_ = mkdtemp(pattern.data());
  socket_ = socket(AF_UNIX, SOCK_DGRAM | SOCK_CLOEXEC, 0);
  sockaddr_un address{};
  address.sun_family = AF_UNIX;
  // In the abstract name space: the path of a build folder may be too long for a socket.
  const std::string name =
      "haustra_test_" + std::to_string(getpid()) + "_" + std::to_string(reinterpret_cast<std::uintptr_t>(this));
  std::memcpy(address.sun_path + 1, name.data(), name.size());
  EXPECT_EQ(bind(socket_, reinterpret_cast<const sockaddr*>(&address),
                 static_cast<socklen_t>(offsetof(sockaddr_un, sun_path) + 1 + name.size())),
            0);
  setenv("NOTIFY_SOCKET", ("@" + name).c_str(), 1);
  setenv("WATCHDOG_USEC", "2000000", 1);
  unsetenv("WATCHDOG_PID");
  listener_ = std::thread([this] { Listen(); });
}

ServiceProcess::~ServiceProcess() {
  command_.reset();
  is_ending_ = true;
  listener_.join();
  close(socket_);
  std::filesystem::remove_all(runtime_folder_);
  unsetenv("NOTIFY_SOCKET");
  unsetenv("WATCHDOG_USEC");
}

void ServiceProcess::Start(const std::vector<std::string>& arguments, const std::vector<std::string>& prefix) {
  std::vector<std::string> words = prefix;
  words.push_back(HAUSTRAD_BINARY);
  words.insert(words.end(),
               {"--set", "files.state_folder=" + state_folder(), "--set", "files.runtime_folder=" + runtime_folder()});
  // A machine under load is no hang, and the pools need not be those of a real procedure.
  for (const char* setting : {"watchdog.tracking_limit_ms=5000", "watchdog.stop_limit_ms=60000",
                              "watchdog.worker_limit_ms=60000", "watchdog.capture_limit_ms=60000",
                              "watchdog.mapping_limit_ms=300000", "memory.max_keyframes=300", "features.max=800"}) {
    words.insert(words.end(), {"--set", setting});
  }
  words.insert(words.end(), arguments.begin(), arguments.end());
  ForgetMessages();
  command_ = std::make_unique<Command>(words);
}

void ServiceProcess::Listen() {
  std::array<char, 4096> message;
  while (!is_ending_) {
    pollfd event{socket_, POLLIN, 0};
    if (poll(&event, 1, 50) <= 0) continue;
    const ssize_t count = recv(socket_, message.data(), message.size(), 0);
    if (count <= 0) continue;
    std::istringstream lines(std::string(message.data(), static_cast<std::size_t>(count)));
    const std::lock_guard lock(mutex_);
    for (std::string line; std::getline(lines, line);) messages_.push_back(line);
  }
}

void ServiceProcess::ForgetMessages() {
  const std::lock_guard lock(mutex_);
  messages_.clear();
}

bool ServiceProcess::HasSaid(const std::string& line) {
  const std::lock_guard lock(mutex_);
  return std::find(messages_.begin(), messages_.end(), line) != messages_.end();
}

bool ServiceProcess::WaitForMessage(const std::string& line) {
  const auto end = Clock::now() + kStepLimit;
  while (!HasSaid(line)) {
    if (!command_->IsRunning() || Clock::now() > end) {
      // What it said last may still be on its way.
      std::this_thread::sleep_for(std::chrono::milliseconds(200));
      return HasSaid(line);
    }
    std::this_thread::sleep_for(std::chrono::milliseconds(5));
  }
  return true;
}

bool ServiceProcess::WaitForStatus(const std::string& line) {
  const auto end = Clock::now() + kStepLimit;
  while (("\n" + Status()).find("\n" + line) == std::string::npos) {
    if (!command_->IsRunning() || Clock::now() > end) {
      ADD_FAILURE() << "waited for '" << line << "' in vain:\n" << Status();
      return false;
    }
    std::this_thread::sleep_for(std::chrono::milliseconds(20));
  }
  return true;
}

std::string ServiceProcess::Ask(const std::string& request) {
  Result<ControlClient> client = ControlClient::Connect(runtime_folder() + "/control");
  if (!client.ok()) return "error: " + client.status().message();
  const Result<std::string> reply = client->Ask(request, kHangLimit);
  return reply.ok() ? *reply : "error: " + reply.status().message();
}

std::string ServiceProcess::StatusValue(const std::string& key) {
  std::istringstream lines(Status());
  for (std::string line; std::getline(lines, line);) {
    if (line.starts_with(key + " ")) return line.substr(key.size() + 1);
  }
  return "";
}

pid_t ServiceProcess::pid() { return command_->pid(); }

pid_t ServiceProcess::worker_pid() {
  const std::string text = StatusValue("worker");
  return text.empty() ? 0 : std::stoi(text);
}

}  // namespace haustra::end_to_end
