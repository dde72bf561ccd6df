// Files that were cut short or have bytes changed: any answer is fine, a crash or a hang is not, and what is accepted
// must be a usable calibration or trajectory.
#include <cmath>
#include <functional>
#include <limits>
#include <random>

#include <gtest/gtest.h>

#include "capture/calibration_reader.h"
#include "capture/ground_truth.h"
#include "capture/image_folder_source.h"
#include "tests/capture/temp_folder.h"

namespace haustra {
namespace {

constexpr std::string_view kOwn =
    "model: ocamcalib\nwidth_px: 1350\nheight_px: 1080\nrate_hz: 29.97\nintrinsics: {cx: 678.5, cy: 542.9}\n"
    "coefficients:\n  a0: 769.2\n  a2: -8.1e-4\n  a3: 6.2e-7\n  a4: -1.2e-9\n  c: 0.9999\n  d: 0.0028\n  e: -0.0029\n";
constexpr std::string_view kWholeOpencv =
    "%YAML:1.0\n---\nmodel: fisheye\nimage_width: 640\nimage_height: 480\ncamera_matrix: !!opencv-matrix\n   rows: 3\n"
    "   cols: 3\n   dt: d\n   data: [ 500., 0., 319.5, 0., 501., 239.5, 0., 0., 1. ]\n"
    "distortion_coefficients: !!opencv-matrix\n   rows: 4\n   cols: 1\n   dt: d\n   data: [ -0.1, 0.02, -3.0e-03, "
    "4.0e-04 ]\n";
constexpr std::string_view kWholeKalibr =
    "cam0:\n  camera_model: pinhole\n  distortion_coeffs: [-0.1, 0.02, -0.003, 0.0004]\n  distortion_model: "
    "equidistant\n"
    "  intrinsics: [500.0, 501.0, 319.5, 239.5]\n  resolution: [640, 480]\n";
constexpr std::string_view kWholeCalibu =
    "<?xml version=\"1.0\"?>\n<rig><camera><camera_model type=\"calibu_fu_fv_u0_v0_kb4\" version=\"0\">\n<width> 1440 "
    "</width>\n"
    "<!-- note --><height> 1080 </height><params> [ 717.2; 717.4; 735.3; 552.7; -0.1; -0.001; 0.0009; -4e-05 ] "
    "</params>\n"
    "</camera_model></camera></rig>\n";
constexpr std::string_view kTrajectory = "# t p q\n0.0 1 2 3 0 0 0 1\n0.04 1.5 2 3 0 0 0.6 0.8\n0.08 2 2 3 0 0 0 1\n";
constexpr std::string_view kC3vdPoses = "1,0,0,0,0,1,0,0,0,0,1,0,1.5,2.5,3.5,1\n0,1,0,0,-1,0,0,0,0,0,1,0,7,8,9,1\n";
constexpr std::string_view kTimes = "0.000000\n0.040000\n0.080000\n";

// Every prefix, then random changes of one to four bytes: overwritten, inserted, removed, doubled runs.
void ForEachMutation(std::string_view original, const std::function<void(const std::string&)>& visit) {
  for (std::size_t size = 0; size <= original.size(); ++size) visit(std::string(original.substr(0, size)));
  // Characters that mean something to these formats are more likely than others.
  constexpr std::string_view kTelling = ":-[]{}#&*!|>'\"%@`,\n\t <>/=.eE+0123456789n";
  std::mt19937 random(11);
  for (int trial = 0; trial < 1500; ++trial) {
    std::string text(original);
    const unsigned num_changes = 1 + random() % 4;
    for (unsigned change = 0; change < num_changes; ++change) {
      const std::size_t at = random() % text.size();
      const bool telling = random() % 4 != 0;
      const char c = telling ? kTelling[random() % kTelling.size()] : static_cast<char>(random());
      switch (random() % 4) {
        case 0: text[at] = c; break;
        case 1: text.insert(text.begin() + static_cast<std::ptrdiff_t>(at), c); break;
        case 2: text.erase(at, 1 + random() % 8); break;
        default: text.insert(at, text.substr(random() % text.size(), random() % 40)); break;
      }
      if (text.empty()) text.push_back(' ');
    }
    visit(text);
  }
}

TEST(ParserRobustness, DamagedCalibrationsAreRefusedOrUsable) {
  const TempFolder folder;
  for (const std::string_view original : {kSmallCalibration, kOwn, kWholeOpencv, kWholeKalibr, kWholeCalibu}) {
    int num_refused = 0;
    ForEachMutation(original, [&](const std::string& text) {
      const Result<CameraCalibration> c = ReadCalibration(folder.Write("calib.yaml", text));
      if (!c.ok()) {
        ASSERT_EQ(c.code(), StatusCode::kInvalidArgument) << text;
        ASSERT_NE(c.status().message().find("calib.yaml"), std::string::npos) << c.status().message();
        ++num_refused;
        return;
      }
      ASSERT_GT(c->width_px, 0) << text;
      ASSERT_TRUE(c->cx >= 0 && c->cx < c->width_px && c->cy >= 0 && c->cy < c->height_px) << text;
      ASSERT_TRUE(c->kind == CameraModelKind::kOcamCalib || (c->fx > 0 && c->fy > 0)) << text;
      for (const double coefficient : c->coefficients) ASSERT_TRUE(std::isfinite(coefficient)) << text;
    });
    EXPECT_GT(num_refused, 500);
  }
}

TEST(ParserRobustness, DeeplyNestedYamlIsRefused) {
  const TempFolder folder;
  EXPECT_FALSE(ReadCalibration(folder.Write("calib.yaml", "model: " + std::string(50'000, '['))).ok());
  EXPECT_FALSE(ReadCalibration(folder.Write("calib.yaml", std::string(50'000, '{'))).ok());
}

TEST(ParserRobustness, DeeplyNestedXmlIsRefused) {
  const TempFolder folder;
  std::string text;
  for (int i = 0; i < 50'000; ++i) text += "<rig>";
  EXPECT_FALSE(ReadCalibration(folder.Write("calib.xml", text)).ok());
}

TEST(ParserRobustness, DamagedTrajectoriesAreRefusedOrUsable) {
  const TempFolder folder;
  for (const std::string_view original : {kTrajectory, kC3vdPoses}) {
    ForEachMutation(original, [&](const std::string& text) {
      const Result<std::vector<GroundTruthPose>> poses = ReadGroundTruth(folder.Write("gt.txt", text));
      if (!poses.ok()) return;
      ASSERT_FALSE(poses->empty());
      std::int64_t last_ns = std::numeric_limits<std::int64_t>::min();
      for (const GroundTruthPose& pose : *poses) {
        const auto& q = pose.world_from_cam_xyzw;
        ASSERT_NEAR(q[0] * q[0] + q[1] * q[1] + q[2] * q[2] + q[3] * q[3], 1.0, 1e-9) << text;
        ASSERT_GT(pose.timestamp_ns, last_ns) << text;
        last_ns = pose.timestamp_ns;
      }
    });
  }
}

TEST(ParserRobustness, DamagedTimesAreRefusedOrIncreasing) {
  const TempFolder folder;
  folder.Write("calib.yaml", kSmallCalibration);
  for (int i = 0; i < 3; ++i) {
    folder.WriteImage("frames/" + std::to_string(i) + ".png", FlatImage(64, 48, PixelFormat::kGrey8, 1));
  }
  ForEachMutation(kTimes, [&](const std::string& text) {
    folder.Write("times.txt", text);
    const Result<SequenceListing> listing = ListSequenceFolder(folder.path(), {});
    if (!listing.ok()) return;
    ASSERT_EQ(listing->timestamps_ns.size(), 3u) << text;
    ASSERT_LT(listing->timestamps_ns[0], listing->timestamps_ns[1]) << text;
    ASSERT_LT(listing->timestamps_ns[1], listing->timestamps_ns[2]) << text;
  });
}

}  // namespace
}  // namespace haustra
