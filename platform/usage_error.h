// What a person reads about wrong arguments, in place of CLI11's text: the command, the word, what would do.
#pragma once

#include <CLI/App.hpp>
#include <string>

namespace haustra {

// Two lines: what is wrong, and which --help says more. A word that nothing takes goes before what is missing: most
// often it is meant to be just that. For CLI::App::failure_message of the whole program.
std::string UsageErrorText(const CLI::App* program, const CLI::Error& error);

}  // namespace haustra
