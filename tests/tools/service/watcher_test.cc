#include "tools/service/watcher.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cerrno>
#include <filesystem>
#include <memory>
#include <string>

#include "hal/core/errno_text.h"
#include "platform/publish/pose_ring_writer.h"
#include "tests/tools/evaluate/text_folder.h"

namespace haustra {
namespace {

using ::testing::HasSubstr;

std::unique_ptr<PoseRingWriter> MakeWriter(const evaluate::TextFolder& folder) {
  return PoseRingWriter::Create(folder.At("poses"), 0600, static_cast<gid_t>(-1)).value();
}

std::string PageOf(Watcher& watcher) { return WatchPage(watcher.Look(), 1000); }

TEST(Watcher, SaysWhyARingCannotBeRead) {
  const evaluate::TextFolder folder;
  Watcher watcher(folder.path());
  EXPECT_THAT(PageOf(watcher), HasSubstr("haustra    no daemon\n"));

  haustra_ring_header header{};
  header.magic = HAUSTRA_RING_MAGIC;
  header.version = HAUSTRA_RING_VERSION + 1;
  folder.Write("poses", std::string(reinterpret_cast<const char*>(&header), sizeof header));
  EXPECT_THAT(PageOf(watcher), HasSubstr("poses was written by another version of haustrad"));
  EXPECT_THAT(WatchLine(watcher.Look()), HasSubstr("another version"));

  folder.Write("poses", std::string(500, 'x'));
  EXPECT_THAT(PageOf(watcher), HasSubstr("poses is not what haustrad writes."));

  folder.Remove("poses");
  std::filesystem::create_symlink("poses", folder.At("poses"));
  EXPECT_THAT(PageOf(watcher), HasSubstr("poses: " + ErrnoText(ELOOP)));

  folder.Remove("poses");
  EXPECT_THAT(PageOf(watcher), HasSubstr("haustra    no daemon\n"));
}

TEST(Watcher, WhatTheSocketSaidStaysUntilItIsAskedAgain) {
  const evaluate::TextFolder folder;
  Watcher watcher(folder.path());
  const std::string said = "control    " + folder.At("status") + ": no such socket";
  EXPECT_THAT(PageOf(watcher), HasSubstr(said));
  EXPECT_THAT(PageOf(watcher), HasSubstr(said));
  // Nor does a ring that comes take it away.
  const std::unique_ptr<PoseRingWriter> writer = MakeWriter(folder);
  EXPECT_THAT(PageOf(watcher), HasSubstr(said));
  EXPECT_TRUE(watcher.Look().is_connected);
}

TEST(Watcher, ARingThatIsReplacedTakesItsPosesWithIt) {
  const evaluate::TextFolder folder;
  const std::unique_ptr<PoseRingWriter> before = MakeWriter(folder);
  before->PublishPose(haustra_pose{});
  before->PublishEvent(haustra_event{});
  Watcher watcher(folder.path());
  EXPECT_TRUE(watcher.Look().has_pose);
  EXPECT_EQ(watcher.Look().events.size(), 1u);
  const std::unique_ptr<PoseRingWriter> after = MakeWriter(folder);
  after->PublishEvent(haustra_event{});
  const WatchModel& model = watcher.Look();
  EXPECT_TRUE(model.is_connected);
  EXPECT_FALSE(model.has_pose);
  EXPECT_TRUE(model.latencies_ms.empty());
  EXPECT_EQ(model.events.size(), 1u);
  EXPECT_THAT(model.control_error, HasSubstr("no such socket"));
}

}  // namespace
}  // namespace haustra
