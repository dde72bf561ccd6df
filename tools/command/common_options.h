// Options that several commands have, in the same words.
#pragma once

#include <CLI/App.hpp>

#include "capture/sequence_options.h"

namespace haustra {

// --overwrite (output_folder.h). `overwrite` must outlive the parsing, as what follows.
void AddOverwriteFlag(CLI::App& command, bool& overwrite);

// --first-frame, --last-frame and --every-nth: the part of a sequence.
void AddFrameRangeOptions(CLI::App& command, SequenceOptions& options);

// --frame-rate: of a folder of pictures that states no times.
void AddFrameRateOption(CLI::App& command, double& frame_rate_hz);

// --deinterlace: "auto", "off" or "on" (capture/deinterlace.h).
void AddDeinterlaceOption(CLI::App& command, DeinterlaceChoice& choice);

// --quiet for the command and all below it. Takes effect when it is parsed (console.h).
void AddQuietFlags(CLI::App& app);

// What its exit codes mean, at the end of the help of the program and of each command.
void AddExitCodes(CLI::App& app);

}  // namespace haustra
