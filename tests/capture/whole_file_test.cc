#include "capture/files/whole_file.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <sys/stat.h>

#include <fstream>
#include <string>
#include <thread>
#include <vector>

#include "tests/capture/temp_folder.h"

namespace haustra {
namespace {

using ::testing::HasSubstr;

std::vector<std::uint8_t> BytesOf(std::string_view text) { return {text.begin(), text.end()}; }

TEST(WholeFile, GivesAllBytes) {
  const TempFolder folder;
  // Lengths about those at which a reading may end.
  for (const std::size_t size : {0, 1, 65535, 65536, 65537, 300000}) {
    std::string text(size, 'a');
    if (size > 2) text[size / 2] = '\0';
    const std::string path = folder.Write("file", text);
    const Result<std::string> read = ReadWholeText(path);
    ASSERT_TRUE(read.ok()) << read.status().ToString();
    EXPECT_TRUE(*read == text) << size;
    const Result<std::vector<std::uint8_t>> bytes = ReadWholeFile(path);
    ASSERT_TRUE(bytes.ok());
    EXPECT_TRUE(*bytes == BytesOf(text)) << size;
  }
}

TEST(WholeFile, ReadsWhatTellsNoSize) {
  const TempFolder folder;
  const std::string pipe = folder.Path("pipe");
  ASSERT_EQ(::mkfifo(pipe.c_str(), 0600), 0);
  const std::string text(200000, 'p');
  std::thread writer([&] { std::ofstream(pipe, std::ios::binary) << text; });
  const Result<std::string> read = ReadWholeText(pipe);
  writer.join();
  ASSERT_TRUE(read.ok()) << read.status().ToString();
  EXPECT_TRUE(*read == text);
  const Result<std::string> status = ReadWholeText("/proc/self/status");
  ASSERT_TRUE(status.ok());
  EXPECT_THAT(*status, HasSubstr("VmSize"));
}

TEST(WholeFile, BoundIsKeptToTheByte) {
  const TempFolder folder;
  const std::string path = folder.Write("file", "12345");
  EXPECT_TRUE(ReadWholeText(path, 5).ok());
  const Status status = ReadWholeText(path, 4).status();
  EXPECT_EQ(status.code(), StatusCode::kCapacityExceeded);
  EXPECT_EQ(status.message(), path + ": longer than 4 bytes");
  // Without end, and without a size.
  EXPECT_EQ(ReadWholeFile("/dev/zero", 100000).status().message(), "/dev/zero: longer than 100000 bytes");
}

TEST(WholeFile, ErrorNamesTheFileAndTheReason) {
  const TempFolder folder;
  const Status missing = ReadWholeText(folder.Path("none")).status();
  EXPECT_EQ(missing.code(), StatusCode::kNotFound);
  EXPECT_EQ(missing.message(), folder.Path("none") + ": no such file");
  folder.Write("file", "text");
  EXPECT_EQ(ReadWholeText(folder.Path("file/below")).code(), StatusCode::kNotFound);
  const Status is_folder = ReadWholeText(folder.path()).status();
  EXPECT_EQ(is_folder.code(), StatusCode::kDataLoss);
  EXPECT_EQ(is_folder.message(), folder.path() + ": is a folder, not a file");
  std::filesystem::create_symlink("turns", folder.Path("turns"));
  const Status turns = ReadWholeText(folder.Path("turns")).status();
  EXPECT_EQ(turns.code(), StatusCode::kUnavailable);
  EXPECT_THAT(turns.message(), HasSubstr("turns: cannot be opened: "));
}

TEST(WholeFile, MemoryIsUsedAgainAndEmptyAfterAnError) {
  const TempFolder folder;
  const std::string large = folder.Write("large", std::string(5000, 'l'));
  const std::string small = folder.Write("small", "s");
  std::vector<std::uint8_t> bytes;
  ASSERT_TRUE(ReadWholeFile(large, 10000, &bytes).ok());
  EXPECT_EQ(bytes.size(), 5000u);
  const std::uint8_t* data = bytes.data();
  ASSERT_TRUE(ReadWholeFile(small, 10000, &bytes).ok());
  EXPECT_EQ(bytes, BytesOf("s"));
  EXPECT_EQ(bytes.data(), data);
  EXPECT_FALSE(ReadWholeFile(large, 100, &bytes).ok());
  EXPECT_TRUE(bytes.empty());
}

}  // namespace
}  // namespace haustra
