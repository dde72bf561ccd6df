#include "platform/file_sink.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <unistd.h>

#include <filesystem>
#include <fstream>
#include <sstream>

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

TEST_F(FileSinkTest, FullDiskIsReportedAndTheOldFileStays) {
  if (!fs::exists("/dev/full")) GTEST_SKIP() << "no /dev/full";
  std::ofstream(path()) << "old";
  // The temporary file is a link to a device that is always full.
  const std::string temporary = path() + ".partial-" + std::to_string(::getpid());
  fs::create_symlink("/dev/full", temporary);
  Result<FileSink> sink = FileSink::Create(path());
  ASSERT_TRUE(sink.ok());
  ASSERT_TRUE(sink->Write("text").ok());
  const Status status = sink->Commit();
  EXPECT_EQ(status.code(), StatusCode::kUnavailable);
  EXPECT_THAT(status.message(), HasSubstr(path()));
  EXPECT_EQ(sink->Commit().code(), StatusCode::kUnavailable);
  EXPECT_EQ(num_files(), 1);
  EXPECT_EQ(Read(path()), "old");
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
