#include "tests/end_to_end/evaluation.h"

#include <gtest/gtest.h>

#include "tests/end_to_end/command.h"
#include "tests/end_to_end/result_files.h"

namespace haustra::end_to_end {

nlohmann::json Evaluate(const std::string& sequence) {
  const std::string json = ScratchFolder() + "/evaluation.json";
  const CommandResult result = Haustra({"evaluate", ResultFolder(sequence), "--groundtruth",
                                        SequenceFolder(sequence) + "/groundtruth.txt", "--json", json});
  EXPECT_EQ(result.exit_code, 0) << result.ToString();
  return result.exit_code == 0 ? ReadJson(json) : nlohmann::json();
}

void ExpectAtLeast(const Floors& floors) {
  const nlohmann::json evaluation = Evaluate(floors.sequence);
  ASSERT_TRUE(evaluation.is_object());
  EXPECT_GE(evaluation.at("coverage").get<double>(), floors.coverage);
  EXPECT_GE(evaluation.at("visible_coverage").get<double>(), floors.visible_coverage);
  ASSERT_TRUE(evaluation.at("rms_ate").is_number());
  EXPECT_LE(evaluation.at("rms_ate").get<double>(), floors.rms_ate_mm);
  EXPECT_GE(evaluation.at("maps").get<int>(), 1);
  EXPECT_LE(evaluation.at("maps").get<int>(), floors.maps);
  EXPECT_EQ(evaluation.at("false_merges").get<int>(), 0);
}

}  // namespace haustra::end_to_end
