#include "platform/realtime/cpu_list.h"

#include "hal/core/check.h"
#include "tests/fuzz/fuzz_entries.h"

namespace haustra::test {

void FuzzCpuList(std::span<const std::uint8_t> bytes) {
  const Result<CpuList> cpus = ParseCpuList({reinterpret_cast<const char*>(bytes.data()), bytes.size()});
  if (!cpus.ok()) {
    HAUSTRA_CHECK(!cpus.status().message().empty());
    return;
  }
  HAUSTRA_CHECK(cpus->any() != bytes.empty());
  const Result<CpuList> again = ParseCpuList(ToText(*cpus));
  HAUSTRA_CHECK(again.ok() && *again == *cpus);
}

}  // namespace haustra::test
