#include "tools/command/common_options.h"

#include <CLI/CLI.hpp>
#include <string>
#include <vector>

#include "tools/command/console.h"
#include "tools/command/number_checks.h"
#include "tools/exit_codes.h"

namespace haustra {

void AddOverwriteFlag(CLI::App& command, bool& overwrite) {
  command.add_flag("--overwrite", overwrite, "Replace what is there already");
}

void AddFrameRangeOptions(CLI::App& command, SequenceOptions& options) {
  command.add_option("--first-frame", options.first_frame, "First frame of the sequence to use, counted from 0")
      ->transform(WholeNumber<std::uint32_t>());
  // Options are converted in the order in which they are added, so the first frame is known.
  command.add_option("--last-frame", options.last_frame, "Last frame of the sequence to use")
      ->transform(WholeNumber<std::uint32_t>())
      ->check([&options](const std::string& text) {
        if (std::stoull(text) >= options.first_frame) return std::string();
        return text + " lies before --first-frame, " + std::to_string(options.first_frame);
      });
  command.add_option("--every-nth", options.every_nth, "Use only every n-th frame")
      ->transform(WholeNumberBetween(1u, 1000u))
      ->capture_default_str();
}

void AddFrameRateOption(CLI::App& command, double& frame_rate_hz) {
  command
      .add_option("--frame-rate", frame_rate_hz,
                  "Frames a second of a folder of pictures without times.txt (default: that of the calibration)")
      ->check(NumberBetween(0.1, 1000.0));
}

void AddDeinterlaceOption(CLI::App& command, DeinterlaceChoice& choice) {
  command
      .add_option_function<std::string>(
          "--deinterlace", [&choice](const std::string& text) { choice = ParseDeinterlaceChoice(text).value(); },
          "Use one field of pictures that two were woven into; auto: where it shows")
      ->check(CLI::IsMember({"auto", "off", "on"}))
      ->default_str("auto");
}

void AddQuietFlags(CLI::App& app) {
  for (CLI::App* command : app.get_subcommands([](const CLI::App*) { return true; })) {
    command->add_flag_callback(
        "--quiet", [] { console::SetQuiet(true); }, "Say nothing but what was asked for, warnings and errors");
    AddQuietFlags(*command);
  }
}

void AddExitCodes(CLI::App& app) {
  std::string text = ExitCodesText(&ExitCodeMeaning::of_haustra);
  const std::vector<CLI::App*> commands = app.get_subcommands([](const CLI::App*) { return true; });
  if (!commands.empty()) text = "'" + app.get_name() + " COMMAND --help' lists what a command takes.\n\n" + text;
  app.footer(text);
  for (CLI::App* command : commands) AddExitCodes(*command);
}

}  // namespace haustra
