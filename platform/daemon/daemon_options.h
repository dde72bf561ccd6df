// The arguments of haustrad: what it reads, and what its help and its manual page are made from.
#pragma once

#include <CLI/App.hpp>
#include <string>
#include <vector>

namespace haustra {

struct DaemonArguments {
  std::string config;                    // file; empty: the defaults
  std::vector<std::string> assignments;  // section.key=value, over the file
  std::string source;                    // the same as source.path
  bool check_config = false;
  bool print_config = false;
};

// `arguments` must outlive the parsing.
void AddDaemonOptions(CLI::App& app, DaemonArguments& arguments);

}  // namespace haustra
