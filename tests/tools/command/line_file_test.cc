#include "tools/command/line_file.h"

#include <fcntl.h>
#include <gtest/gtest.h>

#include <string>

#include "tests/capture/temp_folder.h"
#include "tests/tools/command/file_size_limit.h"

namespace haustra {
namespace {

class LineFileTest : public testing::Test {
 protected:
  TempFolder folder_;
  const std::string path_ = folder_.Path("lines.txt");
  LineFile file_{path_, ::open(path_.c_str(), O_WRONLY | O_CREAT | O_APPEND | O_CLOEXEC, 0600)};
};

TEST_F(LineFileTest, CanBeReadAsItGrows) {
  EXPECT_TRUE(file_.Append("first\n").ok());
  EXPECT_EQ(folder_.Read("lines.txt"), "first\n");
  EXPECT_TRUE(file_.Append("second\n", /*to_disk=*/true).ok());
  EXPECT_EQ(folder_.Read("lines.txt"), "first\nsecond\n");
}

TEST_F(LineFileTest, BeginningOfALineIsTakenBackAndNoOtherFollows) {
  ASSERT_TRUE(file_.Append("first\n").ok());
  {
    const FileSizeLimit limit(6 + 3);
    const Status status = file_.Append("second\n");
    EXPECT_EQ(status.code(), StatusCode::kUnavailable);
    EXPECT_EQ(status.message(), path_ + ": cannot be written: only 3 of 7 bytes had room on the disk");
  }
  EXPECT_EQ(file_.Append("third\n").code(), StatusCode::kUnavailable) << "although there is room again";
  EXPECT_EQ(folder_.Read("lines.txt"), "first\n");
}

TEST_F(LineFileTest, LineWithoutAnyRoomIsAnError) {
  ASSERT_TRUE(file_.Append("first\n").ok());
  {
    const FileSizeLimit limit(6);
    const Status status = file_.Append("second\n");
    EXPECT_NE(status.message().find(path_ + ": cannot be written: "), std::string::npos) << status.message();
  }
  EXPECT_EQ(folder_.Read("lines.txt"), "first\n");
}

}  // namespace
}  // namespace haustra
