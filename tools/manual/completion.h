// Completion of a command line in a shell: commands, options, the values that an option or a word chooses from, the
// keys of --set. A value of the parser's type TEXT that nothing is chosen from is the name of a file; any other has a
// type name of its own, and nothing is offered for it. reentrant.
#pragma once

#include <CLI/App.hpp>
#include <string>
#include <vector>

namespace haustra::manual {

// `keys`: of the configuration.
std::string BashCompletion(const CLI::App& app, const std::vector<std::string>& keys);
std::string ZshCompletion(const CLI::App& app, const std::vector<std::string>& keys);

}  // namespace haustra::manual
