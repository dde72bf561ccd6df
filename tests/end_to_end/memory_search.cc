#include "tests/end_to_end/memory_search.h"

#include <fcntl.h>
#include <gtest/gtest.h>
#include <unistd.h>

#include <algorithm>
#include <bitset>
#include <cstdio>
#include <cstring>
#include <fstream>
#include <random>
#include <unordered_map>

namespace haustra::end_to_end {
namespace {

constexpr std::size_t kPage = 4096;
constexpr std::size_t kChunkPages = 1024;

std::uint32_t FirstWord(const char* bytes) {
  std::uint32_t word = 0;
  std::memcpy(&word, bytes, sizeof word);
  return word;
}

bool IsZero(const char* eight_bytes) {
  std::uint64_t word = 0;
  std::memcpy(&word, eight_bytes, sizeof word);
  return word == 0;
}

// The parts by their first four bytes, behind a table that turns most places away at once.
class PartIndex {
 public:
  explicit PartIndex(const std::set<std::string>& parts) : may_begin_(std::size_t{1} << kBits) {
    for (const std::string& part : parts) {
      may_begin_[Slot(FirstWord(part.data()))] = true;
      by_first_word_.emplace(FirstWord(part.data()), &part);
    }
  }

  void Search(const std::vector<char>& bytes, std::uint64_t address, const std::string& mapping,
              std::vector<PartFound>* found) const {
    for (std::size_t at = 0; at + kPartBytes <= bytes.size(); ++at) {
      // Most of the memory is pools that nothing has been put into, and no part begins with a zero.
      while (at + 8 + kPartBytes <= bytes.size() && IsZero(bytes.data() + at)) at += 8;
      const std::uint32_t word = FirstWord(bytes.data() + at);
      if (!may_begin_[Slot(word)]) continue;
      const auto [first, last] = by_first_word_.equal_range(word);
      for (auto it = first; it != last; ++it) {
        if (std::memcmp(bytes.data() + at, it->second->data(), kPartBytes) == 0) {
          found->push_back({*it->second, address + at, mapping});
        }
      }
    }
  }

 private:
  static constexpr int kBits = 18;
  static std::size_t Slot(std::uint32_t word) { return (word * 2654435761u) >> (32 - kBits); }

  std::vector<char> may_begin_;
  std::unordered_multimap<std::uint32_t, const std::string*> by_first_word_;
};

}  // namespace

std::set<std::string> TellingParts(const std::string& bytes, int num_parts) {
  std::mt19937 random(1);
  std::set<std::string> parts;
  for (int i = 0; i < 100 * num_parts && static_cast<int>(parts.size()) < num_parts; ++i) {
    const char* part = bytes.data() + random() % (bytes.size() - kPartBytes);
    std::bitset<256> values;
    for (int k = 0; k < kPartBytes; ++k) values.set(static_cast<unsigned char>(part[k]));
    if (values.count() >= 20 && part[0] != 0 && part[kPartBytes - 1] != 0) parts.emplace(part, kPartBytes);
  }
  return parts;
}

std::vector<PartFound> FindInMemory(pid_t pid, const std::set<std::string>& parts) {
  const PartIndex index(parts);
  const std::string folder = "/proc/" + std::to_string(pid);
  std::ifstream mappings(folder + "/maps");
  const int memory = open((folder + "/mem").c_str(), O_RDONLY | O_CLOEXEC);
  const int pages = open((folder + "/pagemap").c_str(), O_RDONLY | O_CLOEXEC);
  EXPECT_TRUE(memory >= 0 && pages >= 0) << "the memory of process " << pid << " cannot be read";
  std::vector<PartFound> found;
  std::vector<std::uint64_t> state;
  std::vector<char> bytes;
  for (std::string mapping; std::getline(mappings, mapping);) {
    unsigned long begin = 0, end = 0;  // NOLINT(google-runtime-int): sscanf's type
    char rights[5] = "";
    if (std::sscanf(mapping.c_str(), "%lx-%lx %4s", &begin, &end, rights) != 3 || rights[1] != 'w') continue;
    state.assign((end - begin) / kPage, 0);
    const ssize_t known = pread(pages, state.data(), 8 * state.size(), static_cast<off_t>(begin / kPage * 8));
    state.resize(known < 0 ? 0 : static_cast<std::size_t>(known) / 8);
    const auto is_there = [&](std::size_t page) { return state[page] >> 62 != 0; };  // in memory, or swapped
    bytes.clear();  // the last ones of the chunk before stay in front
    for (std::size_t page = 0; page < state.size();) {
      if (!is_there(page)) {
        bytes.clear();
        ++page;
        continue;
      }
      std::size_t last = page;
      while (last < state.size() && last - page < kChunkPages && is_there(last)) ++last;
      const std::size_t kept = std::min<std::size_t>(bytes.size(), kPartBytes - 1);
      bytes.erase(bytes.begin(), bytes.end() - static_cast<std::ptrdiff_t>(kept));
      bytes.resize(kept + (last - page) * kPage);
      const ssize_t count =
          pread(memory, bytes.data() + kept, bytes.size() - kept, static_cast<off_t>(begin + page * kPage));
      bytes.resize(kept + static_cast<std::size_t>(std::max<ssize_t>(count, 0)));
      index.Search(bytes, begin + page * kPage - kept, mapping, &found);
      page = last;
    }
  }
  close(memory);
  close(pages);
  return found;
}

std::size_t NumFound(const std::set<std::string>& parts, const std::vector<PartFound>& found) {
  std::set<std::string> those;
  for (const PartFound& place : found) {
    if (parts.contains(place.part)) those.insert(place.part);
  }
  return those.size();
}

std::string PlacesText(const std::vector<PartFound>& found) {
  std::string text;
  for (const PartFound& place : found) {
    char address[32] = "";
    std::snprintf(address, sizeof address, "%llx of ", static_cast<unsigned long long>(place.address));  // NOLINT
    text += address + place.mapping + ": ";
    for (const char byte : place.part) {
      char digits[3] = "";
      std::snprintf(digits, sizeof digits, "%02x", static_cast<unsigned char>(byte));
      text += digits;
    }
    text += "\n";
  }
  return text;
}

}  // namespace haustra::end_to_end
