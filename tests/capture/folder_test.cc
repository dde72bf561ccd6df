#include "capture/dataset/folder.h"

#include <algorithm>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "tests/capture/temp_folder.h"

namespace haustra::capture::internal {
namespace {

using ::testing::ElementsAre;
using ::testing::HasSubstr;
using ::testing::IsEmpty;

TEST(NaturalLess, OrdersNumbersByValue) {
  std::vector<std::string> names = {"10_color.png", "9_color.png", "100_color.png", "b", "a10", "a9b", "a9"};
  std::sort(names.begin(), names.end(), NaturalLess);
  EXPECT_THAT(names, ElementsAre("9_color.png", "10_color.png", "100_color.png", "a9", "a9b", "a10", "b"));
}

TEST(NaturalLess, IsAStrictOrder) {
  EXPECT_FALSE(NaturalLess("a01", "a01"));
  EXPECT_NE(NaturalLess("a01", "a1"), NaturalLess("a1", "a01"));
  EXPECT_TRUE(NaturalLess("99999999999999999999998", "99999999999999999999999"));
}

TEST(FileNames, LeavesOutFoldersAndHiddenFiles) {
  const TempFolder folder;
  folder.Write("2.png", "");
  folder.Write("10.png", "");
  folder.Write(".hidden", "");
  folder.Write("sub/1.png", "");
  EXPECT_THAT(FileNames(folder.path()).value(), ElementsAre("2.png", "10.png"));
}

TEST(FileNames, MissingFolderAndFileAreNamed) {
  const TempFolder folder;
  EXPECT_EQ(FileNames(folder.Path("no")).code(), StatusCode::kNotFound);
  EXPECT_EQ(FileNames(folder.Write("file", "")).code(), StatusCode::kInvalidArgument);
}

TEST(Extensions, AreToldWithoutRegardToCase) {
  EXPECT_TRUE(HasImageExtension("A.JPG"));
  EXPECT_TRUE(HasImageExtension("a.jpeg"));
  EXPECT_FALSE(HasImageExtension("a.tiff"));
  EXPECT_FALSE(HasImageExtension("png"));
  EXPECT_TRUE(HasVideoExtension("Seq_001.MOV"));
  EXPECT_FALSE(HasVideoExtension("a.png"));
}

TEST(ContentLines, SkipsCommentsAndKeepsNumbers) {
  const std::vector<TextLine> lines = ContentLines("# head\r\n\r\n  a b \r\n#c\nlast");
  ASSERT_EQ(lines.size(), 2u);
  EXPECT_EQ(lines[0].number, 3);
  EXPECT_EQ(lines[0].text, "a b");
  EXPECT_EQ(lines[1].number, 5);
  EXPECT_EQ(lines[1].text, "last");
  EXPECT_THAT(ContentLines(""), IsEmpty());
}

TEST(SplitFields, TreatsBlanksAsOneAndCommasApart) {
  EXPECT_THAT(SplitFields("a  b\tc", ' '), ElementsAre("a", "b", "c"));
  EXPECT_THAT(SplitFields("a, b,,", ','), ElementsAre("a", "b", "", ""));
}

TEST(StampList, NamesTheLineThatGoesBackAndTheOneBefore) {
  StampList stamps("times.txt");
  ASSERT_TRUE(stamps.Add(1, 0).ok());
  ASSERT_TRUE(stamps.Add(3, 40'000'000).ok());
  const Status repeated = stamps.Add(4, 40'000'000);
  EXPECT_EQ(repeated.code(), StatusCode::kInvalidArgument);
  EXPECT_THAT(repeated.message(), HasSubstr("times.txt:4: time stamp 0.040000000 s repeats that of line 3"));
  EXPECT_THAT(stamps.Add(5, 39'000'000).message(), HasSubstr("times.txt:5: time stamp 0.039000000 s is earlier than"));
}

}  // namespace
}  // namespace haustra::capture::internal
