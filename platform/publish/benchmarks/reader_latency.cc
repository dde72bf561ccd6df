// What readers of the pose ring cost its writer: ten, one of which is stopped, against none, and against ten that do
// not pause as the header tells but look every two milliseconds; in turn, so that all meet the same machine.
//
//     haustra_reader_latency                    the writer alone: time of one PublishPose
//     haustra_reader_latency POSES [SECONDS]    of a running haustrad: latency from capture to publication, in
//                                               windows of so many seconds (10), six of each kind
//
// What it says goes into ../decisions.
#include <signal.h>
#include <sys/resource.h>
#include <sys/wait.h>
#include <unistd.h>

#include <algorithm>
#include <array>
#include <chrono>
#include <cstdint>
#include <cstdio>
#include <cstdlib>
#include <span>
#include <string>
#include <thread>
#include <vector>

#include "hal/core/percentile.h"
#include "platform/publish/pose_ring_writer.h"

namespace haustra {
namespace {

constexpr int kNumReaders = 10;
constexpr int kNumWindows = 6;

enum Company { kAlone, kHastyReaders, kReaders, kNumCompanies };
constexpr const char* kCompanyNames[] = {"alone", "10 that look every 2 ms", "10 readers, 1 stopped"};
using Measured = std::array<std::vector<double>, kNumCompanies>;

// Until it is killed.
[[noreturn]] void ReadForEver(const std::string& path, bool is_hasty) {
  haustra_ring ring;
  if (haustra_ring_open(&ring, path.c_str()) != HAUSTRA_OK) _exit(1);
  std::uint64_t cursor = 0;
  while (true) {
    haustra_pose pose;
    std::uint64_t num_missed = 0;
    while (haustra_ring_next_pose(&ring, &cursor, &pose, &num_missed) == HAUSTRA_OK) {
    }
    const std::int64_t pause_ns = is_hasty ? 2'000'000 : haustra_ring_pause_ns(&ring, haustra_now_ns());
    std::this_thread::sleep_for(std::chrono::nanoseconds(pause_ns));
  }
}

// What the readers of all windows of a kind took together.
struct Taken {
  double processor_s = 0.0;
  double num_wake_ups = 0.0;
  double wall_s = 0.0;
};
std::array<Taken, kNumCompanies> taken;

class Readers {
 public:
  Readers(const std::string& path, Company company) : taken_(taken[company]), begin_ns_(haustra_now_ns()) {
    for (int i = 0; company != kAlone && i < kNumReaders; ++i) {
      const pid_t child = fork();
      if (child == 0) ReadForEver(path, company == kHastyReaders);
      children_.push_back(child);
    }
    std::this_thread::sleep_for(std::chrono::milliseconds(200));
    if (!children_.empty()) kill(children_.front(), SIGSTOP);
  }
  ~Readers() {
    taken_.wall_s += static_cast<double>(haustra_now_ns() - begin_ns_) * 1e-9;
    for (const pid_t child : children_) {
      kill(child, SIGKILL);
      rusage usage{};
      wait4(child, nullptr, 0, &usage);
      for (const timeval& time : {usage.ru_utime, usage.ru_stime}) {
        taken_.processor_s += static_cast<double>(time.tv_sec) + 1e-6 * static_cast<double>(time.tv_usec);
      }
      taken_.num_wake_ups += static_cast<double>(usage.ru_nvcsw);
    }
  }
  Readers(const Readers&) = delete;
  Readers& operator=(const Readers&) = delete;

 private:
  Taken& taken_;
  const std::int64_t begin_ns_;
  std::vector<pid_t> children_;
};

void Print(const char* name, std::vector<double> values, const char* unit) {
  if (values.empty()) return;
  std::sort(values.begin(), values.end());
  const std::span<const double> sorted(values);
  std::printf("%-24s %8zu  median %8.3f  p90 %8.3f  p99 %8.3f  p99.9 %8.3f  max %8.3f %s\n", name, values.size(),
              Percentile(sorted, 500), Percentile(sorted, 900), Percentile(sorted, 990), Percentile(sorted, 999),
              values.back(), unit);
}

void PrintAll(const Measured& measured, const char* unit) {
  std::array<double, kNumCompanies> medians{};
  for (int company = 0; company < kNumCompanies; ++company) {
    std::vector<double> values = measured[company];
    Print(kCompanyNames[company], values, unit);
    if (values.empty()) return;
    std::sort(values.begin(), values.end());
    medians[company] = Percentile(std::span<const double>(values), 500);
  }
  for (const Company company : {kHastyReaders, kReaders}) {
    std::printf("%-24s wake up %.0f times a second and take %.2f %% of a processor, together\n", kCompanyNames[company],
                taken[company].num_wake_ups / taken[company].wall_s,
                100.0 * taken[company].processor_s / taken[company].wall_s);
  }
  std::printf("ratio of medians to that alone: readers %.3f, hasty ones %.3f\n", medians[kReaders] / medians[kAlone],
              medians[kHastyReaders] / medians[kAlone]);
}

int MeasureWriter() {
  std::string pattern = "/dev/shm/haustra_reader_latency_XXXXXX";
  const char* folder = mkdtemp(pattern.data());
  if (folder == nullptr) return 74;
  const std::string path = std::string(folder) + "/poses";
  {
    const auto writer = PoseRingWriter::Create(path, 0600, static_cast<gid_t>(-1));
    if (!writer.ok()) return 74;
    Measured measured_us;
    for (int window = 0; window < kNumCompanies * kNumWindows; ++window) {
      const auto company = static_cast<Company>(window % kNumCompanies);
      const Readers readers(path, company);
      for (int i = 0; i < 500; ++i) {
        std::this_thread::sleep_for(std::chrono::milliseconds(2));
        const std::int64_t begin_ns = haustra_now_ns();
        (*writer)->PublishPose({});
        measured_us[company].push_back(static_cast<double>(haustra_now_ns() - begin_ns) * 1e-3);
      }
    }
    PrintAll(measured_us, "us");
  }
  rmdir(folder);
  return 0;
}

int MeasureDaemon(const std::string& path, int seconds) {
  haustra_ring ring;
  if (haustra_ring_open(&ring, path.c_str()) != HAUSTRA_OK) {
    std::fprintf(stderr, "%s: not the poses of a running haustrad\n", path.c_str());
    return 69;
  }
  Measured measured_ms;
  for (int window = 0; window < kNumCompanies * kNumWindows; ++window) {
    const auto company = static_cast<Company>(window % kNumCompanies);
    const Readers readers(path, company);
    std::uint64_t cursor = haustra_ring_newest_pose(&ring);
    const std::int64_t end_ns = haustra_now_ns() + std::int64_t{seconds} * 1'000'000'000;
    while (haustra_now_ns() < end_ns) {
      haustra_pose pose;
      std::uint64_t num_missed = 0;
      while (haustra_ring_next_pose(&ring, &cursor, &pose, &num_missed) == HAUSTRA_OK) {
        measured_ms[company].push_back(static_cast<double>(pose.published_ns - pose.captured_ns) * 1e-6);
      }
      std::this_thread::sleep_for(std::chrono::milliseconds(20));
    }
  }
  haustra_ring_close(&ring);
  PrintAll(measured_ms, "ms");
  return 0;
}

}  // namespace
}  // namespace haustra

int main(int argc, char** argv) {
  if (argc == 1) return haustra::MeasureWriter();
  const int seconds = argc > 2 ? std::atoi(argv[2]) : 10;
  if (argc > 3 || seconds < 1) return 64;
  return haustra::MeasureDaemon(argv[1], seconds);
}
