// Reads what the programs write, with a test's strictness: anything unexpected fails the test. reentrant.
#pragma once

#include <map>
#include <nlohmann/json.hpp>
#include <string>
#include <vector>

namespace haustra::end_to_end {

// Sequences that CTest's fixtures render and map before the tests that need them.
std::string SequenceFolder(const std::string& name);
std::string ResultFolder(const std::string& name);

// A new folder of its own for the test that runs now; emptied first.
std::string ScratchFolder();

bool Exists(const std::string& path);
std::string ReadBytes(const std::string& path);
void WriteBytes(const std::string& path, const std::string& bytes);
// The first `from`, which must be there.
void ReplaceInFile(const std::string& path, const std::string& from, const std::string& to);
nlohmann::json ReadJson(const std::string& path);

// Cells by column name; a row of another length than the header's fails the test.
using CsvRows = std::vector<std::map<std::string, std::string>>;
CsvRows ReadCsv(const std::string& path);

struct TumPose {
  std::string stamp;  // as written
  double numbers[7];  // tx ty tz qx qy qz qw
};
std::vector<TumPose> ReadTum(const std::string& path);

// Paths below `folder` of all files, sorted.
std::vector<std::string> FilesBelow(const std::string& folder);

// First `num_frames` frames of a sequence with its calibration, mask and times, as files of its own.
void CopySequence(const std::string& from, const std::string& to, int num_frames);
std::string FramePath(const std::string& sequence, int index);

}  // namespace haustra::end_to_end
