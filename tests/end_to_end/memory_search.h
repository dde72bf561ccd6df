// Looks for bytes in the memory of another process.
#pragma once

#include <sys/types.h>

#include <cstdint>
#include <set>
#include <string>
#include <vector>

namespace haustra::end_to_end {

inline constexpr int kPartBytes = 32;

// Pieces of `bytes`, kPartBytes long and so varied that they are hardly found anywhere by chance; at most `num_parts`,
// the same ones each time. `bytes` is longer than one piece.
std::set<std::string> TellingParts(const std::string& bytes, int num_parts);

struct PartFound {
  std::string part;
  std::uint64_t address = 0;
  std::string mapping;  // line of /proc/PID/maps
};

// Every place where one of the parts stands, in the pages that the process may write and has in memory. Whoever asks
// must be allowed to trace the process.
std::vector<PartFound> FindInMemory(pid_t pid, const std::set<std::string>& parts);

// How many of the parts were found.
std::size_t NumFound(const std::set<std::string>& parts, const std::vector<PartFound>& found);
// Where they were found and what it is, a line each.
std::string PlacesText(const std::vector<PartFound>& found);

}  // namespace haustra::end_to_end
