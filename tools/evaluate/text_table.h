// A table of texts and how it looks in a terminal, in a CSV file and in Markdown (and, tools/report, in a page).
#pragma once

#include <string>
#include <vector>

namespace haustra::evaluate {

enum class TableFormat { kText, kCsv, kMarkdown };

struct TextTable {
  // A heading over the next `columns` columns.
  struct Group {
    std::string name;  // may be empty
    std::size_t columns = 1;
  };

  std::string title;
  std::vector<Group> groups;  // none, or over all columns
  std::vector<std::string> header;
  std::vector<std::vector<std::string>> rows;  // as many fields as the header; kNothing: there is no such value
  std::size_t num_left = 1;                    // first columns that hold words, not numbers
};

// Shown for a value that a run does not have; blank in a CSV file, where a dash would not be a number.
inline constexpr const char* kNothing = "-";

// Text and CSV have the header line and no title; CSV puts the group before the name ("largest map #KF"). Markdown
// has the title as a heading of the second level when there is one. reentrant.
std::string FormatTable(const TextTable& table, TableFormat format);

}  // namespace haustra::evaluate
