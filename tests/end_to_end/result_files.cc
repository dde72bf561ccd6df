#include "tests/end_to_end/result_files.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cstdio>
#include <filesystem>
#include <fstream>
#include <iterator>
#include <sstream>

namespace haustra::end_to_end {
namespace {

namespace fs = std::filesystem;

std::vector<std::string> Split(const std::string& line, char separator) {
  std::vector<std::string> cells;
  std::string cell;
  std::istringstream stream(line);
  while (std::getline(stream, cell, separator)) cells.push_back(cell);
  if (!line.empty() && line.back() == separator) cells.emplace_back();
  return cells;
}

}  // namespace

std::string SequenceFolder(const std::string& name) { return std::string(HAUSTRA_END_TO_END_DATA) + "/" + name; }

std::string ResultFolder(const std::string& name) { return SequenceFolder(name) + "_result"; }

std::string ScratchFolder() {
  const testing::TestInfo& test = *testing::UnitTest::GetInstance()->current_test_info();
  const fs::path folder =
      fs::path(HAUSTRA_END_TO_END_DATA) / "scratch" / (std::string(test.test_suite_name()) + "." + test.name());
  fs::remove_all(folder);
  fs::create_directories(folder);
  return folder.string();
}

bool Exists(const std::string& path) { return fs::exists(path); }

std::string ReadBytes(const std::string& path) {
  std::ifstream file(path, std::ios::binary);
  EXPECT_TRUE(file.good()) << path << " cannot be read";
  return {std::istreambuf_iterator<char>(file), {}};
}

void WriteBytes(const std::string& path, const std::string& bytes) {
  fs::create_directories(fs::path(path).parent_path());
  fs::remove(path);
  std::ofstream(path, std::ios::binary).write(bytes.data(), static_cast<std::streamsize>(bytes.size()));
}

void ReplaceInFile(const std::string& path, const std::string& from, const std::string& to) {
  std::string text = ReadBytes(path);
  const std::size_t at = text.find(from);
  ASSERT_NE(at, std::string::npos) << "'" << from << "' is not in " << path;
  WriteBytes(path, text.replace(at, from.size(), to));
}

nlohmann::json ReadJson(const std::string& path) {
  nlohmann::json json = nlohmann::json::parse(ReadBytes(path), nullptr, false);
  EXPECT_FALSE(json.is_discarded()) << path << " is not JSON";
  return json;
}

CsvRows ReadCsv(const std::string& path) {
  std::istringstream text(ReadBytes(path));
  std::string line;
  std::getline(text, line);
  const std::vector<std::string> names = Split(line, ',');
  CsvRows rows;
  while (std::getline(text, line)) {
    const std::vector<std::string> cells = Split(line, ',');
    EXPECT_EQ(cells.size(), names.size()) << path << ": " << line;
    auto& row = rows.emplace_back();
    for (std::size_t i = 0; i < std::min(cells.size(), names.size()); ++i) row[names[i]] = cells[i];
  }
  return rows;
}

std::vector<TumPose> ReadTum(const std::string& path) {
  std::istringstream text(ReadBytes(path));
  std::vector<TumPose> poses;
  for (std::string line; std::getline(text, line);) {
    if (line.empty() || line[0] == '#') continue;
    const std::vector<std::string> cells = Split(line, ' ');
    EXPECT_EQ(cells.size(), 8u) << path << ": " << line;
    if (cells.size() != 8) continue;
    TumPose& pose = poses.emplace_back();
    pose.stamp = cells[0];
    for (int i = 0; i < 7; ++i) pose.numbers[i] = std::stod(cells[i + 1]);
  }
  return poses;
}

std::vector<std::string> FilesBelow(const std::string& folder) {
  std::vector<std::string> files;
  for (const fs::directory_entry& entry : fs::recursive_directory_iterator(folder)) {
    if (entry.is_regular_file()) files.push_back(entry.path().lexically_relative(folder).generic_string());
  }
  std::sort(files.begin(), files.end());
  return files;
}

std::string FramePath(const std::string& sequence, int index) {
  char name[32];
  std::snprintf(name, sizeof(name), "/frames/%06d.jpg", index);
  return sequence + name;
}

void CopySequence(const std::string& from, const std::string& to, int num_frames) {
  fs::create_directories(to + "/frames");
  for (const char* name : {"calib.yaml", "mask.png"}) {
    fs::copy_file(from + "/" + name, to + "/" + name, fs::copy_options::overwrite_existing);
  }
  std::istringstream times(ReadBytes(from + "/times.txt"));
  std::string kept;
  std::string line;
  for (int i = 0; i < num_frames && std::getline(times, line); ++i) {
    kept += line + "\n";
    fs::copy_file(FramePath(from, i), FramePath(to, i), fs::copy_options::overwrite_existing);
  }
  WriteBytes(to + "/times.txt", kept);
}

}  // namespace haustra::end_to_end
