// A table with a header line. Columns are found by name, in any order; columns that nobody asked for are ignored, so a
// newer writer does not break an older reader. Empty lines and lines that begin with '#' are skipped. reentrant.
#pragma once

#include <cstdint>
#include <initializer_list>
#include <string>
#include <string_view>
#include <vector>

#include "hal/core/status.h"

namespace haustra::evaluate {

class CsvTable {
 public:
  // kNotFound, kUnavailable: the file. kInvalidArgument: no header, a column is missing or there twice, a line has
  // another number of fields than the header. Messages name file and line.
  static Result<CsvTable> Read(const std::string& path, std::initializer_list<std::string_view> columns);

  std::size_t num_rows() const { return rows_.size(); }
  // Columns are numbered as they were asked for.
  const std::string& Text(std::size_t row, std::size_t column) const { return rows_[row].fields[column]; }
  // kInvalidArgument with file, line, column name and value.
  Result<std::int64_t> Integer(std::size_t row, std::size_t column) const;
  Result<double> Number(std::size_t row, std::size_t column) const;
  const std::string& column(std::size_t column) const { return columns_[column]; }
  // "frames.csv:12: "
  std::string Where(std::size_t row) const;

 private:
  struct Row {
    int line = 0;
    std::vector<std::string> fields;
  };

  Status BadField(std::size_t row, std::size_t column, const char* expected) const;

  std::string path_;
  std::vector<std::string> columns_;
  std::vector<Row> rows_;
};

}  // namespace haustra::evaluate
