// The main program of the tests. A folder's tests are one program; names of source files among the arguments choose the
// tests that stand in them, which is how ctest runs each part by its own name:
//
//     test_hal slot_pool_test.cc status_test.cc [GoogleTest's flags]
//
// Beside sources a filter may only leave tests out (GTEST_FILTER=-*DeathTest*).
// Tests of a header (a contract) stand in the header. Sources without any test, and a run without a test, fail; a run
// in which every test was skipped ends with 77, which ctest shows as skipped. GoogleTest alone would call all three a
// success.
#include <gtest/gtest.h>

#include <cstdio>
#include <filesystem>
#include <string>
#include <vector>

namespace {

constexpr int kSkipped = 77;  // SKIP_RETURN_CODE of every test in ctest's list

// "Suite.Name:Suite.Name": all tests of the named file. Empty if there is none.
std::string FilterOf(const std::string& source) {
  std::string filter;
  const testing::UnitTest& program = *testing::UnitTest::GetInstance();
  for (int s = 0; s < program.total_test_suite_count(); ++s) {
    const testing::TestSuite& suite = *program.GetTestSuite(s);
    for (int t = 0; t < suite.total_test_count(); ++t) {
      const testing::TestInfo& test = *suite.GetTestInfo(t);
      if (std::filesystem::path(test.file()).filename() != std::filesystem::path(source).filename()) continue;
      filter += std::string(suite.name()) + "." + test.name() + ":";
    }
  }
  return filter;
}

}  // namespace

int main(int argc, char** argv) {
  // Taken out before GoogleTest looks: it starts death tests with all arguments that it was given, and a filter.
  std::vector<std::string> sources;
  std::vector<char*> flags = {argv[0]};
  for (int i = 1; i < argc; ++i) {
    if (argv[i][0] == '-') {
      flags.push_back(argv[i]);
    } else {
      sources.emplace_back(argv[i]);
    }
  }
  int num_flags = static_cast<int>(flags.size());
  flags.push_back(nullptr);
  testing::InitGoogleTest(&num_flags, flags.data());

  std::string& filter = testing::GTEST_FLAG(filter);
  if (!sources.empty()) {
    const std::string left_out = filter == "*" ? "" : filter;
    if (!left_out.empty() && left_out.front() != '-') {
      std::fprintf(stderr, "%s: beside names of sources a filter may only leave out: %s\n", argv[0], filter.c_str());
      return 64;
    }
    filter.clear();
    for (const std::string& source : sources) filter += FilterOf(source);
    if (filter.empty()) {
      std::fprintf(stderr, "%s: no test stands in %s\n", argv[0], sources.front().c_str());
      return 1;
    }
    filter += left_out;
  }

  const int result = RUN_ALL_TESTS();
  const testing::UnitTest& program = *testing::UnitTest::GetInstance();
  if (testing::GTEST_FLAG(list_tests)) return result;
  if (program.test_to_run_count() == 0) {
    std::fprintf(stderr, "%s: no test ran\n", argv[0]);
    return 1;
  }
  const bool is_skipped = program.skipped_test_count() == program.test_to_run_count();
  return result == 0 && is_skipped ? kSkipped : result;
}
