// Completion of the command line of haustra in a shell: commands, options, the values that an option chooses from, the
// keys of --set; else names of files. reentrant.
#pragma once

#include <CLI/App.hpp>
#include <string>
#include <vector>

namespace haustra::manual {

// `keys`: of the configuration.
std::string BashCompletion(const CLI::App& app, const std::vector<std::string>& keys);
std::string ZshCompletion(const CLI::App& app, const std::vector<std::string>& keys);

}  // namespace haustra::manual
