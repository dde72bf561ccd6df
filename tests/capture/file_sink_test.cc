#include "capture/files/file_sink.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <fcntl.h>
#include <signal.h>
#include <sys/resource.h>
#include <sys/stat.h>
#include <sys/wait.h>
#include <unistd.h>

#include <filesystem>
#include <fstream>
#include <sstream>

#include "tests/capture/plain_file_system.h"

namespace haustra {
namespace {

namespace fs = std::filesystem;
using ::testing::HasSubstr;

class FileSinkTest : public ::testing::Test {
 protected:
  void SetUp() override {
    const auto* test = ::testing::UnitTest::GetInstance()->current_test_info();
    folder_ = fs::path(::testing::TempDir()) / (std::string("haustra_file_sink_") + test->name());
    fs::remove_all(folder_);
    fs::create_directories(folder_);
  }
  void TearDown() override { fs::remove_all(folder_); }

  std::string path() const { return (folder_ / "map.ply").string(); }
  static std::string Read(const std::string& path) {
    std::ifstream stream(path, std::ios::binary);
    std::ostringstream text;
    text << stream.rdbuf();
    return text.str();
  }
  void KillOften();
  std::ptrdiff_t num_files() const { return std::distance(fs::directory_iterator(folder_), fs::directory_iterator()); }

  fs::path folder_;
};

TEST_F(FileSinkTest, CommitPutsTheWholeFileIntoPlace) {
  std::string expected;
  {
    Result<FileSink> sink = FileSink::Create(path());
    ASSERT_TRUE(sink.ok()) << sink.status().ToString();
    for (int i = 0; i < 40000; ++i) {
      const std::string piece = std::to_string(i) + " ";
      ASSERT_TRUE(sink->Write(piece).ok());
      expected += piece;
    }
    const std::string large(200000, 'x');
    ASSERT_TRUE(sink->Write(large).ok());
    expected += large;
    EXPECT_FALSE(fs::exists(path()));
    ASSERT_TRUE(sink->Commit().ok());
  }
  EXPECT_EQ(Read(path()), expected);
  EXPECT_EQ(num_files(), 1);
}

TEST_F(FileSinkTest, WithoutCommitTheOldFileStays) {
  std::ofstream(path()) << "old";
  {
    Result<FileSink> sink = FileSink::Create(path());
    ASSERT_TRUE(sink.ok());
    ASSERT_TRUE(sink->Write("new").ok());
  }
  EXPECT_EQ(Read(path()), "old");
  EXPECT_EQ(num_files(), 1);
}

TEST_F(FileSinkTest, CommitReplacesTheOldFile) {
  std::ofstream(path()) << "a longer old text";
  Result<FileSink> sink = FileSink::Create(path());
  ASSERT_TRUE(sink.ok());
  ASSERT_TRUE(sink->Write("new").ok());
  ASSERT_TRUE(sink->Commit().ok());
  EXPECT_EQ(Read(path()), "new");
}

TEST_F(FileSinkTest, MissingFolderIsNotFoundAndNamed) {
  const std::string path = (folder_ / "missing" / "map.ply").string();
  const Result<FileSink> sink = FileSink::Create(path);
  EXPECT_EQ(sink.code(), StatusCode::kNotFound);
  EXPECT_THAT(sink.status().message(), HasSubstr(path));
}

// Files of this process have a limit for the life of this.
class FileSizeLimit {
 public:
  explicit FileSizeLimit(rlim_t num_bytes) {
    ::signal(SIGXFSZ, SIG_IGN);
    ::getrlimit(RLIMIT_FSIZE, &before_);
    const rlimit limit{num_bytes, before_.rlim_max};
    ::setrlimit(RLIMIT_FSIZE, &limit);
  }
  ~FileSizeLimit() { ::setrlimit(RLIMIT_FSIZE, &before_); }

 private:
  rlimit before_{};
};

TEST_F(FileSinkTest, FullDiskIsReportedAndTheOldFileStays) {
  std::ofstream(path()) << "old";
  const FileSizeLimit limit(1000);
  Result<FileSink> sink = FileSink::Create(path());
  ASSERT_TRUE(sink.ok());
  ASSERT_TRUE(sink->Write(std::string(2000, 'x')).ok());
  const Status status = sink->Commit();
  EXPECT_EQ(status.code(), StatusCode::kUnavailable);
  EXPECT_THAT(status.message(), HasSubstr(path()));
  EXPECT_EQ(sink->Commit().code(), StatusCode::kUnavailable);
  EXPECT_EQ(num_files(), 1);
  EXPECT_EQ(Read(path()), "old");
}

TEST_F(FileSinkTest, TwoWritersOfOneNameDoNotMeet) {
  RecordProperty("req", "DMN-005");
  const std::string first(300000, 'a'), second(200000, 'b');
  Result<FileSink> a = FileSink::Create(path());
  ASSERT_TRUE(a.ok());
  ASSERT_TRUE(a->Write(first).ok());
  Result<FileSink> b = FileSink::Create(path());
  ASSERT_TRUE(b.ok());
  ASSERT_TRUE(b->Write(second).ok());
  ASSERT_TRUE(a->Commit().ok());
  EXPECT_EQ(Read(path()), first);
  ASSERT_TRUE(b->Commit().ok());
  EXPECT_EQ(Read(path()), second);
  EXPECT_EQ(num_files(), 1);
}

// A second name shows what becomes of the bytes that had the first one.
TEST_F(FileSinkTest, WhatItReplacesIsWipedWhenItIsToBe) {
  RecordProperty("req", "DATA-001");
  const std::string secret(100000, 's');
  std::ofstream(path()) << secret;
  const std::string seen = (folder_ / "seen").string();
  fs::create_hard_link(path(), seen);
  Result<FileSink> sink = FileSink::Create(path(), FormerFile::kWiped);
  ASSERT_TRUE(sink.ok());
  ASSERT_TRUE(sink->Write("new").ok());
  ASSERT_TRUE(sink->Commit().ok());
  EXPECT_EQ(Read(path()), "new");
  EXPECT_EQ(Read(seen), std::string(secret.size(), '\0'));
  EXPECT_EQ(num_files(), 2);
}

TEST_F(FileSinkTest, WhatItReplacesIsWipedWhereNamesCannotBeExchanged) {
  RecordProperty("req", "DATA-001");
  const PlainFileSystem plain;
  const std::string secret(100000, 's'), seen = (folder_ / "seen").string();
  for (const bool is_there : {false, true}) {
    if (is_there) {
      std::ofstream(path()) << secret;
      fs::create_hard_link(path(), seen);
    }
    Result<FileSink> sink = FileSink::Create(path(), FormerFile::kWiped);
    ASSERT_TRUE(sink.ok());
    ASSERT_TRUE(sink->Write("new").ok());
    const Status status = sink->Commit();
    ASSERT_TRUE(status.ok()) << status.ToString();
    EXPECT_EQ(Read(path()), "new");
  }
  EXPECT_EQ(Read(seen), std::string(secret.size(), '\0'));
  EXPECT_EQ(num_files(), 2);
}

TEST_F(FileSinkTest, WhatIsNotCommittedIsWipedWhenItIsToBe) {
  RecordProperty("req", "DATA-001");
  const std::string secret(100000, 's');
  const std::string seen = (folder_ / "seen").string();
  {
    Result<FileSink> sink = FileSink::Create(path(), FormerFile::kWiped);
    ASSERT_TRUE(sink.ok());
    ASSERT_TRUE(sink->Write(secret).ok());
    ASSERT_EQ(num_files(), 1);
    fs::create_hard_link(*fs::directory_iterator(folder_), seen);
  }
  EXPECT_EQ(Read(seen), std::string(secret.size(), '\0'));
  EXPECT_EQ(num_files(), 1);
}

TEST_F(FileSinkTest, WhatIsThereStaysWhenItIsTo) {
  RecordProperty("req", "DATA-001");
  std::ofstream(path()) << "old";
  const std::string secret(100000, 's');
  const std::string seen = (folder_ / "seen").string();
  Result<FileSink> sink = FileSink::Create(path(), FormerFile::kStays);
  ASSERT_TRUE(sink.ok());
  ASSERT_TRUE(sink->Write(secret).ok());
  for (const fs::directory_entry& entry : fs::directory_iterator(folder_)) {
    if (entry.path() != path()) fs::create_hard_link(entry.path(), seen);
  }
  const Status status = sink->Commit();
  EXPECT_EQ(status.code(), StatusCode::kUnavailable);
  EXPECT_THAT(status.message(), HasSubstr(path()));
  EXPECT_EQ(Read(path()), "old");
  EXPECT_EQ(Read(seen), std::string(secret.size(), '\0'));
  EXPECT_EQ(num_files(), 2);
}

TEST_F(FileSinkTest, AnotherNameMayBeChosenInTheEnd) {
  std::ofstream(path()) << "old";
  Result<FileSink> sink = FileSink::Create(path(), FormerFile::kStays);
  ASSERT_TRUE(sink.ok());
  ASSERT_TRUE(sink->Write("new").ok());
  const std::string other = (folder_ / "map-2.ply").string();
  ASSERT_TRUE(sink->CommitAs(other).ok());
  EXPECT_EQ(Read(path()), "old");
  EXPECT_EQ(Read(other), "new");
  EXPECT_EQ(num_files(), 2);
}

TEST_F(FileSinkTest, WhatIsThereStaysWhereTheSystemCannotRefuseAName) {
  RecordProperty("req", "DATA-001");
  const PlainFileSystem plain;
  std::ofstream(path()) << "old";
  Result<FileSink> sink = FileSink::Create(path(), FormerFile::kStays);
  ASSERT_TRUE(sink.ok());
  ASSERT_TRUE(sink->Write("new").ok());
  EXPECT_THAT(sink->Commit().message(), HasSubstr("File exists"));
  EXPECT_EQ(Read(path()), "old");
  EXPECT_EQ(num_files(), 1);
  Result<FileSink> second = FileSink::Create(path(), FormerFile::kStays);
  ASSERT_TRUE(second.ok());
  ASSERT_TRUE(second->Write("new").ok());
  const std::string other = (folder_ / "map-2.ply").string();
  const Status status = second->CommitAs(other);
  ASSERT_TRUE(status.ok()) << status.ToString();
  EXPECT_EQ(Read(other), "new");
  EXPECT_EQ(num_files(), 2);
}

// A child writes one file after the other under one name until it is killed, at another moment each time.
void FileSinkTest::KillOften() {
  const std::string first(150000, 'a'), second(90000, 'b');
  std::ofstream(path()) << first;
  int num_seen_temporary = 0;
  for (int i = 0; i < 100; ++i) {
    const pid_t child = ::fork();
    if (child == 0) {
      for (bool is_first = false;; is_first = !is_first) {
        Result<FileSink> sink = FileSink::Create(path(), FormerFile::kWiped);
        if (!sink.ok() || !sink->Write(is_first ? first : second).ok() || !sink->Commit().ok()) ::_exit(1);
      }
    }
    ::usleep(static_cast<useconds_t>(500 + 97 * i));
    ::kill(child, SIGKILL);
    int status = 0;
    ASSERT_EQ(::waitpid(child, &status, 0), child);
    ASSERT_TRUE(WIFSIGNALED(status)) << "the child could not write";
    const std::string left = Read(path());
    ASSERT_TRUE(left == first || left == second) << "after " << i << " kills: " << left.size() << " bytes";
    // What the next start of the service wipes; nothing else lies about.
    for (const fs::directory_entry& entry : fs::directory_iterator(folder_)) {
      if (entry.path() == path()) continue;
      EXPECT_THAT(entry.path().filename().string(), HasSubstr(".partial-"));
      ++num_seen_temporary;
      fs::remove(entry.path());
    }
  }
  EXPECT_GT(num_seen_temporary, 0) << "no kill came in the middle";
}

TEST_F(FileSinkTest, KillAtAnyMomentLeavesAWholeFile) {
  RecordProperty("req", "DMN-005");
  KillOften();
}

TEST_F(FileSinkTest, KillAtAnyMomentLeavesAWholeFileWhereNamesCannotBeExchanged) {
  RecordProperty("req", "DMN-005");
  const PlainFileSystem plain;
  KillOften();
}

// Before every call that gives or takes a name. Where nothing was before, nothing may be there, too, but no half of it.
TEST_F(FileSinkTest, CrashBeforeAnyStepLeavesTheFormerFileOrTheNewOne) {
  RecordProperty("req", "DMN-005");
  for (const FormerFile former : {FormerFile::kFreed, FormerFile::kWiped, FormerFile::kStays}) {
    const bool is_there = former != FormerFile::kStays;
    for (int step = 1, ends = 1; ends != 0; ++step) {
      SCOPED_TRACE("kind " + std::to_string(static_cast<int>(former)) + ", step " + std::to_string(step));
      fs::remove_all(folder_);
      fs::create_directories(folder_);
      if (is_there) std::ofstream(path()) << "old";
      ends = PlainFileSystem::EndsBeforeStep(step, [&] {
        Result<FileSink> sink = FileSink::Create(path(), former);
        if (sink.ok() && sink->Write("new").ok()) (void)sink->Commit();
      });
      const bool is_left = fs::exists(path());
      const std::string left = Read(path());
      if (ends == 0 || left == "new") {
        EXPECT_EQ(left, "new");
      } else {
        EXPECT_EQ(is_left, is_there);
        EXPECT_EQ(left, is_there ? "old" : "");
      }
    }
  }
}

// A link with the name of the next temporary file, to something else.
TEST_F(FileSinkTest, WhatLiesInTheWayIsLeftAlone) {
  const std::string other = (folder_ / "other").string();
  std::ofstream(other) << "of somebody else";
  for (int i = 0; i < 200; ++i) {
    fs::create_symlink(other,
                       path() + ".partial-" + std::to_string(::getpid()) + (i == 0 ? "" : "-" + std::to_string(i)));
  }
  Result<FileSink> sink = FileSink::Create(path());
  ASSERT_TRUE(sink.ok()) << sink.status().ToString();
  ASSERT_TRUE(sink->Write("new").ok());
  ASSERT_TRUE(sink->Commit().ok());
  EXPECT_EQ(Read(other), "of somebody else");
  EXPECT_EQ(Read(path()), "new");
}

TEST_F(FileSinkTest, WholeFileIsWrittenOrTheOldOneStays) {
  for (const Outlasts outlasts : {Outlasts::kPowerCut, Outlasts::kProcess}) {
    std::ofstream(path()) << "a longer old text";
    ASSERT_TRUE(WriteWholeFile(path(), "new", outlasts).ok());
    EXPECT_EQ(Read(path()), "new");
    const FileSizeLimit limit(1000);
    const Status status = WriteWholeFile(path(), std::string(2000, 'x'), outlasts);
    EXPECT_EQ(status.code(), StatusCode::kUnavailable);
    EXPECT_THAT(status.message(), HasSubstr(path() + ": cannot be written: "));
    EXPECT_EQ(Read(path()), "new");
    EXPECT_EQ(num_files(), 1);
  }
}

TEST_F(FileSinkTest, SecondCommitIsRefused) {
  Result<FileSink> sink = FileSink::Create(path());
  ASSERT_TRUE(sink.ok());
  ASSERT_TRUE(sink->Commit().ok());
  EXPECT_EQ(sink->Commit().code(), StatusCode::kFailedPrecondition);
  EXPECT_EQ(sink->Write("late").code(), StatusCode::kFailedPrecondition);
}

}  // namespace
}  // namespace haustra
