// For builds without FFmpeg's libraries.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "capture/open_sequence.h"
#include "capture/video_source.h"
#include "tests/capture/temp_folder.h"

namespace haustra {
namespace {

TEST(VideoMissing, OpeningAVideoSaysThatTheBuildHasNone) {
  const TempFolder folder;
  folder.Write("calib.yaml", kSmallCalibration);
  EXPECT_FALSE(HasVideoSupport());
  for (const std::string& path : {folder.Write("a.mov", "x"), folder.path()}) {
    const Result<std::unique_ptr<FrameSource>> source = OpenSequence(path, {});
    EXPECT_EQ(source.code(), StatusCode::kUnavailable);
    EXPECT_THAT(source.status().message(), ::testing::HasSubstr("a.mov: built without video support"));
  }
}

}  // namespace
}  // namespace haustra
