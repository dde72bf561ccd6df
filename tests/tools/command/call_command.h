// Calls subcommands of the program as its main function does, in the process of the test.
#pragma once

#include <gtest/gtest.h>

#include <CLI/CLI.hpp>
#include <functional>
#include <initializer_list>
#include <string>
#include <vector>

#include "tools/exit_codes.h"

namespace haustra {

using AddCommand = void (*)(CLI::App&, std::function<int()>&);

struct CommandAnswer {
  int code = kExitUsage;  // also when the arguments cannot be parsed: nothing is called then
  std::string out, err;   // what it wrote on stdout and stderr
};

// `arguments` begin with the name of one of the commands.
inline CommandAnswer CallCommand(std::initializer_list<AddCommand> commands,
                                 const std::vector<std::string>& arguments) {
  CLI::App app;
  std::function<int()> action;
  for (const AddCommand add : commands) add(app, action);
  CommandAnswer answer;
  try {
    app.parse(std::vector<std::string>(arguments.rbegin(), arguments.rend()));
  } catch (const CLI::ParseError&) {
    return answer;
  }
  ::testing::internal::CaptureStdout();
  ::testing::internal::CaptureStderr();
  answer.code = action();
  answer.out = ::testing::internal::GetCapturedStdout();
  answer.err = ::testing::internal::GetCapturedStderr();
  return answer;
}

}  // namespace haustra
