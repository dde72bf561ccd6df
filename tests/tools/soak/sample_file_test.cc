#include "tools/soak/sample_file.h"

#include <gtest/gtest.h>

#include <filesystem>
#include <fstream>
#include <iterator>
#include <string>

#include "tests/capture/temp_folder.h"
#include "tests/tools/command/file_size_limit.h"

namespace haustra {
namespace {

SoakSample SampleAt(double video_s) {
  SoakSample sample;
  sample.video_s = video_s;
  return sample;
}

TEST(SampleFile, TableCanBeReadAsItGrows) {
  const TempFolder folder;
  SampleFile file(folder.Path("soak.csv"));
  EXPECT_FALSE(std::filesystem::exists(folder.Path("soak.csv"))) << "there is no sample";
  std::string expected = SoakCsvHeader();
  for (const double video_s : {10.0, 20.0, 30.0}) {
    file.Add(SampleAt(video_s));
    expected += SoakCsvLine(SampleAt(video_s));
    EXPECT_EQ(folder.Read("soak.csv"), expected);
  }
  EXPECT_TRUE(file.status().ok());
}

TEST(SampleFile, OnAFullDiskItEndsWithAWholeLine) {
  const TempFolder folder;
  SampleFile file(folder.Path("soak.csv"));
  file.Add(SampleAt(10.0));
  const std::string before = folder.Read("soak.csv");
  {
    const FileSizeLimit limit(before.size() + 7);
    file.Add(SampleAt(20.0));
  }
  file.Add(SampleAt(30.0));
  EXPECT_EQ(folder.Read("soak.csv"), before);
  EXPECT_EQ(file.status().code(), StatusCode::kUnavailable);
  EXPECT_NE(file.status().message().find("soak.csv: cannot be written: only 7 of "), std::string::npos)
      << file.status().message();
}

// Who reads the earlier one meets all of it, and then all of the new one.
TEST(SampleFile, EarlierTableIsReplacedAsAWhole) {
  const TempFolder folder;
  const std::string earlier = SoakCsvHeader() + SoakCsvLine(SampleAt(99.0));
  folder.Write("soak.csv", earlier);
  {
    const FileSizeLimit limit(5);
    SampleFile file(folder.Path("soak.csv"));
    file.Add(SampleAt(10.0));
    EXPECT_FALSE(file.status().ok());
  }
  EXPECT_EQ(folder.Read("soak.csv"), earlier);
  std::ifstream reader(folder.Path("soak.csv"));
  SampleFile file(folder.Path("soak.csv"));
  file.Add(SampleAt(10.0));
  EXPECT_EQ(std::string(std::istreambuf_iterator<char>(reader), {}), earlier);
  EXPECT_EQ(folder.Read("soak.csv"), SoakCsvHeader() + SoakCsvLine(SampleAt(10.0)));
  EXPECT_EQ(std::distance(std::filesystem::directory_iterator(folder.path()), {}), 1) << "nothing is left beside it";
}

}  // namespace
}  // namespace haustra
