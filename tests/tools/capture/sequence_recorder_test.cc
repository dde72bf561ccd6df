#include "tools/capture/sequence_recorder.h"

#include <gtest/gtest.h>

#include <filesystem>
#include <fstream>
#include <functional>
#include <thread>

#include "capture/calibration_reader.h"
#include "capture/dataset/sequence_listing.h"
#include "capture/open_sequence.h"
#include "tests/capture/temp_folder.h"
#include "tests/tools/command/file_size_limit.h"

namespace haustra {
namespace {

using std::chrono::milliseconds;

class SequenceRecorderTest : public testing::Test {
 protected:
  // Two frames, of which the first comes from the camera as a JPEG file; between them one was lost.
  Status Record(const SequenceRecorder::Options& options) const {
    HAUSTRA_ASSIGN(const std::unique_ptr<SequenceRecorder> recorder, Start(options));
    HAUSTRA_ASSIGN(const SequenceRecorder::Summary summary, recorder->Finish());
    EXPECT_EQ(summary.num_written, 2u);
    return Status::Ok();
  }
  Result<std::unique_ptr<SequenceRecorder>> Start(const SequenceRecorder::Options& options) const {
    const Result<CameraCalibration> calibration = ReadCalibration(folder_.Path("calib.yaml"));
    EXPECT_TRUE(calibration.ok());
    HAUSTRA_ASSIGN(std::unique_ptr<SequenceRecorder> recorder,
                   SequenceRecorder::Create(out_, options, &*calibration, {}));
    const Image pixels = FlatImage(64, 48, PixelFormat::kGrey8, 200);
    const std::string jpeg = folder_.Read("camera.jpg");
    const std::vector<std::uint8_t> encoded(jpeg.begin(), jpeg.end());
    EXPECT_TRUE(recorder->Add({4, TimePoint(milliseconds(5000)), pixels.view()}, encoded));
    EXPECT_TRUE(recorder->Add({6, TimePoint(milliseconds(5080)), pixels.view()}, {}));
    return recorder;
  }
  void SetUp() override {
    folder_.Write("calib.yaml", kSmallCalibration);
    folder_.WriteImage("camera.jpg", FlatImage(64, 48, PixelFormat::kGrey8, 90));
  }

  TempFolder folder_;
  const std::string out_ = folder_.Path("recording");
};

TEST_F(SequenceRecorderTest, WhatIsRecordedIsASequenceWithTheFramesOfTheCamera) {
  const Status status = Record({});
  ASSERT_TRUE(status.ok()) << status.message();
  EXPECT_EQ(folder_.Read("recording/times.txt"), "0.000000000\n0.080000000\n");
  EXPECT_EQ(folder_.Read("recording/frames/000004.jpg"), folder_.Read("camera.jpg"));
  EXPECT_FALSE(IsCutRecording(out_));

  Result<std::unique_ptr<FrameSource>> source = OpenSequence(out_, {});
  ASSERT_TRUE(source.ok()) << source.status().message();
  ASSERT_EQ((*source)->num_frames(), 2u);
  EXPECT_EQ((*source)->FrameName(1), "000006.png");
  ASSERT_TRUE((*source)->Next(kNoDeadline).ok());
  const Result<Frame> second = (*source)->Next(kNoDeadline);
  ASSERT_TRUE(second.ok());
  EXPECT_EQ(second->image.row(0)[0], 200);
}

TEST_F(SequenceRecorderTest, EarlierRecordingIsKeptUnlessOverwriteIsSaid) {
  folder_.Write("recording/times.txt", "of before\n");
  EXPECT_EQ(Record({}).code(), StatusCode::kFailedPrecondition);
  EXPECT_EQ(folder_.Read("recording/times.txt"), "of before\n");
  SequenceRecorder::Options options;
  options.overwrite = true;
  const Status status = Record(options);
  EXPECT_TRUE(status.ok()) << status.message();
  EXPECT_NE(folder_.Read("recording/times.txt"), "of before\n");
}

// What is on the disk at the moment of a kill: nobody came to Finish.
TEST_F(SequenceRecorderTest, RecordingThatIsCutCanBeReadUpToThere) {
  {
    const Result<std::unique_ptr<SequenceRecorder>> recorder = Start({});
    ASSERT_TRUE(recorder.ok()) << recorder.status().message();
  }
  EXPECT_FALSE(std::filesystem::exists(out_ + "/times.txt"));
  EXPECT_TRUE(IsCutRecording(out_));
  // Of these no time was stored.
  folder_.Write("recording/frames/000007.png", "half a picture");
  std::ofstream(out_ + "/times.recording", std::ios::app) << "000007.png 5.";

  Result<std::unique_ptr<FrameSource>> source = OpenSequence(out_, {});
  ASSERT_TRUE(source.ok()) << source.status().message();
  ASSERT_EQ((*source)->num_frames(), 2u);
  const Result<Frame> first = (*source)->Next(kNoDeadline);
  ASSERT_TRUE(first.ok());
  EXPECT_EQ(first->timestamp, TimePoint(milliseconds(0)));
  const Result<Frame> second = (*source)->Next(kNoDeadline);
  ASSERT_TRUE(second.ok());
  EXPECT_EQ(second->timestamp, TimePoint(milliseconds(80)));
  EXPECT_EQ((*source)->Next(kNoDeadline).code(), StatusCode::kNotFound);
}

TEST_F(SequenceRecorderTest, CameraWithoutAFrameLeavesTheEarlierRecording) {
  ASSERT_TRUE(Record({}).ok());
  SequenceRecorder::Options options;
  options.overwrite = true;
  const Result<std::unique_ptr<SequenceRecorder>> recorder = SequenceRecorder::Create(out_, options, nullptr, {});
  ASSERT_TRUE(recorder.ok());
  EXPECT_EQ((*recorder)->Finish().code(), StatusCode::kUnavailable);
  EXPECT_EQ(folder_.Read("recording/times.txt"), "0.000000000\n0.080000000\n");
  EXPECT_FALSE(IsCutRecording(out_));
}

TEST_F(SequenceRecorderTest, FrameThatCannotBeWrittenIsNamed) {
  Result<std::unique_ptr<SequenceRecorder>> recorder = SequenceRecorder::Create(out_, {}, nullptr, {});
  ASSERT_TRUE(recorder.ok());
  std::filesystem::remove_all(out_ + "/frames");
  const std::vector<std::uint8_t> encoded(3, 1);
  EXPECT_TRUE((*recorder)->Add({0, TimePoint{}, {}}, encoded));
  const Result<SequenceRecorder::Summary> summary = (*recorder)->Finish();
  EXPECT_EQ(summary.code(), StatusCode::kNotFound);
  EXPECT_NE(summary.status().message().find("frames/000000.jpg: its folder does not exist"), std::string::npos)
      << summary.status().message();
}

// The disk is full for a moment, and then the machine goes off.
TEST_F(SequenceRecorderTest, RecordingStaysReadableAfterATimeThatWasWrittenInPart) {
  Result<std::unique_ptr<SequenceRecorder>> recorder = Start({});
  ASSERT_TRUE(recorder.ok());
  const auto wait_for = [](const std::function<bool()>& is_so) {
    while (!is_so()) std::this_thread::sleep_for(milliseconds(1));
  };
  wait_for([&] { return std::filesystem::file_size(out_ + "/times.recording") == 46; });
  const std::vector<std::uint8_t> encoded(3, 1);
  {
    const FileSizeLimit limit(46 + 15);
    EXPECT_TRUE((*recorder)->Add({7, TimePoint(milliseconds(5120)), {}}, encoded));
    wait_for([&] { return !(*recorder)->status().ok(); });
  }
  EXPECT_FALSE((*recorder)->Add({8, TimePoint(milliseconds(5160)), {}}, encoded)) << "after an error";
  recorder->reset();
  const std::string times = folder_.Read("recording/times.recording");
  EXPECT_EQ(times.size(), 46u) << times;
  EXPECT_FALSE(std::filesystem::exists(out_ + "/frames/000007.jpg"));
  Result<std::unique_ptr<FrameSource>> source = OpenSequence(out_, {});
  ASSERT_TRUE(source.ok()) << source.status().message();
  EXPECT_EQ((*source)->num_frames(), 2u);
}

TEST_F(SequenceRecorderTest, TimeThatIsWrittenInPartIsReportedAsSuch) {
  Result<std::unique_ptr<SequenceRecorder>> recorder = SequenceRecorder::Create(out_, {}, nullptr, {});
  ASSERT_TRUE(recorder.ok());
  bool is_taken = false;
  const Result<SequenceRecorder::Summary> summary = [&] {
    const FileSizeLimit limit(20);
    const std::vector<std::uint8_t> encoded(3, 1);
    is_taken = (*recorder)->Add({0, TimePoint{}, {}}, encoded);
    return (*recorder)->Finish();
  }();
  EXPECT_TRUE(is_taken);
  EXPECT_EQ(summary.code(), StatusCode::kUnavailable);
  EXPECT_NE(summary.status().message().find("times.recording: cannot be written: only 20 of 23 bytes"),
            std::string::npos)
      << summary.status().message();
}

}  // namespace
}  // namespace haustra
