// What all commands have in common: found by going through them, so that a new one cannot be forgotten.
#include "tools/command/command_line.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <CLI/CLI.hpp>
#include <sstream>
#include <string>
#include <vector>

namespace haustra {
namespace {

using ::testing::AllOf;
using ::testing::HasSubstr;

class CommandLineTest : public testing::Test {
 protected:
  CommandLineTest() { AddCommands(app_, action_); }

  std::vector<CLI::App*> Commands() {
    return app_.get_subcommands([](const CLI::App*) { return true; });
  }

  CLI::App app_{"", "haustra"};
  std::function<int()> action_;
};

TEST_F(CommandLineTest, EveryCommandHasADescriptionQuietAndExitCodes) {
  ASSERT_GT(Commands().size(), 10u);
  for (CLI::App* command : Commands()) {
    SCOPED_TRACE(command->get_name());
    EXPECT_FALSE(command->get_description().empty());
    EXPECT_NE(command->get_option_no_throw("--quiet"), nullptr);
    EXPECT_THAT(command->help(), HasSubstr("\n  64 wrong arguments"));
  }
}

TEST_F(CommandLineTest, EveryOptionSaysWhatItIs) {
  for (CLI::App* command : Commands()) {
    for (const CLI::Option* option : command->get_options()) {
      EXPECT_FALSE(option->get_description().empty()) << command->get_name() << " " << option->get_name();
    }
  }
}

// Each option that names something to write, and how it is replaced.
TEST_F(CommandLineTest, EveryCommandThatWritesHasOverwrite) {
  int num_writing = 0;
  for (CLI::App* command : Commands()) {
    bool writes = false;
    for (const char* name : {"--out", "--html", "--csv", "--json", "--table", "--save-atlas", "--picture", "OUT"}) {
      const CLI::Option* option = command->get_option_no_throw(name);
      // A flag of that name prints.
      writes = writes || (option != nullptr && option->get_items_expected_max() > 0);
    }
    num_writing += writes;
    EXPECT_EQ(command->get_option_no_throw("--overwrite") != nullptr, writes) << command->get_name();
  }
  EXPECT_GE(num_writing, 8);
}

TEST_F(CommandLineTest, NumbersThatAreNotAllowedAreNamedWithWhatIs) {
  const auto answer = [this](std::vector<std::string> reversed) -> std::string {
    try {
      app_.parse(std::move(reversed));
    } catch (const CLI::ParseError& error) {
      return error.what();
    }
    return "accepted";
  };
  EXPECT_EQ(answer({"-1", "--first-frame", "a", "run"}), "--first-frame: '-1' is not a number from 0 on");
  EXPECT_EQ(answer({"nan", "--rate", "a", "run"}).find("accepted"), std::string::npos);
  for (const char* bad : {"0", "-2", "nan", "inf", "long"}) {
    EXPECT_EQ(answer({bad, "--seconds", "cam", "capture"}),
              std::string("--seconds: '") + bad + "' is not a number above 0");
  }
  EXPECT_EQ(answer({"2.5", "--seconds", "cam", "capture"}), "accepted");
}

TEST_F(CommandLineTest, DeviceIsChosenUnlessItIsNamed) {
  for (const char* name : {"run", "plan", "latency", "soak", "calibrate"}) {
    EXPECT_EQ(app_.get_subcommand(name)->get_option("--device")->get_default_str(), "auto") << name;
  }
}

TEST_F(CommandLineTest, DeinterlaceTakesItsThreeWordsAndNamesAnyOther) {
  for (const char* name : {"run", "latency", "calibrate", "capture"}) {
    const CLI::Option* option = app_.get_subcommand(name)->get_option("--deinterlace");
    EXPECT_EQ(option->get_default_str(), "auto") << name;
  }
  EXPECT_NO_THROW(app_.parse("run --deinterlace on", false));
  try {
    app_.parse("run --deinterlace bob", false);
    FAIL() << "bob was taken";
  } catch (const CLI::ParseError& error) {
    EXPECT_THAT(error.what(), AllOf(HasSubstr("--deinterlace"), HasSubstr("bob")));
  }
}

TEST_F(CommandLineTest, WordThatIsNoCommandIsNamedWithTheNearestOne) {
  const auto answer = [this](const std::string& typed) {
    std::ostringstream out, err;
    try {
      app_.parse(typed, false);
      return std::string("accepted");
    } catch (const CLI::ParseError& error) {
      app_.exit(error, out, err);
    }
    return out.str() + err.str();
  };
  EXPECT_EQ(answer("rnu a"), "rnu: no such command; did you mean run?\nRun with --help for more information.\n");
  EXPECT_EQ(answer("segment a"), "segment: no such command\nRun with --help for more information.\n");
  EXPECT_EQ(answer(""), "A subcommand is required\nRun with --help for more information.\n");
  EXPECT_EQ(answer("--versoin"), "--versoin: no such option\nRun with --help for more information.\n");
}

}  // namespace
}  // namespace haustra
