// What the tests of whole runs demand of joins, on evaluations made by hand.
#include "tests/end_to_end/evaluation.h"

#include <gtest/gtest-spi.h>
#include <gtest/gtest.h>

#include <string>
#include <vector>

namespace haustra::end_to_end {
namespace {

nlohmann::json Joins(const std::vector<std::string>& verdicts) {
  nlohmann::json joins = nlohmann::json::array();
  for (const std::string& verdict : verdicts) joins.push_back({{"verdict", verdict}});
  return joins;
}

TEST(ExpectJoins, AsManyTrueOnesAsDemandedPass) { ExpectJoins(Joins({"true", "unjudged", "true"}), 2); }

TEST(ExpectJoins, OneThatNobodyJudgedDoesNotCount) {
  EXPECT_NONFATAL_FAILURE(ExpectJoins(Joins({"true", "unjudged"}), 2), "num_true");
}

TEST(ExpectJoins, OneThatIsFalseFails) { EXPECT_NONFATAL_FAILURE(ExpectJoins(Joins({"true", "false"}), 1), "verdict"); }

}  // namespace
}  // namespace haustra::end_to_end
