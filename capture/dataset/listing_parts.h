// What the listings of all layouts have in common. Errors as in sequence_listing.h.
#pragma once

#include <string>
#include <vector>

#include "capture/dataset/sequence_listing.h"
#include "capture/sequence_options.h"
#include "hal/core/status.h"

namespace haustra::capture::internal {

inline constexpr std::size_t kMaxTextFileBytes = std::size_t{256} << 20;

// The calibration of the options, or else the file of the sequence at `own_path` (empty: the layout has none). When
// there is neither, kNotFound with `advice` in the message.
Status AddCalibration(const SequenceOptions& options, const std::string& own_path, const std::string& advice,
                      SequenceListing* listing);

// The mask of the options, or else mask.png of the folder when there is one.
void AddMask(const SequenceOptions& options, SequenceListing* listing);

// Time stamps k / rate_hz for image numbers that need not be contiguous.
std::vector<std::int64_t> StampsAtRate(const std::vector<std::int64_t>& numbers, double rate_hz);

}  // namespace haustra::capture::internal
