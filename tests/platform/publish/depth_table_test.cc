// The shared memory of keyframes with their depth, from both ends.
#include <gtest/gtest.h>
#include <unistd.h>

#include <atomic>
#include <filesystem>
#include <fstream>
#include <memory>
#include <thread>
#include <vector>

#include "platform/publish/depth_publisher.h"
#include "platform/publish/depth_table_writer.h"
#include "platform/publish/haustra_depth_table.h"

namespace haustra {
namespace {

namespace fs = std::filesystem;

constexpr std::uint32_t kSlots = 5;

haustra_depth_keyframe KeyframeOf(std::uint32_t id, std::uint64_t depth = 0) {
  haustra_depth_keyframe keyframe{};
  keyframe.procedure = 1;
  keyframe.keyframe_id = id;
  keyframe.position_mu[2] = id;
  keyframe.depth = depth;
  return keyframe;
}

class DepthTable : public testing::Test {
 protected:
  DepthTable() : folder_(testing::TempDir() + "haustra_depth_table_" + std::to_string(::getpid())) {
    fs::create_directories(folder_);
  }
  ~DepthTable() override {
    haustra_depth_close(&table_);
    fs::remove_all(folder_);
  }

  std::string path() const { return folder_ + "/depth"; }
  std::unique_ptr<DepthTableWriter> MakeWriter() const {
    auto writer = DepthTableWriter::Create(path(), 0640, static_cast<gid_t>(-1), kSlots);
    EXPECT_TRUE(writer.ok()) << writer.status().message();
    return std::move(*writer);
  }
  void Open() { ASSERT_EQ(haustra_depth_open(&table_, path().c_str()), HAUSTRA_OK); }

  std::string folder_;
  haustra_depth_table table_{};
  haustra_depth_keyframe keyframe_{};
  std::unique_ptr<haustra_depth> depth_ = std::make_unique<haustra_depth>();
};

TEST_F(DepthTable, AKeyframeAndItsDepthAreRead) {
  const auto writer = MakeWriter();
  Open();
  EXPECT_EQ(table_.num_slots, kSlots);
  EXPECT_EQ(haustra_depth_read_keyframe(&table_, 3, &keyframe_), HAUSTRA_NOT_YET);
  const std::uint64_t changes = haustra_depth_num_changes(&table_);
  depth_->num_cells = 13;  // no whole number of words
  for (std::uint16_t i = 0; i < 13; ++i) depth_->codes[i] = static_cast<std::uint16_t>(1000 + i);
  depth_->confidences[12] = 200;
  depth_->bgr[38] = 77;
  const std::uint64_t sequence = writer->PublishDepth(3, *depth_);
  writer->PublishKeyframe(3, KeyframeOf(41, sequence));
  EXPECT_GT(haustra_depth_num_changes(&table_), changes);
  ASSERT_EQ(haustra_depth_read_keyframe(&table_, 3, &keyframe_), HAUSTRA_OK);
  EXPECT_EQ(keyframe_.keyframe_id, 41u);
  EXPECT_EQ(keyframe_.position_mu[2], 41.0);
  *depth_ = haustra_depth{};
  ASSERT_EQ(haustra_depth_read(&table_, 3, keyframe_.depth, depth_.get()), HAUSTRA_OK);
  EXPECT_EQ(depth_->num_cells, 13u);
  EXPECT_EQ(depth_->codes[12], 1012);
  EXPECT_EQ(depth_->confidences[12], 200);
  EXPECT_EQ(depth_->bgr[38], 77);
  // Another depth in its slot is not taken for it.
  writer->PublishDepth(3, *depth_);
  EXPECT_EQ(haustra_depth_read(&table_, 3, keyframe_.depth, depth_.get()), HAUSTRA_OVERRUN);
}

TEST_F(DepthTable, ASlotThatWasClearedHoldsNothing) {
  const auto writer = MakeWriter();
  Open();
  depth_->num_cells = 4;
  depth_->bgr[0] = 99;
  const std::uint64_t sequence = writer->PublishDepth(0, *depth_);
  writer->PublishKeyframe(0, KeyframeOf(1, sequence));
  writer->PublishKeyframe(1, KeyframeOf(2));
  const std::uint64_t changes = haustra_depth_num_changes(&table_);
  writer->Clear(0);
  EXPECT_GT(haustra_depth_num_changes(&table_), changes);
  EXPECT_EQ(haustra_depth_read_keyframe(&table_, 0, &keyframe_), HAUSTRA_NOT_YET);
  EXPECT_EQ(table_.depths[0].record.bgr[0], 0) << "it is a patient's";
  EXPECT_EQ(haustra_depth_read_keyframe(&table_, 1, &keyframe_), HAUSTRA_OK);
}

TEST_F(DepthTable, NothingStaysAfterAWipeOrTheEnd) {
  auto writer = MakeWriter();
  Open();
  haustra_depth_camera camera{};
  EXPECT_EQ(haustra_depth_read_camera(&table_, &camera), HAUSTRA_NOT_YET);
  camera.step_px = 8;
  camera.grid_width = 96;
  camera.grid_height = 72;
  camera.is_scene[6911] = 1;
  const auto fill = [&] {
    depth_->num_cells = HAUSTRA_DEPTH_MAX_CELLS;
    std::fill(std::begin(depth_->bgr), std::end(depth_->bgr), std::uint8_t{9});
    writer->PublishCamera(camera);
    writer->PublishKeyframe(4, KeyframeOf(7, writer->PublishDepth(4, *depth_)));
  };
  const auto expect_nothing = [&] {
    EXPECT_EQ(haustra_depth_read_camera(&table_, &camera), HAUSTRA_NOT_YET);
    EXPECT_EQ(haustra_depth_read_keyframe(&table_, 4, &keyframe_), HAUSTRA_NOT_YET);
    const auto* words = reinterpret_cast<const std::uint64_t*>(table_.header + 1);
    const std::size_t count = (table_.file_bytes - sizeof(haustra_depth_header)) / 8;
    EXPECT_EQ(std::count(words, words + count, 0u), static_cast<std::ptrdiff_t>(count));
  };
  fill();
  haustra_depth_camera read{};
  ASSERT_EQ(haustra_depth_read_camera(&table_, &read), HAUSTRA_OK);
  EXPECT_EQ(read.is_scene[6911], 1);
  writer->Wipe();
  expect_nothing();
  fill();
  writer.reset();
  expect_nothing();
  EXPECT_FALSE(fs::exists(path()));
  EXPECT_EQ(haustra_depth_is_replaced(&table_, path().c_str()), 1);
}

TEST_F(DepthTable, WhatADeadDaemonLeftIsWiped) {
  depth_->num_cells = 1;
  depth_->bgr[0] = 99;
  auto dead = MakeWriter();
  dead->PublishDepth(2, *depth_);
  Open();
  const auto next = MakeWriter();
  EXPECT_EQ(table_.depths[2].record.bgr[0], 0);
  EXPECT_EQ(haustra_depth_is_replaced(&table_, path().c_str()), 1);
}

TEST_F(DepthTable, AnotherProcessWritesIntoTheSameFile) {
  const auto owner = MakeWriter();
  Open();
  const auto worker = DepthTableWriter::Attach(owner->descriptor());
  ASSERT_TRUE(worker.ok()) << worker.status().message();
  EXPECT_EQ((*worker)->num_slots(), kSlots);
  (*worker)->PublishKeyframe(1, KeyframeOf(8));
  ASSERT_EQ(haustra_depth_read_keyframe(&table_, 1, &keyframe_), HAUSTRA_OK);
  const std::uint64_t sequence = keyframe_.sequence;
  // The numbers go on where another worker has stopped.
  const auto second = DepthTableWriter::Attach(owner->descriptor());
  (*second)->PublishKeyframe(1, KeyframeOf(8));
  ASSERT_EQ(haustra_depth_read_keyframe(&table_, 1, &keyframe_), HAUSTRA_OK);
  EXPECT_GT(keyframe_.sequence, sequence);
}

TEST_F(DepthTable, FilesThatAreSomethingElseAreRefused) {
  EXPECT_EQ(haustra_depth_open(&table_, path().c_str()), HAUSTRA_NO_FILE);
  std::ofstream(path()) << "not a table, but long enough to be looked at";
  EXPECT_EQ(haustra_depth_open(&table_, path().c_str()), HAUSTRA_NOT_A_RING);
  fs::remove(path());
  const auto writer = MakeWriter();
  std::string bytes(haustra_depth_file_bytes(kSlots), '\0');
  std::ifstream(path(), std::ios::binary).read(bytes.data(), static_cast<std::streamsize>(bytes.size()));
  const auto open_changed = [&](std::size_t at, char value, std::size_t length) {
    std::string changed = bytes.substr(0, length);
    changed[at] = value;
    std::ofstream(folder_ + "/other", std::ios::binary) << changed;
    return haustra_depth_open(&table_, (folder_ + "/other").c_str());
  };
  EXPECT_EQ(open_changed(0, bytes[0], bytes.size()), HAUSTRA_OK);
  haustra_depth_close(&table_);
  EXPECT_EQ(open_changed(0, 'x', bytes.size()), HAUSTRA_NOT_A_RING);
  EXPECT_EQ(open_changed(offsetof(haustra_depth_header, version), 9, bytes.size()), HAUSTRA_OTHER_VERSION);
  EXPECT_EQ(open_changed(offsetof(haustra_depth_header, num_slots), 99, bytes.size()), HAUSTRA_NOT_A_RING);
  EXPECT_EQ(open_changed(0, bytes[0], bytes.size() - 1), HAUSTRA_NOT_A_RING) << "cut short";
}

// What is torn would be of two keyframes.
TEST_F(DepthTable, ReadersGetWholeRecordsWhileTheyAreWritten) {
  const auto writer = MakeWriter();
  Open();
  std::atomic<bool> stop{false};
  std::thread thread([&] {
    const auto depth = std::make_unique<haustra_depth>();
    depth->num_cells = HAUSTRA_DEPTH_MAX_CELLS;
    for (std::uint32_t id = 1; !stop; ++id) {
      std::fill(std::begin(depth->codes), std::end(depth->codes), static_cast<std::uint16_t>(id));
      writer->PublishKeyframe(0, KeyframeOf(id, writer->PublishDepth(0, *depth)));
    }
  });
  int num_read = 0;
  for (int i = 0; i < 20'000'000 && num_read < 200; ++i) {
    if (haustra_depth_read_keyframe(&table_, 0, &keyframe_) != HAUSTRA_OK) continue;
    ASSERT_EQ(keyframe_.position_mu[2], keyframe_.keyframe_id);
    if (haustra_depth_read(&table_, 0, keyframe_.depth, depth_.get()) != HAUSTRA_OK) continue;
    ++num_read;
    for (const std::uint16_t code : depth_->codes) {
      ASSERT_EQ(code, static_cast<std::uint16_t>(keyframe_.keyframe_id));
    }
  }
  stop = true;
  thread.join();
  EXPECT_GT(num_read, 0);
}

TEST(PublishedCells, AreTheFewestThatFit) {
  EXPECT_EQ(PublishedCellStep(96, 72), 1);
  EXPECT_EQ(PublishedCellStep(97, 72), 2);
  EXPECT_EQ(PublishedCellStep(180, 135), 2);  // 720x540 at 4 pixels
  EXPECT_EQ(PublishedCellStep(480, 270), 5);
}

// The inverse range of a plane is linear over the picture where rays are scaled to unit depth; along the rays it is so
// within one part in a thousand over a few cells.
TEST(PublishedCells, HaveThePlanesDepthInTheirMiddle) {
  const auto record = std::make_unique<haustra_depth>();
  for (const int step : {1, 2, 3, 4}) {
    DepthMap depth(24, 12);
    depth.Clear(0.1);
    std::vector<std::uint8_t> bgr(3 * 24 * 12);
    const auto inverse = [](double x, double y) { return 0.5 + 0.01 * x + 0.02 * y; };
    for (int cell = 0; cell < depth.num_cells(); ++cell) {
      depth.Set(cell, inverse(cell % 24, cell / 24), 100 + cell % 24);
      for (int c = 0; c < 3; ++c) bgr[3 * cell + c] = static_cast<std::uint8_t>(10 * c + cell % 24);
    }
    FillDepth(depth, bgr, step, record.get());
    const int width = 24 / step, height = 12 / step;
    ASSERT_EQ(record->num_cells, static_cast<std::uint64_t>(width * height));
    for (int y = 0; y < height; ++y) {
      for (int x = 0; x < width; ++x) {
        const double middle_x = x * step + 0.5 * (step - 1), middle_y = y * step + 0.5 * (step - 1);
        EXPECT_NEAR(record->codes[y * width + x] * depth.unit(), inverse(middle_x, middle_y), depth.unit()) << step;
        EXPECT_EQ(record->confidences[y * width + x], 100 + x * step + (step - 1) / 2) << "of the least sure";
        EXPECT_NEAR(record->bgr[3 * (y * width + x) + 2], 20 + middle_x, 0.6);
      }
    }
  }
}

TEST(PublishedCells, AreNotKnownAtAnEdgeOrBesideAHole) {
  const auto record = std::make_unique<haustra_depth>();
  DepthMap depth(4, 2);
  depth.Clear(0.1);
  const std::vector<std::uint8_t> bgr(3 * 4 * 2);
  for (int cell = 0; cell < depth.num_cells(); ++cell) depth.Set(cell, 1.0, 255);
  FillDepth(depth, bgr, 2, record.get());
  EXPECT_NE(record->codes[0], DepthMap::kNoDepth);
  EXPECT_NE(record->codes[1], DepthMap::kNoDepth);
  depth.Set(0, 1.2, 255);
  depth.Erase(7);
  FillDepth(depth, bgr, 2, record.get());
  EXPECT_EQ(record->codes[0], DepthMap::kNoDepth);
  EXPECT_EQ(record->codes[1], DepthMap::kNoDepth);
}

}  // namespace
}  // namespace haustra
