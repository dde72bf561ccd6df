// What all commands have in common: found by going through them, so that a new one cannot be forgotten.
#include "tools/command/command_line.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <CLI/CLI.hpp>
#include <sstream>
#include <string>
#include <vector>

#include "tests/tools/command/call_command.h"
#include "tools/plan/plan_command.h"

namespace haustra {
namespace {

using ::testing::AllOf;
using ::testing::HasSubstr;
using ::testing::Not;

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

// One list serves all commands, and two of them write what they have.
TEST_F(CommandLineTest, ExitCodesSayWhichCommandsEndWellWhenTheyAreStopped) {
  for (CLI::App* command : Commands()) {
    EXPECT_THAT(command->help(), HasSubstr("\n  130 stopped (Ctrl-C, SIGTERM, SIGHUP) before it was done; run and "
                                           "capture write what they have, and end with 0"));
  }
}

TEST_F(CommandLineTest, ExitCodesSayWhatAConfigurationThatIsNotThereIs) {
  for (CLI::App* command : Commands()) {
    EXPECT_THAT(command->help(), HasSubstr("\n  66 a file or folder to read is not there, other than a configuration"));
    EXPECT_THAT(command->help(), HasSubstr("\n  78 a configuration is wrong or not there, or "));
  }
}

TEST_F(CommandLineTest, HelpSaysHowToAskForMore) {
  EXPECT_THAT(app_.help(), HasSubstr("'haustra COMMAND --help' lists what a command takes."));
  for (CLI::App* command : Commands()) EXPECT_THAT(command->help(), Not(HasSubstr("x)"))) << "words are not counted";
}

TEST_F(CommandLineTest, TheVisionDeviceIsChosenInTheSameWay) {
  int num_choosing = 0;
  const auto check = [&](const CLI::App* command) {
    const CLI::Option* device = command->get_option_no_throw("--device");
    if (device == nullptr) return;
    EXPECT_EQ(device->get_type_name(), "TEXT:{auto,cpu,cuda}") << command->get_name();
    EXPECT_EQ(device->get_default_str(), "auto") << command->get_name();
    ++num_choosing;
  };
  for (CLI::App* command : Commands()) {
    check(command);
    for (const CLI::App* below : command->get_subcommands([](const CLI::App*) { return true; })) check(below);
  }
  EXPECT_GE(num_choosing, 7) << "run, calibrate, latency, plan, soak, surface, bench vision";
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
  EXPECT_EQ(answer({"-1", "--first-frame", "a", "run"}),
            "--first-frame: '-1' is not a whole number from 0 to 4294967295");
  EXPECT_EQ(answer({"nan", "--rate", "a", "run"}).find("accepted"), std::string::npos);
  for (const char* bad : {"0", "-2", "nan", "inf", "long"}) {
    EXPECT_EQ(answer({bad, "--seconds", "cam", "capture"}),
              std::string("--seconds: '") + bad + "' is not a number above 0");
  }
  EXPECT_EQ(answer({"2.5", "--seconds", "cam", "capture"}), "accepted");
  for (const char* bad : {"0", "-0.02", "nan", "inf", "thick"}) {
    EXPECT_EQ(answer({bad, "--voxel", "o", "--out", "a", "surface"}),
              std::string("--voxel: '") + bad + "' is not a number from 0.002 to 0.2");
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

// Depth that the run kept is searched on no device, and in no pictures.
TEST_F(CommandLineTest, WhatHasNoUseWithoutASequenceIsRefusedWithoutOne) {
  for (const std::string option : {"--device cuda", "--deinterlace on"}) {
    try {
      app_.parse("surface run --out to " + option, false);
      ADD_FAILURE() << option << " was taken";
    } catch (const CLI::ParseError& error) {
      EXPECT_THAT(error.what(), HasSubstr("--sequence")) << option;
    }
    EXPECT_NO_THROW(app_.parse("surface run --out to --sequence colon " + option, false)) << option;
  }
}

// What depth takes follows from the size of the pictures, as all the rest does.
TEST_F(CommandLineTest, PlanNeedsNoCameraForDepth) {
  const CommandAnswer answer =
      CallCommand({AddPlanCommand}, {"plan", "--width", "720", "--height", "540", "--set", "depth.enabled=true"});
  EXPECT_EQ(answer.code, kExitOk) << answer.err;
  EXPECT_THAT(answer.out, HasSubstr("depth matcher"));
}

// As in the names of frames. CLI11 by itself takes them for octal.
TEST_F(CommandLineTest, LeadingZerosChangeNoNumber) {
  app_.parse("run seq --out o --first-frame 000020 --last-frame 000089 --every-nth 010 --threads 010 --seed 010");
  const CLI::App* run = app_.get_subcommand("run");
  const auto number = [run](const char* option) { return run->get_option(option)->as<std::uint64_t>(); };
  EXPECT_EQ(number("--first-frame"), 20u);
  EXPECT_EQ(number("--last-frame"), 89u);
  EXPECT_EQ(number("--every-nth"), 10u);
  EXPECT_EQ(number("--threads"), 10u);
  EXPECT_EQ(number("--seed"), 10u);
  const std::function<void(CLI::App*)> look = [&](CLI::App* command) {
    for (const CLI::Option* option : command->get_options()) {
      EXPECT_THAT(option->get_type_name(), Not(HasSubstr("INT in ["))) << command->get_name() << option->get_name();
    }
    for (CLI::App* part : command->get_subcommands([](const CLI::App*) { return true; })) look(part);
  };
  look(&app_);
}

// CLI::Range lets nan through, and an option without a check takes inf, too.
TEST_F(CommandLineTest, EveryOptionThatTakesANumberRefusesWhatIsNone) {
  int num_options = 0;
  std::vector<CLI::App*> commands = Commands();
  for (std::size_t i = 0; i < commands.size(); ++i) {
    for (CLI::App* below : commands[i]->get_subcommands([](const CLI::App*) { return true; })) {
      commands.push_back(below);
    }
    for (CLI::Option* option : commands[i]->get_options([](const CLI::Option*) { return true; })) {
      if (option->get_type_name().find("FLOAT") == std::string::npos) continue;
      ++num_options;
      for (const std::string bad : {"nan", "-nan", "inf", "-inf"}) {
        option->clear();
        option->add_result(bad);
        EXPECT_THROW(option->run_callback(), CLI::ValidationError)
            << commands[i]->get_name() << " " << option->get_name() << " takes " << bad;
      }
    }
  }
  EXPECT_GE(num_options, 40);
}

// What somebody reads who has typed that.
class UsageErrorTest : public CommandLineTest {
 protected:
  std::string Answer(const std::string& typed) {
    std::ostringstream out, err;
    try {
      app_.parse(typed, false);
      return "accepted";
    } catch (const CLI::ParseError& error) {
      app_.exit(error, out, err);
    }
    return out.str() + err.str();
  }
  // Without the second line, which is the same for all words of a command.
  std::string FirstLine(const std::string& typed) {
    const std::string answer = Answer(typed);
    return answer.substr(0, answer.find('\n'));
  }
};

TEST_F(UsageErrorTest, WordThatIsNoCommandIsNamedWithTheNearestOne) {
  EXPECT_EQ(Answer("rnu a"),
            "haustra: rnu: no such command; did you mean run?\n'haustra --help' lists the commands.\n");
  EXPECT_EQ(FirstLine("segment a"), "haustra: segment: no such command");
  EXPECT_EQ(FirstLine(""), "haustra: a command is missing");
  EXPECT_EQ(FirstLine("--hepl"), "haustra: --hepl: no such option; did you mean --help?");
  EXPECT_EQ(FirstLine("bench visoin"), "haustra bench: visoin: no such command; did you mean vision?");
  EXPECT_EQ(FirstLine("bench"), "haustra bench: a command is missing");
}

TEST_F(UsageErrorTest, OptionThatIsNoneIsNamedBeforeWhatIsMissing) {
  EXPECT_EQ(Answer("run seq --ot o"),
            "haustra run: --ot: no such option; did you mean --out?\n'haustra run --help' lists what it takes.\n");
  EXPECT_EQ(FirstLine("run seq --every_nth=3"), "haustra run: --every_nth: no such option; did you mean --every-nth?");
  EXPECT_EQ(FirstLine("run seq --undistort"), "haustra run: --undistort: no such option");
  EXPECT_EQ(FirstLine("report o --hmtl page.html"), "haustra report: --hmtl: no such option; did you mean --html?");
  EXPECT_EQ(FirstLine("export o --format tum"), "haustra export: --out is required");
  EXPECT_EQ(FirstLine("run seq seq"), "haustra run: seq: one word too many");
}

TEST_F(UsageErrorTest, ValueThatIsNotAllowedIsNamedWithWhatIs) {
  EXPECT_EQ(FirstLine("run seq --device gpu"), "haustra run: --device: 'gpu' is none of auto,cpu,cuda");
  EXPECT_EQ(FirstLine("run seq --threads 300"), "haustra run: --threads: '300' is not a whole number from 0 to 64");
  EXPECT_EQ(FirstLine("latency --seconds 0"), "haustra latency: --seconds: '0' is not a number from 0.1 to 86400");
  EXPECT_EQ(FirstLine("control status --timeout long"),
            "haustra control: --timeout: 'long' is not a number from 0.1 to 3600");
  EXPECT_EQ(FirstLine("capture cam --frames 2.5"), "haustra capture: --frames: '2.5' is not a number that it takes");
  EXPECT_EQ(FirstLine("render out --stool much"), "haustra render: --stool: 'much' is not a number from 0 to 100");
  EXPECT_EQ(FirstLine("run seq --out"), "haustra run: --out: its value is missing");
  EXPECT_EQ(FirstLine("run seq --out a --out b"), "haustra run: --out: given 2 times, but takes one value");
  for (const char* seed : {"99999999999999999999999", "1.5", "18446744073709551616"}) {
    EXPECT_EQ(FirstLine(std::string("run seq --seed ") + seed),
              std::string("haustra run: --seed: '") + seed + "' is not a whole number from 0 to 18446744073709551615");
  }
  EXPECT_EQ(FirstLine("run seq --last-frame 4294967296"),
            "haustra run: --last-frame: '4294967296' is not a whole number from 0 to 4294967295");
  for (const char* command : {"run", "calibrate"}) {
    EXPECT_EQ(FirstLine(std::string(command) + " seq --out o --last-frame 4 --first-frame 5"),
              std::string("haustra ") + command + ": --last-frame: 4 lies before --first-frame, 5");
    EXPECT_EQ(FirstLine(std::string(command) + " seq --out o --first-frame 5 --last-frame 5"), "accepted");
  }
  EXPECT_EQ(FirstLine("render out --rate 0"), "haustra render: --rate: '0' is not a number from 1 to 120");
  EXPECT_EQ(FirstLine("render out --seconds 0"), "haustra render: --seconds: '0' is not a number from 0.2 to 3600");
  EXPECT_EQ(FirstLine("render out --breathing 50"), "haustra render: --breathing: '50' is not a number from 0 to 15");
  EXPECT_EQ(FirstLine("render out --threads -2"),
            "haustra render: --threads: '-2' is not a whole number from 0 to 256");
}

}  // namespace
}  // namespace haustra
