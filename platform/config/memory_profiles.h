// The memory profiles: one name for all capacities of the section `memory`. Single keys override what a profile says.
#pragma once

#include <string>
#include <string_view>
#include <vector>

namespace haustra {

// small, medium, large.
std::vector<std::string> MemoryProfileNames();

// The profile as the text of a configuration file, with the reason of each value; empty for an unknown name.
std::string_view MemoryProfileText(std::string_view name);

}  // namespace haustra
