// The table of marks that a run is to set.
#include "tools/run/mark_file.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <fstream>

namespace haustra {
namespace {

using ::testing::HasSubstr;

std::string Write(const std::string& text) {
  const std::string path = testing::TempDir() + "marks_to_set.csv";
  std::ofstream(path) << text;
  return path;
}

TEST(MarkFile, MarksComeInTheOrderOfTheirFrames) {
  const auto marks = ReadMarkFile(Write("frame,u,v,label\n30,1.5,2,b\r\n\n7,10,20,a\n30,3,4,c"));
  ASSERT_TRUE(marks.ok()) << marks.status().ToString();
  ASSERT_EQ(marks->size(), 3u);
  EXPECT_EQ((*marks)[0].label.view(), "a");
  EXPECT_EQ((*marks)[0].frame_index, 7u);
  EXPECT_EQ((*marks)[1].label.view(), "b");
  EXPECT_EQ((*marks)[1].pixel, Eigen::Vector2d(1.5, 2.0));
  EXPECT_EQ((*marks)[2].label.view(), "c");
}

TEST(MarkFile, WhatIsWrongIsNamedWithItsLine) {
  const auto message = [](const std::string& text) { return ReadMarkFile(Write(text)).status().message(); };
  EXPECT_THAT(message(""), HasSubstr("empty"));
  EXPECT_THAT(message("7,1,2,a\n"), HasSubstr(":1: 'frame,u,v,label' expected"));
  EXPECT_THAT(message("frame,u,v,label\n7,1,2\n"), HasSubstr(":2: four fields"));
  EXPECT_THAT(message("frame,u,v,label\n-1,1,2,a\n"), HasSubstr(":2: '-1' is no frame number"));
  EXPECT_THAT(message("frame,u,v,label\n4294967295,1,2,a\n"), HasSubstr("is no frame number"));
  EXPECT_THAT(message("frame,u,v,label\n1,1,2,a\n7,nan,2,b\n"), HasSubstr(":3: 'nan' is no pixel"));
  EXPECT_THAT(message("frame,u,v,label\n7,1,2,a b\n"), HasSubstr("'a b' is no label"));
  EXPECT_EQ(ReadMarkFile(testing::TempDir() + "no_such_marks.csv").code(), StatusCode::kNotFound);
}

}  // namespace
}  // namespace haustra
