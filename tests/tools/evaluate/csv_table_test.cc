#include "tools/evaluate/csv_table.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "tests/tools/evaluate/text_folder.h"

namespace haustra::evaluate {
namespace {

using ::testing::HasSubstr;

class CsvTableTest : public ::testing::Test {
 protected:
  Result<CsvTable> Read(const std::string& text) {
    return CsvTable::Read(folder_.Write("table.csv", text), {"frame", "ms"});
  }
  TextFolder folder_;
};

TEST_F(CsvTableTest, ColumnsAreFoundByName) {
  const Result<CsvTable> table = Read("ms,extra,frame\n1.5,x,7\n-2,y,8\n");
  ASSERT_TRUE(table.ok()) << table.status().ToString();
  ASSERT_EQ(table->num_rows(), 2u);
  EXPECT_EQ(*table->Integer(0, 0), 7);
  EXPECT_EQ(*table->Number(0, 1), 1.5);
  EXPECT_EQ(table->Text(1, 1), "-2");
}

TEST_F(CsvTableTest, CommentsEmptyLinesBlanksAndWindowsLineEndsAreFine) {
  const Result<CsvTable> table = Read("# a comment\r\n\r\nframe , ms\r\n 1 , 2.0 \r\n\r\n# more\r\n3,4\r\n");
  ASSERT_TRUE(table.ok()) << table.status().ToString();
  ASSERT_EQ(table->num_rows(), 2u);
  EXPECT_EQ(*table->Integer(1, 0), 3);
  EXPECT_EQ(*table->Number(0, 1), 2.0);
}

TEST_F(CsvTableTest, HeaderAloneIsAnEmptyTable) { EXPECT_EQ(Read("frame,ms\n")->num_rows(), 0u); }

TEST_F(CsvTableTest, MissingFileIsNotFound) {
  const Result<CsvTable> table = CsvTable::Read(folder_.At("missing.csv"), {"a"});
  EXPECT_EQ(table.code(), StatusCode::kNotFound);
  EXPECT_THAT(table.status().message(), HasSubstr("missing.csv: no such file"));
}

TEST_F(CsvTableTest, FolderIsNotAFile) {
  EXPECT_EQ(CsvTable::Read(folder_.path(), {"a"}).code(), StatusCode::kDataLoss);
}

TEST_F(CsvTableTest, EmptyFileIsSaidToBeEmpty) {
  EXPECT_THAT(Read("").status().message(), HasSubstr("table.csv: empty"));
}

TEST_F(CsvTableTest, MissingAndDoubledColumnsAreNamed) {
  EXPECT_THAT(Read("frame,time\n").status().message(), HasSubstr("table.csv:1: the header has no column 'ms'"));
  EXPECT_THAT(Read("frame,ms,ms\n").status().message(), HasSubstr("column 'ms' twice"));
}

TEST_F(CsvTableTest, WrongNumberOfFieldsIsNamedWithItsLine) {
  EXPECT_THAT(Read("frame,ms\n1,2\n3\n").status().message(), HasSubstr("table.csv:3: 1 fields, the header has 2"));
}

TEST_F(CsvTableTest, FieldThatIsNoNumberIsNamedWithLineAndColumn) {
  const Result<CsvTable> table = Read("frame,ms\n1,2\n1.5,nan\n,1e400\n");
  ASSERT_TRUE(table.ok());
  EXPECT_THAT(table->Integer(1, 0).status().message(), HasSubstr("table.csv:3: frame is '1.5', not an integer"));
  EXPECT_THAT(table->Number(1, 1).status().message(), HasSubstr("ms is 'nan', not a finite number"));
  EXPECT_FALSE(table->Integer(2, 0).ok());
  EXPECT_FALSE(table->Number(2, 1).ok());
}

}  // namespace
}  // namespace haustra::evaluate
