// The files of `haustra export` by the rules of the programs that read them.
#include "tools/export/export_command.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <bit>
#include <cstring>
#include <nlohmann/json.hpp>
#include <sstream>

#include "engine/io/ply_writer.h"
#include "tests/tools/command/call_command.h"
#include "tests/tools/evaluate/run_folder.h"
#include "tests/tools/report/small_report.h"
#include "tools/exit_codes.h"

namespace haustra {
namespace {

using ::testing::HasSubstr;

// Rows of numbers, as evo's csv_read_matrix reads them: comments begin with #.
std::vector<std::vector<double>> Matrix(const std::string& text, char separator) {
  std::vector<std::vector<double>> rows;
  std::istringstream lines(text);
  for (std::string line; std::getline(lines, line);) {
    if (line.starts_with('#')) continue;
    auto& row = rows.emplace_back();
    std::istringstream cells(line);
    for (std::string cell; std::getline(cells, cell, separator);) row.push_back(std::stod(cell));
  }
  return rows;
}

std::string PlyOf(int num_points) {
  return "ply\nformat binary_little_endian 1.0\nelement vertex " + std::to_string(num_points) + "\nend_header\n" +
         std::string(static_cast<std::size_t>(num_points) * kPlyPointBytes, 'p');
}

class ExportTest : public ::testing::Test {
 protected:
  void SetUp() override {
    run_ = report::SmallRun();
    WriteRunFolder(folder_, "out", run_);
    for (const char* map : {"map_0000", "map_0001"}) {
      const std::string maps = std::string("out/maps/") + map;
      folder_.Write(maps + "/cameras.txt", "1 OPENCV_FISHEYE 720 540 398 398 360 270 0 0 0 0\n");
      folder_.Write(maps + "/images.txt", "2 1 0 0 0 0 0 0 1 a.jpg\n100.5 50.5 7 120.5 60.5 -1\n");
      folder_.Write(maps + "/points3D.txt", "7 0.25 0.5 1.5 200 100 90 0.5 2 0\n8 -1 2 3 1 2 3 0.5 2 1\n");
      folder_.Write(maps + ".ply", PlyOf(2));
    }
  }
  int Export(const std::string& format, const std::vector<std::string>& more = {}) {
    std::vector<std::string> arguments = {"export", folder_.At("out"), "--format", format, "--out", folder_.At("to")};
    arguments.insert(arguments.end(), more.begin(), more.end());
    const CommandAnswer answer = CallCommand({AddExportCommand}, arguments);
    err_ = answer.err;
    return answer.code;
  }
  std::string Exported(const std::string& name) const { return folder_.Read("to/" + name); }
  // Of the frames that are in map 0 at the end.
  std::vector<evaluate::RunFrame> FramesOfMap0() const {
    std::vector<evaluate::RunFrame> frames = run_.frames;
    std::erase_if(frames, [](const evaluate::RunFrame& frame) { return frame.map_id != 0; });
    return frames;
  }

  evaluate::TextFolder folder_;
  evaluate::RunOutput run_;
  std::string err_;
};

TEST_F(ExportTest, TumHasEightColumnsSortedByTimeAndUnitQuaternions) {
  ASSERT_EQ(Export("tum"), kExitOk) << err_;
  const auto rows = Matrix(Exported("map_0000.tum"), ' ');
  const std::vector<evaluate::RunFrame> frames = FramesOfMap0();
  ASSERT_EQ(rows.size(), frames.size());
  for (std::size_t i = 0; i < rows.size(); ++i) {
    ASSERT_EQ(rows[i].size(), 8u);
    EXPECT_NEAR(rows[i][0], static_cast<double>(frames[i].timestamp_ns) * 1e-9, 1e-9);
    if (i > 0) {
      EXPECT_GT(rows[i][0], rows[i - 1][0]);
    }
    EXPECT_NEAR(Eigen::Map<const Eigen::Vector4d>(&rows[i][4]).norm(), 1.0, 1e-9);
    EXPECT_NEAR((Eigen::Map<const Eigen::Vector3d>(&rows[i][1]) - frames[i].world_from_cam.translation).norm(), 0,
                1e-9);
  }
}

TEST_F(ExportTest, KittiHasTwelveColumnsWithRotationsAndATimeForEachLine) {
  ASSERT_EQ(Export("kitti"), kExitOk) << err_;
  const auto rows = Matrix(Exported("map_0000.txt"), ' ');
  const std::vector<evaluate::RunFrame> frames = FramesOfMap0();
  ASSERT_EQ(rows.size(), frames.size());
  for (std::size_t i = 0; i < rows.size(); ++i) {
    ASSERT_EQ(rows[i].size(), 12u);
    const Eigen::Map<const Eigen::Matrix<double, 3, 4, Eigen::RowMajor>> pose(rows[i].data());
    const Eigen::Matrix3d rotation = pose.leftCols<3>();
    EXPECT_LT((rotation * rotation.transpose() - Eigen::Matrix3d::Identity()).norm(), 1e-9);
    EXPECT_NEAR(rotation.determinant(), 1.0, 1e-9);
    EXPECT_LT((rotation - frames[i].world_from_cam.matrix3()).norm(), 1e-9);
    EXPECT_LT((pose.col(3) - frames[i].world_from_cam.translation).norm(), 1e-9);
  }
  const auto times = Matrix(Exported("map_0000_times.txt"), ' ');
  ASSERT_EQ(times.size(), rows.size());
  EXPECT_NEAR(times[0][0], static_cast<double>(frames[0].timestamp_ns) * 1e-9, 1e-9);
}

TEST_F(ExportTest, CsvHasAHeaderAndTheNumbersOfTheFrames) {
  ASSERT_EQ(Export("csv"), kExitOk) << err_;
  const std::string text = Exported("map_0000.csv");
  const std::string header = "frame_idx,timestamp_s,x_mu,y_mu,z_mu,qx,qy,qz,qw\n";
  ASSERT_TRUE(text.starts_with(header));
  const auto rows = Matrix(text.substr(header.size()), ',');
  const std::vector<evaluate::RunFrame> frames = FramesOfMap0();
  ASSERT_EQ(rows.size(), frames.size());
  for (std::size_t i = 0; i < rows.size(); ++i) {
    ASSERT_EQ(rows[i].size(), 9u);
    EXPECT_EQ(rows[i][0], static_cast<double>(frames[i].frame_idx));
  }
}

TEST_F(ExportTest, ModelAndPointsAreThoseOfTheRun) {
  ASSERT_EQ(Export("colmap"), kExitOk) << err_;
  for (const char* name : {"map_0000/cameras.txt", "map_0000/images.txt", "map_0000/points3D.txt"}) {
    EXPECT_EQ(Exported(name), folder_.Read(std::string("out/maps/") + name));
  }
  ASSERT_EQ(Export("ply", {"--overwrite"}), kExitOk) << err_;
  EXPECT_EQ(Exported("map_0000.ply"), PlyOf(2));
  EXPECT_EQ(Exported("map_0000/images.txt"), "");  // what was there is replaced as a whole
}

// By the specification of glTF 2.0: header, chunks, alignment, and that every accessor lies within the binary chunk.
TEST_F(ExportTest, GlbHoldsPointsWithColoursAndThePath) {
  ASSERT_EQ(Export("glb"), kExitOk) << err_;
  const std::string bytes = Exported("map_0000.glb");
  const auto word = [&](std::size_t at) {
    std::uint32_t value = 0;
    std::memcpy(&value, bytes.data() + at, 4);
    return value;
  };
  ASSERT_GT(bytes.size(), 28u);
  EXPECT_EQ(bytes.substr(0, 4), "glTF");
  EXPECT_EQ(word(4), 2u);
  EXPECT_EQ(word(8), bytes.size());
  EXPECT_EQ(bytes.substr(16, 4), "JSON");
  const std::size_t json_size = word(12), binary = 20 + json_size;
  ASSERT_EQ(json_size % 4, 0u);
  const nlohmann::json json = nlohmann::json::parse(bytes.substr(20, json_size));
  EXPECT_EQ(bytes.substr(binary + 4, 4), std::string("BIN\0", 4));
  ASSERT_EQ(word(binary) + binary + 8, bytes.size());
  EXPECT_EQ(json.at("buffers").at(0).at("byteLength"), word(binary));
  EXPECT_EQ(json.at("asset").at("version"), "2.0");

  const auto data_of = [&](const nlohmann::json& accessor, std::size_t bytes_each) {
    const nlohmann::json& view = json.at("bufferViews").at(accessor.at("bufferView").get<std::size_t>());
    const auto offset = view.at("byteOffset").get<std::size_t>(), length = view.at("byteLength").get<std::size_t>();
    EXPECT_EQ(offset % 4, 0u);
    EXPECT_EQ(length, accessor.at("count").get<std::size_t>() * bytes_each);
    EXPECT_LE(offset + length, word(binary));
    return bytes.substr(binary + 8 + offset, length);
  };
  const auto accessor = [&](const nlohmann::json& index) { return json.at("accessors").at(index.get<std::size_t>()); };
  ASSERT_EQ(json.at("nodes").at(0).at("children").size(), 2u);
  const nlohmann::json points = json.at("meshes").at(0).at("primitives").at(0);
  EXPECT_EQ(points.at("mode"), 0);
  const nlohmann::json positions = accessor(points.at("attributes").at("POSITION"));
  ASSERT_EQ(positions.at("count"), 2);
  float position[6];
  std::memcpy(position, data_of(positions, 12).data(), sizeof(position));
  EXPECT_EQ(std::vector<float>(position, position + 6), (std::vector<float>{0.25f, 0.5f, 1.5f, -1, 2, 3}));
  EXPECT_EQ(positions.at("min"), nlohmann::json({-1, 0.5, 1.5}));
  EXPECT_EQ(positions.at("max"), nlohmann::json({0.25, 2, 3}));
  const std::string colours = data_of(accessor(points.at("attributes").at("COLOR_0")), 4);
  EXPECT_EQ(colours, std::string("\xc8\x64\x5a\xff\x01\x02\x03\xff"));

  const nlohmann::json path = json.at("meshes").at(1).at("primitives").at(0);
  EXPECT_EQ(path.at("mode"), 1);
  const std::vector<evaluate::RunFrame> frames = FramesOfMap0();
  EXPECT_EQ(accessor(path.at("attributes").at("POSITION")).at("count"), frames.size());
  const std::string lines = data_of(accessor(path.at("indices")), 4);
  std::size_t num_gaps = 0;
  for (std::size_t i = 1; i < frames.size(); ++i) num_gaps += frames[i].frame_idx != frames[i - 1].frame_idx + 1;
  EXPECT_GT(num_gaps, 0u);
  EXPECT_EQ(lines.size() / 8, frames.size() - 1 - num_gaps);
  for (std::size_t i = 0; i < lines.size(); i += 4) {
    std::uint32_t index = 0;
    std::memcpy(&index, lines.data() + i, 4);
    EXPECT_LT(index, frames.size());
  }
}

TEST_F(ExportTest, ATrajectoryThatWasCutIsSaid) {
  ASSERT_EQ(Export("tum"), kExitOk);
  EXPECT_EQ(err_, "");
  const std::string path = "out/trajectory/map_0000.tum", whole = folder_.Read(path);
  folder_.Write(path, whole.substr(0, whole.rfind('\n', whole.size() - 2) + 1));
  ASSERT_EQ(Export("tum", {"--overwrite"}), kExitOk) << err_;
  EXPECT_THAT(err_, HasSubstr("haustra export: warning: " + folder_.At(path) + ": no pose for 1 frames"));
}

TEST_F(ExportTest, WhatIsThereIsKeptAndWhatIsMissingNamed) {
  ASSERT_EQ(Export("csv"), kExitOk);
  EXPECT_EQ(Export("tum"), kExitInTheWay);
  EXPECT_THAT(err_, HasSubstr("--overwrite"));
  EXPECT_NE(Exported("map_0000.csv"), "");
  EXPECT_EQ(Export("fbx"), kExitUsage);
  folder_.Remove("out/maps/map_0000/points3D.txt");
  EXPECT_EQ(Export("glb", {"--overwrite"}), kExitNoInput);
  EXPECT_THAT(err_, HasSubstr("points3D.txt"));
  EXPECT_NE(Exported("map_0000.csv"), "");
}

// It is not the output that is wrong.
TEST_F(ExportTest, FileOfTheRunThatIsNotThereIsAMissingInput) {
  folder_.Remove("out/maps/map_0000.ply");
  EXPECT_EQ(Export("ply"), kExitNoInput);
  EXPECT_THAT(err_, HasSubstr("map_0000.ply: no such file"));
}

TEST_F(ExportTest, PointsThatWereCutOrAreNotThoseOfTheMapAreRefused) {
  const std::string path = "out/maps/map_0000.ply";
  const auto refusal = [&](const std::string& bytes) {
    folder_.Write(path, bytes);
    EXPECT_EQ(Export("ply"), kExitBadData);
    EXPECT_EQ(Exported("map_0000.ply"), "");
    return err_;
  };
  EXPECT_THAT(refusal(PlyOf(2).substr(0, PlyOf(2).size() - 5)),
              HasSubstr(folder_.At(path) + ": 41 bytes of points, 2 points are 46"));
  EXPECT_THAT(refusal(PlyOf(2).substr(0, 30)), HasSubstr(folder_.At(path) + ": not a PLY file, or cut"));
  EXPECT_THAT(refusal("not a PLY file"), HasSubstr(folder_.At(path) + ": not a PLY file"));
  EXPECT_THAT(refusal(PlyOf(3)), HasSubstr(folder_.At(path) + ": does not say that it has the 2 points"));
}

// Its files are there and good: it does not have what was asked for.
TEST_F(ExportTest, RunWithoutAMapHasNothingToExport) {
  run_.maps.clear();
  for (evaluate::RunFrame& frame : run_.frames) frame.map_id = frame.live_map_id = frame.keyframe_id = -1;
  WriteRunFolder(folder_, "out", run_);
  EXPECT_EQ(Export("tum"), kExitConfig);
  EXPECT_THAT(err_, HasSubstr("out: the run has no map"));
}

}  // namespace
}  // namespace haustra
