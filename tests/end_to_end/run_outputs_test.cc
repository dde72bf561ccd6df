// Every file of a run's output folder: there, well-formed, and saying the same as all the others.
#include <gtest/gtest.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdint>
#include <cstdio>
#include <cstring>
#include <map>
#include <set>
#include <sstream>
#include <string>
#include <utility>
#include <vector>

#include "tests/end_to_end/result_files.h"

namespace haustra::end_to_end {
namespace {

constexpr const char* kSequences[] = {"standard", "losses", "breathing"};

std::string MapName(const std::string& map_id) {
  char name[32];
  std::snprintf(name, sizeof(name), "map_%04d", std::stoi(map_id));
  return name;
}

std::string StampOf(std::int64_t timestamp_ns) {
  char text[32];
  std::snprintf(text, sizeof(text), "%lld.%09lld", static_cast<long long>(timestamp_ns / 1000000000),
                static_cast<long long>(timestamp_ns % 1000000000));
  return text;
}

// Lines that are not comments.
std::vector<std::string> DataLines(const std::string& path) {
  std::istringstream text(ReadBytes(path));
  std::vector<std::string> lines;
  for (std::string line; std::getline(text, line);) {
    if (!line.starts_with('#')) lines.push_back(line);
  }
  return lines;
}

class RunOutputs : public testing::TestWithParam<const char*> {
 protected:
  std::string Out(const std::string& name) const { return ResultFolder(GetParam()) + "/" + name; }
  CsvRows LivingMaps() const {
    CsvRows maps = ReadCsv(Out("maps.csv"));
    std::erase_if(maps, [](auto& map) { return map["status"] != "active" && map["status"] != "stored"; });
    return maps;
  }
};

TEST_P(RunOutputs, FramesHaveOneRowEachWithTheTimeOfTheSequence) {
  const std::vector<std::string> times = DataLines(SequenceFolder(GetParam()) + "/times.txt");
  CsvRows frames = ReadCsv(Out("frames.csv"));
  ASSERT_EQ(frames.size(), times.size());
  const std::set<std::string> searches = {"not_searched",    "found",         "few_matches",     "no_pose",
                                          "few_inliers",     "weak_evidence", "low_match_share", "low_spread",
                                          "few_established", "uncertain",     "denied_by_flow"};
  const std::set<std::string> states = {"initialising", "tracking", "predicted", "lost", "dropped"};
  for (std::size_t i = 0; i < frames.size(); ++i) {
    EXPECT_EQ(frames[i]["frame_idx"], std::to_string(i));
    EXPECT_NEAR(std::stod(frames[i]["timestamp_ns"]), std::stod(times[i]) * 1e9, 1.0);
    EXPECT_TRUE(states.contains(frames[i]["state"])) << frames[i]["state"];
    EXPECT_FALSE(frames[i]["reason"].empty());
    EXPECT_TRUE(searches.contains(frames[i]["search"])) << frames[i]["search"];
    EXPECT_TRUE(frames[i]["reason"] != "recovered" || frames[i]["search"] == "found") << i;
    EXPECT_EQ(frames[i]["live_map_id"] != "-1", frames[i]["state"] == "tracking") << i;
    EXPECT_EQ(frames[i]["frame_ms"], "0") << "sequential runs keep no times in files that must repeat";
  }
}

TEST_P(RunOutputs, SummaryAgreesWithTheTables) {
  const nlohmann::json summary = ReadJson(Out("summary.json"));
  CsvRows frames = ReadCsv(Out("frames.csv"));
  std::map<std::string, int> frames_in_map;
  std::map<std::string, std::string> merged_into;
  std::set<std::string> existing;
  for (auto& map : LivingMaps()) existing.insert(map["map_id"]);
  for (auto& event : ReadCsv(Out("events.csv"))) {
    if (event["event"] == "merged") merged_into[event["other_map_id"]] = event["map_id"];
  }
  int live = 0;
  for (auto& frame : frames) {
    if (frame["map_id"] != "-1") ++frames_in_map[frame["map_id"]];
    std::string map = frame["live_map_id"];
    while (!existing.contains(map) && merged_into.contains(map)) map = merged_into[map];
    live += existing.contains(map) ? 1 : 0;
  }
  int localised = 0, largest = 0;
  for (const auto& [id, count] : frames_in_map) {
    localised += count;
    largest = std::max(largest, count);
  }
  EXPECT_EQ(summary.at("frames").get<std::size_t>(), frames.size());
  EXPECT_EQ(summary.at("sequence_frames").get<std::size_t>(), frames.size());
  EXPECT_EQ(summary.at("live_localised").get<int>(), live);
  EXPECT_NEAR(summary.at("live_coverage").get<double>(), 100.0 * live / static_cast<double>(frames.size()), 1e-9);
  EXPECT_EQ(summary.at("localised").get<int>(), localised);
  EXPECT_NEAR(summary.at("coverage").get<double>(), 100.0 * localised / static_cast<double>(frames.size()), 1e-9);
  EXPECT_EQ(summary.at("maps").get<std::size_t>(), frames_in_map.size());
  EXPECT_EQ(summary.at("largest_map_frames").get<int>(), largest);
  std::map<std::string, int> events;
  for (auto& event : ReadCsv(Out("events.csv"))) ++events[event["event"]];
  EXPECT_EQ(summary.at("merges").get<int>(), events["merged"]);
  EXPECT_EQ(summary.at("loops").get<int>(), events["loop_closed"]);
  EXPECT_EQ(summary.at("relocalisations").get<int>(), events["relocalised"]);
  EXPECT_EQ(summary.at("losses").get<int>(), events["lost"]);
  EXPECT_EQ(summary.at("maps_created").get<int>(), events["map_created"]);
  EXPECT_EQ(summary.at("mode").get<std::string>(), "sequential");
  EXPECT_EQ(summary.at("device").get<std::string>(), "cpu");
  EXPECT_TRUE(summary.at("seed").is_number_unsigned());
  EXPECT_EQ(summary.at("dropped").get<int>(), 0);
  EXPECT_EQ(summary.at("damaged").get<int>(), 0);
  EXPECT_GT(summary.at("peak_rss_mb").get<double>(), 0);
  EXPECT_GT(summary.at("realtime_ratio").get<double>(), 0);
  const nlohmann::json& times = summary.at("frame_ms");
  EXPECT_GT(times.at("p50").get<double>(), 0);
  EXPECT_LE(times.at("p50").get<double>(), times.at("p99").get<double>());
  EXPECT_LE(times.at("p99").get<double>(), times.at("p999").get<double>());
  EXPECT_LE(times.at("p999").get<double>(), times.at("max").get<double>());
}

TEST_P(RunOutputs, LiveTrajectoryHasThePosesOfTrackedFrames) {
  std::vector<std::string> stamps;
  for (auto& frame : ReadCsv(Out("frames.csv"))) {
    if (frame["state"] == "tracking") stamps.push_back(StampOf(std::stoll(frame["timestamp_ns"])));
  }
  const std::vector<TumPose> poses = ReadTum(Out("trajectory/live.tum"));
  ASSERT_EQ(poses.size(), stamps.size());
  for (std::size_t i = 0; i < poses.size(); ++i) EXPECT_EQ(poses[i].stamp, stamps[i]);
}

TEST_P(RunOutputs, FinalTrajectoriesHaveThePosesOfLocalisedFrames) {
  std::map<std::string, std::vector<std::string>> stamps;
  for (auto& frame : ReadCsv(Out("frames.csv"))) {
    if (frame["map_id"] != "-1") stamps[frame["map_id"]].push_back(StampOf(std::stoll(frame["timestamp_ns"])));
  }
  std::size_t num_files = 0;
  for (const std::string& file : FilesBelow(Out("trajectory"))) num_files += file != "live.tum";
  EXPECT_EQ(num_files, stamps.size());
  for (const auto& [map_id, expected] : stamps) {
    const std::vector<TumPose> poses = ReadTum(Out("trajectory/" + MapName(map_id) + ".tum"));
    ASSERT_EQ(poses.size(), expected.size());
    for (std::size_t i = 0; i < poses.size(); ++i) {
      EXPECT_EQ(poses[i].stamp, expected[i]);
      const double* q = poses[i].numbers + 3;
      EXPECT_NEAR(std::hypot(std::hypot(q[0], q[1]), std::hypot(q[2], q[3])), 1.0, 1e-9);
    }
  }
}

TEST_P(RunOutputs, MapsTableAgreesWithTheFrames) {
  CsvRows maps = ReadCsv(Out("maps.csv"));
  ASSERT_FALSE(maps.empty());
  std::map<std::string, std::vector<std::int64_t>> stamps;
  for (auto& frame : ReadCsv(Out("frames.csv"))) {
    if (frame["map_id"] != "-1") stamps[frame["map_id"]].push_back(std::stoll(frame["timestamp_ns"]));
  }
  std::set<std::string> ids;
  for (auto& map : maps) EXPECT_TRUE(ids.insert(map["map_id"]).second) << "map " << map["map_id"] << " twice";
  for (auto& map : maps) {
    const std::vector<std::int64_t>& own = stamps[map["map_id"]];
    EXPECT_EQ(std::stoul(map["num_frames"]), own.size());
    if (!own.empty()) {
      EXPECT_EQ(std::stoll(map["first_timestamp_ns"]), own.front());
      EXPECT_EQ(std::stoll(map["last_timestamp_ns"]), own.back());
    }
    const bool is_merged = map["status"] == "merged";
    EXPECT_TRUE(is_merged || map["status"] == "active" || map["status"] == "stored" || map["status"] == "dropped");
    EXPECT_EQ(map["merged_into"] != "-1", is_merged);
    EXPECT_TRUE(!is_merged || ids.contains(map["merged_into"])) << map["merged_into"];
    EXPECT_TRUE(own.empty() || (!is_merged && map["status"] != "dropped")) << "poses in map " << map["map_id"];
  }
}

TEST_P(RunOutputs, EveryMapHasItsSceneDepthAndKeepsItsScale) {
  const nlohmann::json depths = ReadJson(Out("summary.json")).at("scene_depth");
  CsvRows maps = LivingMaps();
  ASSERT_EQ(depths.size(), maps.size());
  for (std::size_t i = 0; i < maps.size(); ++i) {
    EXPECT_EQ(std::to_string(depths[i].at("map_id").get<int>()), maps[i]["map_id"]);
    EXPECT_EQ(depths[i].at("keyframes").get<std::size_t>(), std::stoul(maps[i]["num_keyframes"]));
    const auto p5 = depths[i].at("p5").get<double>(), p95 = depths[i].at("p95").get<double>();
    EXPECT_GT(p5, 0.0);
    EXPECT_LE(p5, depths[i].at("p50").get<double>());
    EXPECT_LE(depths[i].at("p50").get<double>(), p95);
    EXPECT_LE(p95, 5.0 * p5);
    EXPECT_FALSE(depths[i].at("scale_lost").get<bool>());
  }
}

TEST_P(RunOutputs, EventsAreInOrderAndNameFramesAndMapsOfTheRun) {
  const std::size_t num_frames = ReadCsv(Out("frames.csv")).size();
  std::set<std::string> maps = {"-1"};
  for (auto& map : ReadCsv(Out("maps.csv"))) maps.insert(map["map_id"]);
  std::size_t last = 0;
  for (auto& event : ReadCsv(Out("events.csv"))) {
    const std::size_t frame = std::stoul(event["frame_idx"]);
    EXPECT_LT(frame, num_frames);
    EXPECT_GE(frame, last);
    last = frame;
    EXPECT_FALSE(event["event"].empty());
    EXPECT_TRUE(maps.contains(event["other_map_id"])) << event["event"] << " " << event["other_map_id"];
  }
}

TEST_P(RunOutputs, PointCloudsHaveThePointsOfTheirMaps) {
  for (auto& map : LivingMaps()) {
    const std::string bytes = ReadBytes(Out("maps/" + MapName(map["map_id"]) + ".ply"));
    const std::size_t end = bytes.find("end_header\n");
    ASSERT_NE(end, std::string::npos);
    const std::string header = bytes.substr(0, end);
    EXPECT_TRUE(header.starts_with("ply\nformat binary_little_endian 1.0\n")) << header;
    const std::size_t num_points = std::stoul(map["num_points"]);
    EXPECT_NE(header.find("element vertex " + std::to_string(num_points) + "\n"), std::string::npos) << header;
    const std::size_t data = end + std::strlen("end_header\n");
    constexpr std::size_t kVertexBytes = 3 * 4 + 3 + 2 * 4;
    ASSERT_EQ(bytes.size(), data + num_points * kVertexBytes);
    for (std::size_t i = 0; i < num_points; ++i) {
      const char* vertex = bytes.data() + data + i * kVertexBytes;
      float position[3];
      std::int32_t counts[2];
      std::memcpy(position, vertex, sizeof(position));
      std::memcpy(counts, vertex + 15, sizeof(counts));
      EXPECT_TRUE(std::isfinite(position[0]) && std::isfinite(position[1]) && std::isfinite(position[2]));
      EXPECT_GE(counts[0], 2);
      EXPECT_EQ(counts[1], std::stoi(map["map_id"]));
    }
  }
}

struct ColmapImage {
  double q[4], t[3];  // camera from map; w x y z
  std::string name;
  struct Point {
    double x, y;
    long long point_id;
  };
  std::vector<Point> points;
};

// OPENCV_FISHEYE as COLMAP and OpenCV define it.
std::pair<double, double> ProjectFisheye(const std::array<double, 8>& p, const ColmapImage& image, const double* x) {
  const double *q = image.q, *t = image.t;
  const double w = q[0], a = q[1], b = q[2], d = q[3];
  const double r[9] = {1 - 2 * (b * b + d * d), 2 * (a * b - w * d),     2 * (a * d + w * b),
                       2 * (a * b + w * d),     1 - 2 * (a * a + d * d), 2 * (b * d - w * a),
                       2 * (a * d - w * b),     2 * (b * d + w * a),     1 - 2 * (a * a + b * b)};
  double cam[3];
  for (int i = 0; i < 3; ++i) cam[i] = r[3 * i] * x[0] + r[3 * i + 1] * x[1] + r[3 * i + 2] * x[2] + t[i];
  const double radius = std::hypot(cam[0], cam[1]);
  const double theta = std::atan2(radius, cam[2]), s = theta * theta;
  const double bent = theta * (1 + s * (p[4] + s * (p[5] + s * (p[6] + s * p[7]))));
  const double scale = radius > 0 ? bent / radius : 0;
  return {p[0] * cam[0] * scale + p[2], p[1] * cam[1] * scale + p[3]};
}

TEST_P(RunOutputs, ColmapModelsAreConsistentAndReproject) {
  for (auto& map : LivingMaps()) {
    const std::string folder = Out("maps/" + MapName(map["map_id"]));
    const std::vector<std::string> cameras = DataLines(folder + "/cameras.txt");
    ASSERT_EQ(cameras.size(), 1u);
    std::istringstream camera(cameras[0]);
    int camera_id = 0, width = 0, height = 0;
    std::string model;
    std::array<double, 8> parameters{};
    camera >> camera_id >> model >> width >> height;
    for (double& p : parameters) camera >> p;
    ASSERT_TRUE(camera) << cameras[0];
    ASSERT_EQ(model, "OPENCV_FISHEYE");
    EXPECT_EQ(camera_id, 1);

    std::map<int, ColmapImage> images;
    const std::vector<std::string> lines = DataLines(folder + "/images.txt");
    ASSERT_EQ(lines.size(), 2 * std::stoul(map["num_keyframes"]));
    for (std::size_t i = 0; i < lines.size(); i += 2) {
      std::istringstream pose(lines[i]), points(lines[i + 1]);
      int id = 0;
      pose >> id;
      ColmapImage& image = images[id];
      for (double& v : image.q) pose >> v;
      for (double& v : image.t) pose >> v;
      pose >> camera_id >> image.name;
      ASSERT_TRUE(pose) << lines[i];
      EXPECT_TRUE(Exists(SequenceFolder(GetParam()) + "/frames/" + image.name)) << image.name;
      for (ColmapImage::Point p; points >> p.x >> p.y >> p.point_id;) {
        EXPECT_TRUE(p.x >= 0 && p.x <= width && p.y >= 0 && p.y <= height) << p.x << " " << p.y;
        image.points.push_back(p);
      }
    }
    ASSERT_EQ(images.size(), lines.size() / 2);

    std::size_t num_observations = 0;
    std::vector<double> errors;
    const std::vector<std::string> rows = DataLines(folder + "/points3D.txt");
    ASSERT_EQ(rows.size(), std::stoul(map["num_points"]));
    for (const std::string& row : rows) {
      std::istringstream point(row);
      long long id = 0;
      double position[3], error = 0;
      int rgb[3];
      point >> id >> position[0] >> position[1] >> position[2] >> rgb[0] >> rgb[1] >> rgb[2] >> error;
      ASSERT_TRUE(point) << row;
      for (int image_id = 0, index = 0; point >> image_id >> index; ++num_observations) {
        ASSERT_TRUE(images.contains(image_id)) << row;
        const ColmapImage& image = images[image_id];
        ASSERT_LT(static_cast<std::size_t>(index), image.points.size()) << row;
        ASSERT_EQ(image.points[index].point_id, id);
        const auto [x, y] = ProjectFisheye(parameters, image, position);
        errors.push_back(std::hypot(x - image.points[index].x, y - image.points[index].y));
      }
    }
    std::size_t num_linked = 0;
    for (const auto& [id, image] : images) {
      num_linked +=
          std::count_if(image.points.begin(), image.points.end(), [](const auto& p) { return p.point_id >= 0; });
    }
    EXPECT_EQ(num_linked, num_observations);
    ASSERT_FALSE(errors.empty());
    std::nth_element(errors.begin(), errors.begin() + errors.size() / 2, errors.end());
    EXPECT_LT(errors[errors.size() / 2], 1.0) << "median reprojection error, px";
  }
}

INSTANTIATE_TEST_SUITE_P(Sequences, RunOutputs, testing::ValuesIn(kSequences),
                         [](const auto& sequence) { return std::string(sequence.param); });

}  // namespace
}  // namespace haustra::end_to_end
