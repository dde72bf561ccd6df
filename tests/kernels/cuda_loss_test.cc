// A device that is lost for good while it works. What a kernel's fault leaves of a process is what a loss leaves: each
// test breaks a process of its own.
#include <gtest/gtest.h>
#include <unistd.h>

#include <cstdio>
#include <cstdlib>
#include <memory>
#include <string>
#include <vector>

#include "kernels/cuda/cuda_vision_device.h"
#include "tests/kernels/blob_scene.h"
#include "tests/kernels/cuda_device_present.h"
#include "tests/kernels/cuda_fault.h"

namespace haustra::testing {
namespace {

constexpr int kSide = 320;
constexpr int kMaxFeatures = 500;
constexpr std::int64_t kBusyMs = 300;
constexpr unsigned kHangLimitS = 120;

VisionPlan LossPlan() {
  VisionPlan plan;
  plan.max_width_px = kSide;
  plan.max_height_px = kSide;
  plan.max_features = kMaxFeatures;
  plan.max_feature_sets = 8;
  plan.max_match_list = kMaxFeatures;
  return plan;
}

ExtractOptions LossOptions() {
  ExtractOptions options;
  options.num_features = kMaxFeatures;
  return options;
}

// Of a process that is to end: says what was wrong, and with which exit code it ends.
class Findings {
 public:
  void Expect(bool is_so, const char* what) {
    if (is_so) return;
    std::fprintf(stderr, "not so: %s\n", what);
    ++num_;
  }
  void ExpectLost(const Status& status, const char* what) {
    Expect(status.code() == StatusCode::kUnavailable, (std::string(what) + ": " + status.ToString()).c_str());
  }
  // As ExpectLost, and nothing was put on the heap for it.
  void ExpectLostWithoutWords(const Status& status, const char* what) {
    ExpectLost(status, what);
    Expect(status.message().empty(), what);
  }
  int exit_code() const { return num_ == 0 ? 0 : 1; }

 private:
  int num_ = 0;
};

// A camera's thread, as short as it can be: one frame into a set of its own.
class Frames {
 public:
  explicit Frames(CudaVisionDevice& device)
      : device_(device), picture_(Render(RandomBlobs(600, kSide, kSide, 20.0, 40.0, 9), kSide, kSide, 120.0)) {}

  ExtractRequest Request() {
    set_ = device_.CreateFeatureSet().value();
    return {picture_.view(), set_, keypoints_, &count_};
  }
  FeatureSetHandle set() const { return set_; }
  std::int32_t count() const { return count_; }

 private:
  CudaVisionDevice& device_;
  const Picture picture_;
  std::vector<Keypoint> keypoints_ = std::vector<Keypoint>(kMaxFeatures);
  FeatureSetHandle set_;
  std::int32_t count_ = 0;
};

// Nothing but an exit with this answer is right: a hang ends by SIGALRM, a crash by its signal.
int WorkOnOneFrame() {
  ::alarm(kHangLimitS);
  Findings findings;
  auto device = CreateCudaVisionDevice(LossPlan(), LossOptions());
  findings.Expect(device.ok(), device.status().ToString().c_str());
  if (!device.ok()) return findings.exit_code();
  Frames frames(**device);
  findings.Expect(ExtractAndWait(**device, Lane::kTracking, frames.Request()).ok(), "a frame is worked on");
  findings.Expect(frames.count() > 50, "features are found");
  return findings.exit_code();
}

int LoseTheDeviceInTheMiddleOfAFrame(CudaFault fault) {
  ::alarm(kHangLimitS);
  Findings findings;
  {
    auto device = CreateCudaVisionDevice(LossPlan(), LossOptions()).value();
    Frames frames(*device);
    findings.Expect(ExtractAndWait(*device, Lane::kTracking, frames.Request()).ok(), "a frame before the loss");
    const FeatureSetHandle set = frames.set();
    std::vector<std::uint8_t> descriptors(static_cast<std::size_t>(kMaxFeatures) * kDescriptorBytes);
    findings.Expect(device->ReadDescriptors(set, descriptors).ok(), "its descriptors");

    std::vector<Match> matches(kMaxFeatures);
    std::int32_t num_matches = 0;
    MatchRequest match;
    match.query = match.train = DescriptorList::Whole(set);
    match.matches = matches;
    match.num_matches = &num_matches;
    const std::int32_t num_free = device->num_free_feature_sets();
    findings.Expect(QueueCudaFault(fault, kBusyMs).ok(), "the fault is queued");
    // Queued while the device lives, and never done.
    const Result<Ticket> frame = device->EnqueueExtract(Lane::kTracking, frames.Request());
    const Result<Ticket> mapping = device->EnqueueMatch(Lane::kBackground, match);
    findings.Expect(frame.ok() && mapping.ok(), "work is queued before the fault");
    if (!frame.ok() || !mapping.ok()) return findings.exit_code();
    findings.ExpectLost(device->Wait(*frame, kNoDeadline), "the wait without a deadline ends");

    // For good, on both lanes, for every request, and at once.
    findings.ExpectLostWithoutWords(device->Wait(*frame, kNoDeadline), "another wait for the frame");
    findings.ExpectLostWithoutWords(device->Wait(*mapping, kNoDeadline), "the wait of the other lane");
    for (int i = 0; i < 3; ++i) {
      const ExtractRequest request = frames.Request();
      findings.ExpectLostWithoutWords(ExtractAndWait(*device, Lane::kTracking, request), "another frame");
      device->ReleaseFeatureSet(frames.set());
      findings.ExpectLostWithoutWords(MatchAndWait(*device, Lane::kTracking, match), "matching");
      findings.ExpectLostWithoutWords(MatchAndWait(*device, Lane::kBackground, match), "matching of mapping");
      findings.ExpectLostWithoutWords(device->ReadDescriptors(set, descriptors), "reading of descriptors");
    }
    findings.ExpectLostWithoutWords(device->SetStaticMask({}), "the mask");
    findings.Expect(device->num_free_feature_sets() >= num_free - 1, "sets are given back after a loss, too");
    // The process has lost it, not the device alone: whoever goes on needs another process.
    findings.ExpectLost(CreateCudaVisionDevice(LossPlan(), LossOptions()).status(), "a new device in this process");
  }  // goes without a hang and without a crash
  return findings.exit_code();
}

class CudaLoss : public ::testing::TestWithParam<CudaFault> {
 protected:
  void SetUp() override {
    // The process that is broken starts anew: a context of CUDA does not outlive a fork.
    ::testing::FLAGS_gtest_death_test_style = "threadsafe";
    if (!IsCudaDevicePresent()) GTEST_SKIP() << NoCudaDeviceReason();
  }
};

TEST_P(CudaLoss, IsAnsweredForGoodAndEndsWithItsProcess) {
  EXPECT_EXIT(std::exit(LoseTheDeviceInTheMiddleOfAFrame(GetParam())), ::testing::ExitedWithCode(0), "");
  EXPECT_EXIT(std::exit(WorkOnOneFrame()), ::testing::ExitedWithCode(0), "") << "a new process has the device";
  EXPECT_EQ(WorkOnOneFrame(), 0) << "a process that was there has it, too";
  ::alarm(0);
}

INSTANTIATE_TEST_SUITE_P(Faults, CudaLoss, ::testing::Values(CudaFault::kTrap, CudaFault::kIllegalAddress),
                         [](const ::testing::TestParamInfo<CudaFault>& test) {
                           return std::string(test.param == CudaFault::kTrap ? "Trap" : "IllegalAddress");
                         });

}  // namespace
}  // namespace haustra::testing
