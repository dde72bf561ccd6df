#include "tools/command/range_picture.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "tests/tools/evaluate/text_folder.h"

namespace haustra {
namespace {

using ::testing::HasSubstr;

TEST(RangePicture, IsReadBackToTheStepOfItsUnit) {
  evaluate::TextFolder folder;
  RangePicture picture{3, 2, {0.0f, 0.5f, 12.345f, 255.9f, 300.0f, 0.001f}};
  folder.Write("a.pgm", RangePictureBytes(picture));
  const Result<RangePicture> read = ReadRangePicture(folder.At("a.pgm"));
  ASSERT_TRUE(read.ok()) << read.status().message();
  EXPECT_EQ(read->width, 3);
  EXPECT_EQ(read->height, 2);
  for (int i : {0, 1, 2, 3}) EXPECT_NEAR(read->range_mm[i], picture.range_mm[i], 0.5 / 256 + 1e-4);
  EXPECT_EQ(read->range_mm[4], 0.0f);  // beyond what 16 bits hold
  EXPECT_EQ(read->range_mm[5], 0.0f);
}

TEST(RangePicture, WhatIsNoneIsRefusedWithItsPath) {
  evaluate::TextFolder folder;
  EXPECT_EQ(ReadRangePicture(folder.At("none.pgm")).code(), StatusCode::kNotFound);
  const auto message = [&](const std::string& bytes) {
    folder.Write("b.pgm", bytes);
    const Result<RangePicture> read = ReadRangePicture(folder.At("b.pgm"));
    EXPECT_EQ(read.code(), StatusCode::kInvalidArgument);
    EXPECT_THAT(read.status().message(), HasSubstr("b.pgm: "));
    return read.status().message();
  };
  EXPECT_THAT(message("P6\n1 1\n65535\nxx"), HasSubstr("P5"));
  EXPECT_THAT(message("P5\n1 x\n65535\nxx"), HasSubstr("width, height"));
  EXPECT_THAT(message("P5\n0 1\n65535\n"), HasSubstr("size 0x1"));
  EXPECT_THAT(message("P5\n1 1\n255\nx"), HasSubstr("largest value 255"));
  EXPECT_THAT(message("P5\n2 1\n65535\nxxx"), HasSubstr("4 bytes of values, 5 expected"));
  EXPECT_THAT(message("P5 # only a comment"), HasSubstr("width, height"));
}

}  // namespace
}  // namespace haustra
