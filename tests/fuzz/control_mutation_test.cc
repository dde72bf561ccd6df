// Seeded mutations of the requests in corpus/control, through the function of the fuzzer.
#include <gtest/gtest.h>

#include <filesystem>
#include <fstream>
#include <iterator>
#include <random>
#include <string>
#include <vector>

#include "tests/fuzz/fuzz_entries.h"

TEST(ControlProtocolFuzz, MutatedRequestsAreRefusedOrUnderstood) {
  std::vector<std::string> corpus;
  for (const auto& entry : std::filesystem::directory_iterator(HAUSTRA_CORPUS "/control")) {
    std::ifstream file(entry.path(), std::ios::binary);
    corpus.emplace_back(std::istreambuf_iterator<char>(file), std::istreambuf_iterator<char>());
  }
  ASSERT_GE(corpus.size(), 5u);
  std::mt19937 random(1);
  for (int i = 0; i < 100000; ++i) {
    std::string packet = corpus[random() % corpus.size()];
    for (unsigned n = random() % 4; n > 0; --n) {
      const std::size_t at = packet.empty() ? 0 : random() % packet.size();
      switch (random() % 4) {
        case 0: packet.insert(at, 1, static_cast<char>(random())); break;
        case 1: packet = packet.substr(0, at); break;
        case 2: packet += packet.substr(at); break;
        default:
          if (!packet.empty()) packet[at] = static_cast<char>(random());
      }
    }
    haustra::test::FuzzControlProtocol({reinterpret_cast<const std::uint8_t*>(packet.data()), packet.size()});
  }
}
