#include "tools/evaluate/csv_table.h"

#include <algorithm>
#include <optional>

#include "capture/files/whole_file.h"
#include "tools/evaluate/text_input.h"

namespace haustra::evaluate {
namespace {

std::string At(const std::string& path, std::size_t line) { return path + ":" + std::to_string(line) + ": "; }

}  // namespace

Result<CsvTable> CsvTable::Read(const std::string& path, std::initializer_list<std::string_view> columns) {
  HAUSTRA_ASSIGN(const std::string text, ReadWholeText(path));
  CsvTable table;
  table.path_ = path;
  table.columns_.assign(columns.begin(), columns.end());

  std::vector<std::size_t> positions;  // in the file, of each column asked for
  std::size_t num_fields = 0;
  const std::vector<std::string_view> lines = SplitLines(text);
  for (std::size_t i = 0; i < lines.size(); ++i) {
    if (SplitBlanks(lines[i]).empty() || lines[i].front() == '#') continue;
    const std::vector<std::string_view> fields = SplitFields(lines[i], ',');
    if (num_fields == 0) {
      num_fields = fields.size();
      for (const std::string_view column : columns) {
        const auto found = std::find(fields.begin(), fields.end(), column);
        if (found == fields.end()) {
          return InvalidArgument(At(path, i + 1) + "the header has no column '" + std::string(column) + "'");
        }
        if (std::find(found + 1, fields.end(), column) != fields.end()) {
          return InvalidArgument(At(path, i + 1) + "the header has column '" + std::string(column) + "' twice");
        }
        positions.push_back(static_cast<std::size_t>(found - fields.begin()));
      }
      continue;
    }
    if (fields.size() != num_fields) {
      return InvalidArgument(At(path, i + 1) + std::to_string(fields.size()) + " fields, the header has " +
                             std::to_string(num_fields));
    }
    Row row{static_cast<int>(i + 1), {}};
    for (const std::size_t position : positions) row.fields.emplace_back(fields[position]);
    table.rows_.push_back(std::move(row));
  }
  if (num_fields == 0) return InvalidArgument(path + ": empty, not even a header");
  return table;
}

std::string CsvTable::Where(std::size_t row) const { return At(path_, rows_[row].line); }

Status CsvTable::BadField(std::size_t row, std::size_t column, const char* expected) const {
  return InvalidArgument(Where(row) + columns_[column] + " is '" + Text(row, column) + "', not " + expected);
}

Result<std::int64_t> CsvTable::Integer(std::size_t row, std::size_t column) const {
  const std::optional<std::int64_t> value = ParseInteger(Text(row, column));
  if (!value) return BadField(row, column, "an integer");
  return *value;
}

Result<double> CsvTable::Number(std::size_t row, std::size_t column) const {
  const std::optional<double> value = ParseNumber(Text(row, column));
  if (!value) return BadField(row, column, "a finite number");
  return *value;
}

}  // namespace haustra::evaluate
