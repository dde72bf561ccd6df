// Two procedures in one colon: the first one's maps are saved, a second process loads them and maps another part of the
// way. Frame numbers and times of both begin at zero, as they do in life.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <cstdio>
#include <filesystem>
#include <map>
#include <numbers>
#include <set>
#include <sstream>
#include <string>
#include <vector>

#include "engine/geometry/sim3.h"
#include "tests/end_to_end/command.h"
#include "tests/end_to_end/result_files.h"

namespace haustra::end_to_end {
namespace {

namespace fs = std::filesystem;
using ::testing::AllOf;
using ::testing::HasSubstr;

// Frames of the sequence: the way to the blind end, and the way back.
struct Part {
  int first;
  int end;
};
constexpr Part kFirst{0, 125};
constexpr Part kSecond{125, 250};

std::string Folder() { return HAUSTRA_END_TO_END_DATA "/second_procedure"; }
std::string AtlasPath() { return Folder() + "/first.atlas"; }

// Five seconds of each procedure: more keyframes stay than by default, so that there are enough to align.
constexpr const char* kManyKeyframes = "mapping.redundant_share=0.95";

// camera-to-world of every frame of the sequence, mm.
std::vector<SE3> GroundTruth() {
  std::vector<SE3> poses;
  for (const TumPose& pose : ReadTum(SequenceFolder("standard") + "/groundtruth.txt")) {
    const double* n = pose.numbers;
    poses.emplace_back(Eigen::Quaterniond(n[6], n[3], n[4], n[5]), Eigen::Vector3d(n[0], n[1], n[2]));
  }
  return poses;
}

void CopyPart(const Part& part, const std::string& to) {
  const std::string from = SequenceFolder("standard");
  fs::create_directories(to + "/frames");
  for (const char* name : {"calib.yaml", "mask.png"}) fs::copy_file(from + "/" + name, to + "/" + name);
  std::string times;
  for (int i = part.first; i < part.end; ++i) {
    char time[32];
    std::snprintf(time, sizeof(time), "%.6f\n", 0.04 * (i - part.first));
    times += time;
    fs::copy_file(FramePath(from, i), FramePath(to, i - part.first));
  }
  WriteBytes(to + "/times.txt", times);
}

struct KeyframePose {
  int session;      // 0: loaded, 1: of the second procedure
  int frame_index;  // in its part
  SE3 world_from_cam;
};

std::vector<KeyframePose> ReadKeyframes(const std::string& images) {
  std::vector<KeyframePose> poses;
  std::istringstream text(ReadBytes(images));
  std::vector<std::string> lines;
  for (std::string line; std::getline(text, line);) {
    if (!line.starts_with('#')) lines.push_back(line);
  }
  for (std::size_t i = 0; i < lines.size(); i += 2) {
    std::istringstream fields(lines[i]);
    int id = 0, camera = 0;
    double q[4], t[3];
    std::string name;
    fields >> id >> q[0] >> q[1] >> q[2] >> q[3] >> t[0] >> t[1] >> t[2] >> camera >> name;
    EXPECT_TRUE(fields) << lines[i];
    KeyframePose pose;
    const std::string kLoaded = "session_0/frame_";
    pose.session = name.starts_with(kLoaded) ? 0 : 1;
    pose.frame_index = std::stoi(pose.session == 0 ? name.substr(kLoaded.size()) : name);
    pose.world_from_cam = SE3(Eigen::Quaterniond(q[0], q[1], q[2], q[3]), Eigen::Vector3d(t[0], t[1], t[2])).Inverse();
    poses.push_back(pose);
  }
  return poses;
}

class SecondProcedure : public testing::Test {
 protected:
  static void SetUpTestSuite() {
    fs::remove_all(Folder());
    CopyPart(kFirst, Folder() + "/first");
    CopyPart(kSecond, Folder() + "/second");
    const CommandResult first = HaustraOnCpu({"run", Folder() + "/first", "--out", Folder() + "/first_out",
                                              "--save-atlas", AtlasPath(), "--set", kManyKeyframes});
    ASSERT_EQ(first.exit_code, 0) << first.ToString();
    const CommandResult second = Run("second_out", "both.atlas");
    ASSERT_EQ(second.exit_code, 0) << second.ToString();
  }

  static CommandResult Run(const std::string& out, const std::string& saved) {
    return HaustraOnCpu({"run", Folder() + "/second", "--out", Folder() + "/" + out, "--load-atlas", AtlasPath(),
                         "--save-atlas", Folder() + "/" + saved, "--set", kManyKeyframes});
  }
  static std::string Out(const std::string& name) { return Folder() + "/second_out/" + name; }

  static std::string LoadedMap() {
    std::string id;
    for (auto& map : ReadCsv(Out("maps.csv"))) {
      if (map["loaded"] == "1" && map["status"] != "merged") id = map["map_id"];
    }
    EXPECT_FALSE(id.empty()) << "no loaded map is left";
    return id;
  }
};

TEST_F(SecondProcedure, FindsItselfInTheMapOfTheFirst) {
  const std::string loaded = LoadedMap();
  int num_localised = 0, num_in_loaded = 0, num_joins = 0;
  for (auto& frame : ReadCsv(Out("frames.csv"))) {
    num_localised += frame["map_id"] != "-1";
    num_in_loaded += frame["map_id"] == loaded;
  }
  for (auto& event : ReadCsv(Out("events.csv")))
    num_joins += event["event"] == "relocalised" || event["event"] == "merged";
  EXPECT_GE(num_joins, 1);
  // 105 of 125: the rest is behind the occlusion. All of them are in the map of the first procedure.
  EXPECT_GE(num_localised, 90);
  EXPECT_GE(num_in_loaded, num_localised * 8 / 10);
}

// The map holds keyframes of both procedures; one similarity must bring them all onto the truth, place and direction.
TEST_F(SecondProcedure, BothLieInOnePlaceByGroundTruth) {
  char name[32];
  std::snprintf(name, sizeof(name), "map_%04d", std::stoi(LoadedMap()));
  const std::vector<KeyframePose> keyframes = ReadKeyframes(Out(std::string("maps/") + name + "/images.txt"));
  const std::vector<SE3> truth = GroundTruth();
  ASSERT_EQ(truth.size(), static_cast<std::size_t>(kSecond.end));
  std::vector<Eigen::Vector3d> estimated, true_centres;
  std::vector<const SE3*> true_poses;
  int num_of_session[2] = {0, 0};
  for (const KeyframePose& keyframe : keyframes) {
    const Part& part = keyframe.session == 0 ? kFirst : kSecond;
    ASSERT_LT(keyframe.frame_index, part.end - part.first);
    true_poses.push_back(&truth[static_cast<std::size_t>(part.first + keyframe.frame_index)]);
    estimated.push_back(keyframe.world_from_cam.translation);
    true_centres.push_back(true_poses.back()->translation);
    ++num_of_session[keyframe.session];
  }
  EXPECT_GE(num_of_session[0], 10);
  EXPECT_GE(num_of_session[1], 10);
  Sim3 truth_from_map;
  ASSERT_TRUE(AlignSim3(estimated, true_centres, &truth_from_map));
  // The way is nearly straight, so that the centres leave the turn about it open; it must be the same for all
  // keyframes.
  const auto turn_of = [&](std::size_t i) {
    return true_poses[i]->rotation * (truth_from_map.rotation * keyframes[i].world_from_cam.rotation).conjugate();
  };
  double sum[2] = {0.0, 0.0}, worst_deg[2] = {0.0, 0.0};
  for (std::size_t i = 0; i < keyframes.size(); ++i) {
    const int session = keyframes[i].session;
    sum[session] += (truth_from_map * estimated[i] - true_centres[i]).squaredNorm();
    worst_deg[session] = std::max(worst_deg[session], RotationAngle(turn_of(i), turn_of(0)) * 180.0 / std::numbers::pi);
  }
  for (const int session : {0, 1}) {
    const double rms_mm = std::sqrt(sum[session] / num_of_session[session]);
    std::printf("session %d: %d keyframes, %.2f mm rms, at most %.2f degrees\n", session, num_of_session[session],
                rms_mm, worst_deg[session]);
    // The wall is 36 mm away.
    EXPECT_LT(rms_mm, 0.8) << session;
    EXPECT_LT(worst_deg[session], 1.5) << session;
  }
}

TEST_F(SecondProcedure, ItsResultsAreAboutItsOwnFrames) {
  CsvRows frames = ReadCsv(Out("frames.csv"));
  ASSERT_EQ(frames.size(), static_cast<std::size_t>(kSecond.end - kSecond.first));
  std::map<std::string, std::set<std::string>> stamps;
  int num_localised = 0;
  for (auto& frame : frames) {
    if (frame["map_id"] == "-1") continue;
    ++num_localised;
    char stamp[32];
    const long long ns = std::stoll(frame["timestamp_ns"]);
    std::snprintf(stamp, sizeof(stamp), "%lld.%09lld", ns / 1000000000, ns % 1000000000);
    stamps[frame["map_id"]].insert(stamp);
  }
  for (const auto& [map_id, expected] : stamps) {
    char name[48];
    std::snprintf(name, sizeof(name), "trajectory/map_%04d.tum", std::stoi(map_id));
    std::set<std::string> written;
    for (const TumPose& pose : ReadTum(Out(name))) EXPECT_TRUE(written.insert(pose.stamp).second) << pose.stamp;
    EXPECT_EQ(written, expected);
  }
  const nlohmann::json summary = ReadJson(Out("summary.json"));
  EXPECT_EQ(summary.at("localised").get<int>(), num_localised);
  EXPECT_EQ(summary.at("maps").get<std::size_t>(), stamps.size());
  EXPECT_EQ(summary.at("maps_loaded").get<int>(), 1);
  EXPECT_GE(summary.at("keyframes_loaded").get<int>(), 10);
  for (auto& map : ReadCsv(Out("maps.csv"))) {
    EXPECT_EQ(std::stoul(map["num_frames"]), stamps[map["map_id"]].size());
  }
  // While nothing is seen (red-out, frames 40 to 62) there is no pose, though the first procedure has keyframes of the
  // same numbers.
  for (std::size_t i = 46; i < 58; ++i) EXPECT_EQ(frames[i]["map_id"], "-1") << i;
  // Nothing was loaded the first time.
  for (auto& map : ReadCsv(Folder() + "/first_out/maps.csv")) EXPECT_EQ(map["loaded"], "0");
}

TEST_F(SecondProcedure, RepeatsToTheByte) {
  const CommandResult again = Run("again_out", "again.atlas");
  ASSERT_EQ(again.exit_code, 0) << again.ToString();
  EXPECT_EQ(ReadBytes(Folder() + "/again.atlas"), ReadBytes(Folder() + "/both.atlas"));
  for (const char* name : {"frames.csv", "maps.csv", "events.csv", "trajectory/live.tum"}) {
    EXPECT_EQ(ReadBytes(Folder() + "/again_out/" + name), ReadBytes(Out(name))) << name;
  }
}

// Another colon: its maps and the loaded one have nothing in common.
TEST_F(SecondProcedure, AnotherColonIsNotRecognised) {
  const std::string out = ScratchFolder() + "/out";
  const CommandResult run =
      HaustraOnCpu({"run", SequenceFolder("other_colon"), "--out", out, "--load-atlas", AtlasPath()});
  ASSERT_EQ(run.exit_code, 0) << run.ToString();
  int num_loaded = 0, num_localised = 0;
  for (auto& map : ReadCsv(out + "/maps.csv")) {
    num_localised += std::stoi(map["num_frames"]);
    if (map["loaded"] != "1") continue;
    ++num_loaded;
    EXPECT_EQ(map["status"], "stored");
    EXPECT_EQ(map["num_frames"], "0");
  }
  EXPECT_EQ(num_loaded, 1);
  EXPECT_GE(num_localised, 20);
  for (auto& event : ReadCsv(out + "/events.csv")) EXPECT_NE(event["event"], "merged");
}

TEST_F(SecondProcedure, InfoTellsWhatIsInAFile) {
  const CommandResult first = Haustra({"atlas", "info", AtlasPath()});
  ASSERT_EQ(first.exit_code, 0) << first.ToString();
  EXPECT_THAT(first.out, AllOf(HasSubstr("version 1"), HasSubstr("checksums and contents are right"),
                               HasSubstr("360x270"), HasSubstr("of session 0\n")));
  const CommandResult both = Haustra({"atlas", "info", Folder() + "/both.atlas"});
  ASSERT_EQ(both.exit_code, 0) << both.ToString();
  EXPECT_THAT(both.out, HasSubstr("of sessions 0 1\n"));
}

// Refused before anything of an earlier run is touched.
TEST_F(SecondProcedure, FilesThatDoNotFitAreRefusedAndOldResultsStay) {
  const std::string scratch = ScratchFolder();
  const std::string out = scratch + "/out";
  const auto run = [&](const std::string& sequence, const std::vector<std::string>& more) {
    std::vector<std::string> arguments = {"run", sequence, "--out", out, "--overwrite", "--device", "cpu"};
    arguments.insert(arguments.end(), more.begin(), more.end());
    return Haustra(arguments);
  };
  ASSERT_EQ(run(SequenceFolder("other_size"), {}).exit_code, 0);
  const std::string old_frames = ReadBytes(out + "/frames.csv");
  const std::string second = Folder() + "/second";

  std::string bytes = ReadBytes(AtlasPath());
  bytes[bytes.size() / 2] = static_cast<char>(bytes[bytes.size() / 2] ^ 0x10);
  const std::string damaged = scratch + "/damaged.atlas";
  WriteBytes(damaged, bytes);
  CommandResult result = run(second, {"--load-atlas", damaged});
  EXPECT_EQ(result.exit_code, 65) << result.ToString();
  EXPECT_THAT(result.err, AllOf(HasSubstr(damaged), HasSubstr("checksum"), HasSubstr("byte ")));
  result = Haustra({"atlas", "info", damaged});
  EXPECT_EQ(result.exit_code, 65) << result.ToString();
  EXPECT_THAT(result.err, HasSubstr("checksum"));

  result = run(second, {"--load-atlas", Folder() + "/missing.atlas"});
  EXPECT_EQ(result.exit_code, 66) << result.ToString();
  result = run(SequenceFolder("other_size"), {"--load-atlas", AtlasPath()});
  EXPECT_EQ(result.exit_code, 78) << result.ToString();
  EXPECT_THAT(result.err, AllOf(HasSubstr("another camera"), HasSubstr("360x270"), HasSubstr("240x180")));
  result = run(second, {"--load-atlas", AtlasPath(), "--set", "memory.max_keyframes=16"});
  EXPECT_EQ(result.exit_code, 78) << result.ToString();
  EXPECT_THAT(result.err, AllOf(HasSubstr("memory.max_keyframes"), HasSubstr("room for 16")));
  EXPECT_EQ(ReadBytes(out + "/frames.csv"), old_frames);
}

}  // namespace
}  // namespace haustra::end_to_end
