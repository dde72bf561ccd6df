// A set of processors as Linux writes it: "0,2-5". reentrant.
#pragma once

#include <bitset>
#include <string>
#include <string_view>

#include "hal/core/status.h"

namespace haustra {

inline constexpr int kMaxCpus = 1024;  // as CPU_SETSIZE
using CpuList = std::bitset<kMaxCpus>;

// Empty text: no processor named. kInvalidArgument: not such a list, or a number from kMaxCpus on.
Result<CpuList> ParseCpuList(std::string_view text);
std::string ToText(const CpuList& cpus);

}  // namespace haustra
