// The shared memory of small pictures and matched points, from both ends.
#include <gtest/gtest.h>
#include <sys/stat.h>

#include <atomic>
#include <filesystem>
#include <fstream>
#include <memory>
#include <thread>
#include <vector>

#include "platform/publish/haustra_pose_ring.h"
#include "platform/publish/haustra_view_ring.h"
#include "platform/publish/view_ring_writer.h"

namespace haustra {
namespace {

namespace fs = std::filesystem;

class ViewRing : public testing::Test {
 protected:
  ViewRing() : folder_(testing::TempDir() + "haustra_view_ring_" + std::to_string(::getpid())) {
    fs::create_directories(folder_);
  }
  ~ViewRing() override { fs::remove_all(folder_); }

  std::string path() const { return folder_ + "/view"; }
  std::unique_ptr<ViewRingWriter> MakeWriter() const {
    auto writer = ViewRingWriter::Create(path(), 0640, static_cast<gid_t>(-1));
    EXPECT_TRUE(writer.ok()) << writer.status().message();
    return std::move(*writer);
  }
  // A picture whose pixels all have the value of its number.
  static Frame GreyFrame(std::uint32_t number, int width, int height, std::vector<std::uint8_t>* pixels) {
    pixels->assign(static_cast<std::size_t>(width) * static_cast<std::size_t>(height),
                   static_cast<std::uint8_t>(number));
    Frame frame;
    frame.index = number;
    frame.image = {pixels->data(), width, height, width, PixelFormat::kGrey8};
    return frame;
  }

  std::string folder_;
  std::unique_ptr<haustra_picture> picture_ = std::make_unique<haustra_picture>();
  std::unique_ptr<haustra_matches> matches_ = std::make_unique<haustra_matches>();
  std::vector<std::uint8_t> pixels_;
};

TEST_F(ViewRing, APictureIsThinnedToFit) {
  const auto writer = MakeWriter();
  haustra_view view;
  ASSERT_EQ(haustra_view_open(&view, path().c_str()), HAUSTRA_OK);
  EXPECT_EQ(haustra_view_latest_picture(&view, picture_.get()), HAUSTRA_NOT_YET);
  struct Size {
    int width, height;
    std::uint32_t step, shown_width, shown_height;
  };
  for (const Size& size : {Size{1, 1, 1, 1, 1}, Size{480, 480, 1, 480, 480}, Size{481, 20, 2, 241, 10},
                           Size{720, 540, 2, 360, 270}, Size{1920, 1080, 4, 480, 270}}) {
    writer->PublishPicture(GreyFrame(7, size.width, size.height, &pixels_), 3);
    ASSERT_EQ(haustra_view_latest_picture(&view, picture_.get()), HAUSTRA_OK);
    EXPECT_EQ(picture_->step, size.step);
    EXPECT_EQ(picture_->width, size.shown_width);
    EXPECT_EQ(picture_->height, size.shown_height);
    EXPECT_EQ(picture_->num_channels, 1u);
    EXPECT_EQ(picture_->frame_index, 7u);
    EXPECT_EQ(picture_->procedure, 3u);
    EXPECT_EQ(picture_->pixels[size.shown_width * size.shown_height - 1], 7);
  }
  haustra_view_close(&view);
}

TEST_F(ViewRing, ColoursComeFromEveryFormat) {
  const auto writer = MakeWriter();
  haustra_view view;
  ASSERT_EQ(haustra_view_open(&view, path().c_str()), HAUSTRA_OK);
  // Pure red, by BT.601 in full range: Y 76, Cb 85, Cr 255.
  const std::vector<std::pair<PixelFormat, std::vector<std::uint8_t>>> pictures = {
      {PixelFormat::kBgr8, {0, 0, 254, 0, 0, 254, 0, 0, 254, 0, 0, 254}},
      {PixelFormat::kNv12, {76, 76, 76, 76, 85, 255}},
      {PixelFormat::kYuyv, {76, 85, 76, 255, 76, 85, 76, 255}},
      {PixelFormat::kUyvy, {85, 76, 255, 76, 85, 76, 255, 76}}};
  for (const auto& [format, bytes] : pictures) {
    Frame frame;
    frame.image = {bytes.data(), 2, 2, 2 * BytesPerPixel(format), format};
    writer->PublishPicture(frame, 1);
    ASSERT_EQ(haustra_view_latest_picture(&view, picture_.get()), HAUSTRA_OK);
    EXPECT_EQ(picture_->num_channels, 3u);
    for (int i = 0; i < 4; ++i) {
      EXPECT_NEAR(picture_->pixels[3 * i], 0, 1) << static_cast<int>(format);
      EXPECT_NEAR(picture_->pixels[3 * i + 1], 0, 1) << static_cast<int>(format);
      EXPECT_NEAR(picture_->pixels[3 * i + 2], 254, 1) << static_cast<int>(format);
    }
  }
  haustra_view_close(&view);
}

TEST_F(ViewRing, MatchesBelongToTheirFrame) {
  const auto writer = MakeWriter();
  haustra_view view;
  ASSERT_EQ(haustra_view_open(&view, path().c_str()), HAUSTRA_OK);
  EXPECT_EQ(haustra_view_matches_of(&view, 5, 1, matches_.get()), HAUSTRA_NOT_YET);
  const std::vector<haustra_match> points(HAUSTRA_MATCHES_POINTS + 5, haustra_match{1.5F, 2.5F});
  for (const std::uint64_t frame : {4, 5, 7}) writer->PublishMatches(frame, 1, points, 2000);
  ASSERT_EQ(haustra_view_matches_of(&view, 5, 1, matches_.get()), HAUSTRA_OK);
  EXPECT_EQ(matches_->num_points, HAUSTRA_MATCHES_POINTS);
  EXPECT_EQ(matches_->num_matched, 2000u);
  EXPECT_EQ(matches_->points[HAUSTRA_MATCHES_POINTS - 1].y_px, 2.5F);
  EXPECT_EQ(haustra_view_matches_of(&view, 6, 1, matches_.get()), HAUSTRA_OVERRUN) << "it was dropped";
  EXPECT_EQ(haustra_view_matches_of(&view, 8, 1, matches_.get()), HAUSTRA_NOT_YET);
  EXPECT_EQ(haustra_view_matches_of(&view, 5, 2, matches_.get()), HAUSTRA_NOT_YET) << "of another procedure";
  for (std::uint64_t frame = 8; frame < 8 + HAUSTRA_MATCHES_SLOTS; ++frame) writer->PublishMatches(frame, 1, {}, 0);
  EXPECT_EQ(haustra_view_matches_of(&view, 5, 1, matches_.get()), HAUSTRA_OVERRUN);
  haustra_view_close(&view);
}

TEST_F(ViewRing, AnotherProcessWritesIntoTheSameFile) {
  const auto owner = MakeWriter();
  haustra_view view;
  ASSERT_EQ(haustra_view_open(&view, path().c_str()), HAUSTRA_OK);
  {
    const auto attached = ViewRingWriter::Attach(owner->descriptor());
    ASSERT_TRUE(attached.ok()) << attached.status().message();
    (*attached)->PublishPicture(GreyFrame(9, 8, 8, &pixels_), 1);
  }
  ASSERT_EQ(haustra_view_latest_picture(&view, picture_.get()), HAUSTRA_OK);
  EXPECT_EQ(picture_->frame_index, 9u);
  EXPECT_EQ(ViewRingWriter::Attach(-1).code(), StatusCode::kDataLoss);
  haustra_view_close(&view);
}

TEST_F(ViewRing, PicturesAreWholeWhileTheyAreReplaced) {
  const auto writer = MakeWriter();
  haustra_view view;
  ASSERT_EQ(haustra_view_open(&view, path().c_str()), HAUSTRA_OK);
  std::atomic<bool> is_over{false};
  std::thread publisher([&] {
    for (std::uint32_t i = 1; i <= 400; ++i) writer->PublishPicture(GreyFrame(i, 300, 200, &pixels_), 1);
    is_over = true;
  });
  int num_seen = 0;
  while (!is_over) {
    if (haustra_view_latest_picture(&view, picture_.get()) != HAUSTRA_OK) continue;
    ++num_seen;
    const auto expected = static_cast<std::uint8_t>(picture_->frame_index);
    for (const int at : {0, 29999, 59999}) ASSERT_EQ(picture_->pixels[at], expected);
  }
  publisher.join();
  EXPECT_GT(num_seen, 0);
  haustra_view_close(&view);
}

TEST_F(ViewRing, NothingIsLeftOfAProcedure) {
  auto writer = MakeWriter();
  haustra_view view;
  ASSERT_EQ(haustra_view_open(&view, path().c_str()), HAUSTRA_OK);
  const auto publish = [&] {
    writer->PublishPicture(GreyFrame(0xab, 300, 200, &pixels_), 1);
    writer->PublishMatches(1, 1, std::vector<haustra_match>{{3.0F, 4.0F}}, 1);
  };
  const auto holds_nothing = [&] {
    for (const haustra_picture_slot& slot : view.file->pictures) {
      for (const std::uint8_t pixel : slot.record.pixels) {
        if (pixel != 0) return false;
      }
    }
    for (const haustra_matches_slot& slot : view.file->matches) {
      if (slot.record.num_points != 0 || slot.record.points[0].x_px != 0.0F) return false;
    }
    return true;
  };
  publish();
  EXPECT_FALSE(holds_nothing());
  writer->Wipe();
  EXPECT_TRUE(holds_nothing());
  EXPECT_EQ(haustra_view_latest_picture(&view, picture_.get()), HAUSTRA_NOT_YET);
  // Nor of a daemon that stops, or that died and is followed by the next.
  publish();
  const auto next = MakeWriter();
  EXPECT_TRUE(holds_nothing());
  EXPECT_EQ(haustra_view_is_replaced(&view, path().c_str()), 1);
  haustra_view_close(&view);
}

TEST_F(ViewRing, OtherFilesAreRefused) {
  haustra_view view;
  EXPECT_EQ(haustra_view_open(&view, path().c_str()), HAUSTRA_NO_FILE);
  std::ofstream(path()) << std::string(1000, 'x');
  EXPECT_EQ(haustra_view_open(&view, path().c_str()), HAUSTRA_NOT_A_RING);
  EXPECT_EQ(ViewRingWriter::Create(folder_ + "/none/view", 0640, static_cast<gid_t>(-1)).code(), StatusCode::kNotFound);
  const auto writer = MakeWriter();
  struct stat info {};
  ASSERT_EQ(::stat(path().c_str(), &info), 0);
  EXPECT_EQ(info.st_mode & 0777, 0640u);
}

}  // namespace
}  // namespace haustra
