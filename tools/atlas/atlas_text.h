// The contents of an atlas file, for a person.
#pragma once

#include <cstddef>
#include <string>

#include "engine/io/saved_atlas.h"

namespace haustra {

// A few lines and one for each map. `atlas` has been verified; file_bytes: size of its file.
std::string AtlasText(const SavedAtlas& atlas, std::size_t file_bytes);

}  // namespace haustra
