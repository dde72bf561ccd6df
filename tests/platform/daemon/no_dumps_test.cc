#include "platform/daemon/no_dumps.h"

#include <gtest/gtest.h>
#include <sys/mman.h>
#include <sys/prctl.h>
#include <sys/resource.h>
#include <sys/wait.h>
#include <unistd.h>

#include <csignal>
#include <filesystem>
#include <fstream>
#include <string>

#include "tests/sanitized.h"

namespace haustra {
namespace {

namespace fs = std::filesystem;

class NoDumps : public testing::Test {
 protected:
  NoDumps() {
    std::string pattern = testing::TempDir() + "no_dumps_XXXXXX";
    folder_ = mkdtemp(pattern.data());
  }
  ~NoDumps() override { fs::remove_all(folder_); }

  // Whether the kernel dumped a child that aborts in a folder where it may, however large. A handler that the kernel
  // pipes dumps to counts as well.
  bool IsDumped(bool is_forbidden) const {
    const pid_t child = ::fork();
    if (child == 0) {
      rlimit limit{};
      ::getrlimit(RLIMIT_CORE, &limit);
      limit.rlim_cur = limit.rlim_max;
      ::setrlimit(RLIMIT_CORE, &limit);
      std::signal(SIGABRT, SIG_DFL);
      if (::chdir(folder_.c_str()) != 0) ::_exit(1);
      if (is_forbidden && !ForbidDumps()) ::_exit(2);
      ::kill(::getpid(), SIGABRT);
      ::_exit(3);
    }
    int status = 0;
    ::waitpid(child, &status, 0);
    EXPECT_TRUE(WIFSIGNALED(status)) << WEXITSTATUS(status);
    return WIFSIGNALED(status) && WCOREDUMP(status);
  }

  std::string folder_;
};

TEST_F(NoDumps, ProcessThatForbidsThemIsNotDumped) {
  RecordProperty("req", "DATA-001");
  if (test::kIsSanitized) GTEST_SKIP() << "a dump would hold the sanitizer's memory, too";
  if (!IsDumped(false)) GTEST_SKIP() << "this machine dumps nothing: see /proc/sys/kernel/core_pattern and ulimit -c";
  EXPECT_FALSE(IsDumped(true));
  // Of the first child at most.
  EXPECT_LE(std::distance(fs::directory_iterator(folder_), fs::directory_iterator()), 1);
}

// "dd" in the line VmFlags of the mapping.
bool IsLeftOut(const void* address) {
  std::ifstream maps("/proc/self/smaps");
  bool is_in = false;
  for (std::string line; std::getline(maps, line);) {
    std::uintptr_t begin = 0, end = 0;
    if (std::sscanf(line.c_str(), "%lx-%lx ", &begin, &end) == 2) {
      const auto place = reinterpret_cast<std::uintptr_t>(address);
      is_in = begin <= place && place < end;
    }
    if (is_in && line.starts_with("VmFlags:")) return (line + " ").find(" dd ") != std::string::npos;
  }
  return false;
}

TEST_F(NoDumps, WhatWasTakenIsLeftOut) {
  RecordProperty("req", "DATA-001");
  const std::string large(std::size_t{1} << 22, 'p'), small(100, 'p');
  const int on_the_stack = 0;
  EXPECT_FALSE(IsLeftOut(large.data()));
  LeaveMemoryOutOfDumps();
  EXPECT_TRUE(IsLeftOut(large.data()));
  EXPECT_TRUE(IsLeftOut(small.data()));
  EXPECT_TRUE(IsLeftOut(&on_the_stack));
}

}  // namespace
}  // namespace haustra
