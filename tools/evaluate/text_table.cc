#include "tools/evaluate/text_table.h"

#include <algorithm>

#include "tools/evaluate/number_text.h"

namespace haustra::evaluate {
namespace {

using TableLine = std::vector<std::string>;

// Number of code points, so that "±" is as wide as it looks.
std::size_t WidthOf(const std::string& text) {
  return static_cast<std::size_t>(
      std::count_if(text.begin(), text.end(), [](char c) { return (static_cast<unsigned char>(c) & 0xc0) != 0x80; }));
}

// Pads to a width in code points: the padding of number_text.h counts bytes.
std::string Pad(const std::string& text, std::size_t width, bool is_left) {
  const std::size_t bytes = width + text.size() - WidthOf(text);
  return is_left ? PadRight(text, bytes) : PadLeft(text, bytes);
}

std::vector<std::size_t> ColumnWidths(const std::vector<TableLine>& lines) {
  std::vector<std::size_t> widths(lines[0].size(), 0);
  for (const TableLine& line : lines) {
    for (std::size_t i = 0; i < line.size(); ++i) widths[i] = std::max(widths[i], WidthOf(line[i]));
  }
  return widths;
}

// The header with the group before each name.
TableLine FullHeader(const TextTable& table) {
  TableLine header = table.header;
  std::size_t column = 0;
  for (const TextTable::Group& group : table.groups) {
    for (std::size_t i = 0; i < group.columns && column < header.size(); ++i, ++column) {
      if (!group.name.empty()) header[column] = group.name + " " + header[column];
    }
  }
  return header;
}

// A field with a comma or a quote goes into quotes (RFC 4180).
std::string CsvField(const std::string& text) {
  if (text == kNothing) return {};
  if (text.find_first_of(",\"\n") == std::string::npos) return text;
  std::string quoted = "\"";
  for (const char c : text) quoted += c == '"' ? std::string("\"\"") : std::string(1, c);
  return quoted + "\"";
}

std::string MarkdownField(const std::string& text) {
  std::string escaped;
  for (const char c : text) escaped += c == '|' ? std::string("\\|") : std::string(1, c == '\n' ? ' ' : c);
  return escaped;
}

std::string ToCsv(const TextTable& table) {
  std::vector<TableLine> lines{FullHeader(table)};
  lines.insert(lines.end(), table.rows.begin(), table.rows.end());
  std::string text;
  for (const TableLine& line : lines) {
    for (std::size_t i = 0; i < line.size(); ++i) text += (i > 0 ? "," : "") + CsvField(line[i]);
    text += "\n";
  }
  return text;
}

std::string ToMarkdown(const TextTable& table) {
  std::vector<TableLine> lines{FullHeader(table)};
  lines.insert(lines.end(), table.rows.begin(), table.rows.end());
  for (TableLine& line : lines) std::transform(line.begin(), line.end(), line.begin(), MarkdownField);
  const std::vector<std::size_t> widths = ColumnWidths(lines);
  std::string text = table.title.empty() ? std::string() : "## " + table.title + "\n\n";
  for (std::size_t row = 0; row < lines.size(); ++row) {
    text += "|";
    for (std::size_t i = 0; i < widths.size(); ++i)
      text += " " + Pad(lines[row][i], widths[i], i < table.num_left) + " |";
    text += "\n";
    if (row > 0) continue;
    text += "|";
    for (std::size_t i = 0; i < widths.size(); ++i) {
      text += std::string(widths[i] + 1, '-') + (i < table.num_left ? "-|" : ":|");
    }
    text += "\n";
  }
  return text;
}

std::string ToText(const TextTable& table) {
  std::vector<TableLine> lines{table.header};
  lines.insert(lines.end(), table.rows.begin(), table.rows.end());
  std::vector<std::size_t> widths = ColumnWidths(lines);
  constexpr std::size_t kGap = 2;
  std::string text;
  if (!table.groups.empty()) {
    std::size_t column = 0;
    std::string heading;
    for (const TextTable::Group& group : table.groups) {
      if (column >= widths.size()) break;
      const std::size_t last = std::min(column + group.columns, widths.size()) - 1;
      std::size_t width = (last - column) * kGap;
      for (std::size_t i = column; i <= last; ++i) width += widths[i];
      // A name wider than its columns widens the last of them.
      if (const std::size_t name_width = WidthOf(group.name); name_width > width) {
        widths[last] += name_width - width;
        width = name_width;
      }
      heading += std::string(column > 0 ? kGap : 0, ' ') + Pad(group.name, width, column < table.num_left);
      column = last + 1;
    }
    text += heading.erase(heading.find_last_not_of(' ') + 1) + "\n";
  }
  for (const TableLine& line : lines) {
    std::string row;
    for (std::size_t i = 0; i < line.size(); ++i) {
      row += std::string(i > 0 ? kGap : 0, ' ') + Pad(line[i], widths[i], i < table.num_left);
    }
    text += row.erase(row.find_last_not_of(' ') + 1) + "\n";
  }
  return text;
}

}  // namespace

std::string FormatTable(const TextTable& table, TableFormat format) {
  switch (format) {
    case TableFormat::kText: return ToText(table);
    case TableFormat::kCsv: return ToCsv(table);
    case TableFormat::kMarkdown: return ToMarkdown(table);
  }
  return {};
}

}  // namespace haustra::evaluate
