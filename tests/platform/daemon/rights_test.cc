#include "platform/daemon/rights.h"

#include <fcntl.h>
#include <gtest/gtest.h>
#include <sys/ioctl.h>
#include <sys/socket.h>
#include <sys/wait.h>
#include <unistd.h>

#include <cerrno>
#include <filesystem>
#include <fstream>
#include <functional>
#include <string>

namespace haustra {
namespace {

namespace fs = std::filesystem;

class Rights : public testing::Test {
 protected:
  Rights() {
    std::string pattern = testing::TempDir() + "rights_XXXXXX";
    folder_ = mkdtemp(pattern.data());
    fs::create_directories(folder_ + "/own/saved");
    fs::create_directories(folder_ + "/other");
  }
  ~Rights() override { fs::remove_all(folder_); }

  // The number that `job` returns in a child that has given its rights away.
  int InChild(const std::function<int(const RightsTaken&)>& job) const {
    const pid_t child = fork();
    if (child == 0) _exit(job(TakeRightsAway({folder_ + "/own", folder_ + "/nowhere"})));
    int status = 0;
    waitpid(child, &status, 0);
    EXPECT_TRUE(WIFEXITED(status)) << "signal " << WTERMSIG(status);
    return WEXITSTATUS(status);
  }

  std::string folder_;
};

constexpr int kMissing = 100;  // in this kernel

int ErrorOf(long result) { return result < 0 ? errno : 0; }  // NOLINT(google-runtime-int): any system call's

TEST_F(Rights, DevicesProgramsAndTheNetworkAreOutOfReach) {
  RecordProperty("req", "DMN-011");
  const int device = open("/dev/null", O_RDWR | O_CLOEXEC);
  const auto refused = [&](const std::function<long()>& call) {  // NOLINT(google-runtime-int)
    return InChild(
        [&](const RightsTaken& taken) { return taken.system_calls == "taken" ? ErrorOf(call()) : kMissing; });
  };
  if (refused([] { return 0; }) == kMissing) GTEST_SKIP() << "this kernel has no filter of system calls";
  EXPECT_EQ(refused([&] {
              int count = 0;
              return ioctl(device, FIONREAD, &count);
            }),
            EPERM);
  EXPECT_EQ(refused([] { return execl("/bin/true", "true", nullptr); }), EPERM);
  EXPECT_EQ(refused([] { return socket(AF_INET, SOCK_STREAM, 0); }), EPERM);
  EXPECT_EQ(refused([] { return socket(AF_UNIX, SOCK_STREAM, 0); }), 0);
  close(device);
}

TEST_F(Rights, OnlyItsOwnFoldersAreWrittenTo) {
  RecordProperty("req", "DMN-011");
  const auto opened = [&](const std::string& path, int flags) {
    return InChild([&](const RightsTaken& taken) {
      return taken.files == "taken" ? ErrorOf(open(path.c_str(), flags | O_CLOEXEC, 0600)) : kMissing;
    });
  };
  if (opened("/", O_PATH) == kMissing) GTEST_SKIP() << "this kernel has no Landlock that will do";
  EXPECT_EQ(opened("/dev/null", O_RDONLY), EACCES);
  EXPECT_EQ(opened("/dev/null", O_WRONLY), EACCES);
  EXPECT_EQ(opened("/proc/self/statm", O_RDONLY), 0);
  EXPECT_EQ(opened("/etc/passwd", O_RDONLY), 0);
  EXPECT_EQ(opened(folder_ + "/other/file", O_WRONLY | O_CREAT), EACCES);
  EXPECT_EQ(opened(folder_ + "/own/file", O_WRONLY | O_CREAT), 0);
  const int moved = InChild([&](const RightsTaken&) {
    return ErrorOf(rename((folder_ + "/own/file").c_str(), (folder_ + "/own/saved/file").c_str()));
  });
  EXPECT_EQ(moved, 0);
}

}  // namespace
}  // namespace haustra
