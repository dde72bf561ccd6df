#include "platform/usage_error.h"

#include <CLI/CLI.hpp>
#include <algorithm>
#include <regex>
#include <utility>
#include <vector>

#include "hal/core/edit_distance.h"

namespace haustra {
namespace {

constexpr std::size_t kMaxTypingErrors = 2;

// The command that the arguments are for.
const CLI::App& Addressed(const CLI::App* program) {
  while (!program->get_subcommands().empty()) program = program->get_subcommands().back();
  return *program;
}

std::string FullName(const CLI::App& command) {
  const CLI::App* parent = command.get_parent();
  return (parent == nullptr ? "" : FullName(*parent) + " ") + command.get_name();
}

std::vector<const CLI::App*> CommandsOf(const CLI::App& command) {
  return command.get_subcommands([](const CLI::App*) { return true; });
}

// "; did you mean ...?" or nothing.
std::string Suggestion(const std::string& word, const std::vector<std::string>& known) {
  const auto distance = [&](const std::string& name) { return EditDistance(name, word, LetterCase::kIgnored); };
  const auto nearest = std::min_element(known.begin(), known.end(), [&](const std::string& a, const std::string& b) {
    return distance(a) < distance(b);
  });
  if (nearest == known.end() || distance(*nearest) > kMaxTypingErrors) return {};
  return "; did you mean " + *nearest + "?";
}

std::string UnknownWordText(const CLI::App& command, const std::vector<std::string>& words) {
  const auto option = std::find_if(words.begin(), words.end(), [](const auto& word) { return word.starts_with('-'); });
  std::vector<std::string> known;
  if (option != words.end()) {
    const std::string name = option->substr(0, option->find('='));
    for (const CLI::Option* other : command.get_options()) {
      for (const std::string& long_name : other->get_lnames()) known.push_back("--" + long_name);
    }
    return name + ": no such option" + Suggestion(name, known);
  }
  const std::string& word = words.front();
  for (const CLI::App* other : CommandsOf(command)) known.push_back(other->get_name());
  return word + (known.empty() ? ": one word too many" : ": no such command") + Suggestion(word, known);
}

// Where CLI11 has other words one day, its own are shown.
std::string Reworded(std::string text) {
  static const std::pair<std::regex, const char*> kWords[] = {
      {std::regex(R"((\.\d*[1-9])0+\b)"), "$1"},
      {std::regex(R"((\d)\.0+\b)"), "$1"},
      {std::regex(R"(: Value (.*) not in range (\S+) to (\S+))"), ": '$1' is not a number from $2 to $3"},
      {std::regex(R"(: (.*) not in \{(.*)\})"), ": '$1' is none of $2"},
      {std::regex(R"(Could not convert: (\S+) = (.*))"), "$1: '$2' is not a number that it takes"},
      {std::regex(R"(: At Most 1 required but received (\d+))"), ": given $1 times, but takes one value"},
      {std::regex(R"(: \d+ required \S+ missing)"), ": its value is missing"},
      {std::regex("A subcommand is required"), "a command is missing"},
  };
  for (const auto& [pattern, words] : kWords) text = std::regex_replace(text, pattern, words);
  return text;
}

}  // namespace

std::string UsageErrorText(const CLI::App* program, const CLI::Error& error) {
  const CLI::App& command = Addressed(program);
  const std::vector<std::string> unknown = command.remaining();
  const std::string what = unknown.empty() ? Reworded(error.what()) : UnknownWordText(command, unknown);
  const std::string name = FullName(command);
  return name + ": " + what + "\n'" + name + " --help' lists " +
         (CommandsOf(command).empty() ? "what it takes" : "the commands") + ".\n";
}

}  // namespace haustra
