#include "platform/realtime/cpu_list.h"

#include <charconv>

namespace haustra {
namespace {

// Takes a number off the front of the text; -1: there is none.
int TakeNumber(std::string_view* text) {
  int number = -1;
  const auto [end, error] = std::from_chars(text->data(), text->data() + text->size(), number);
  if (error != std::errc() || number < 0) return -1;
  text->remove_prefix(static_cast<std::size_t>(end - text->data()));
  return number;
}

}  // namespace

Result<CpuList> ParseCpuList(std::string_view text) {
  const auto refuse = [text](const std::string& why) {
    return InvalidArgument("'" + std::string(text) + "': " + why + "; write processors like 3 or 0,2-5");
  };
  CpuList cpus;
  std::string_view rest = text;
  while (!rest.empty()) {
    const int first = TakeNumber(&rest);
    int last = first;
    if (!rest.empty() && rest.front() == '-') {
      rest.remove_prefix(1);
      last = TakeNumber(&rest);
    }
    if (first < 0 || last < first) return refuse("not a list of processors");
    if (last >= kMaxCpus) return refuse("no processor has the number " + std::to_string(last));
    for (int cpu = first; cpu <= last; ++cpu) cpus.set(static_cast<std::size_t>(cpu));
    if (rest.empty()) break;
    if (rest.front() != ',' || rest.size() == 1) return refuse("not a list of processors");
    rest.remove_prefix(1);
  }
  return cpus;
}

std::string ToText(const CpuList& cpus) {
  std::string text;
  for (int first = 0; first < kMaxCpus; ++first) {
    if (!cpus[static_cast<std::size_t>(first)]) continue;
    int last = first;
    while (last + 1 < kMaxCpus && cpus[static_cast<std::size_t>(last + 1)]) ++last;
    if (!text.empty()) text += ",";
    text += std::to_string(first);
    if (last > first) text += "-" + std::to_string(last);
    first = last;
  }
  return text;
}

}  // namespace haustra
