// A recording that shows two views of its scene in each picture. thread-bound(main).
#pragma once

#include <string>

#include "capture/sequence_options.h"

namespace haustra {

// What to say of it, and what to do about it; empty: its first pictures show one view, or cannot be read. Reads them
// anew: not for cameras.
std::string TwoViewsRemark(const std::string& sequence, const SequenceOptions& options);

}  // namespace haustra
