#include "tests/end_to_end/evaluation.h"

#include <gtest/gtest.h>

#include "tests/end_to_end/command.h"
#include "tests/end_to_end/result_files.h"

namespace haustra::end_to_end {

namespace {

nlohmann::json EvaluateInto(const std::string& json, const std::string& sequence, const std::string& result_folder) {
  const CommandResult result = Haustra({"evaluate", result_folder, "--groundtruth",
                                        SequenceFolder(sequence) + "/groundtruth.txt", "--json", json, "--overwrite"});
  EXPECT_EQ(result.exit_code, 0) << result.ToString();
  return result.exit_code == 0 ? ReadJson(json) : nlohmann::json();
}

}  // namespace

nlohmann::json Evaluate(const std::string& sequence) {
  return EvaluateInto(ScratchFolder() + "/evaluation.json", sequence, ResultFolder(sequence));
}

nlohmann::json Evaluate(const std::string& sequence, const std::string& result_folder) {
  // Not inside: what is not part of a run would keep it from being made again.
  return EvaluateInto(result_folder + "_evaluation.json", sequence, result_folder);
}

void ExpectAtLeast(const Floors& floors, const std::string& result_folder) {
  const nlohmann::json evaluation =
      result_folder.empty() ? Evaluate(floors.sequence) : Evaluate(floors.sequence, result_folder);
  ASSERT_TRUE(evaluation.is_object());
  EXPECT_GE(evaluation.at("coverage").get<double>(), floors.coverage);
  EXPECT_GE(evaluation.at("visible_coverage").get<double>(), floors.visible_coverage);
  EXPECT_GE(evaluation.at("live_visible_coverage").get<double>(), floors.live_visible_coverage);
  ASSERT_TRUE(evaluation.at("rms_ate").is_number());
  EXPECT_LE(evaluation.at("rms_ate").get<double>(), floors.rms_ate_mm);
  EXPECT_GE(evaluation.at("maps").get<int>(), 1);
  EXPECT_LE(evaluation.at("maps").get<int>(), floors.maps);
  EXPECT_EQ(evaluation.at("false_merges").get<int>(), 0);
  ExpectJoins(evaluation.at("joins"), floors.joins);
}

void ExpectJoins(const nlohmann::json& joins, int at_least) {
  int num_true = 0;
  for (const nlohmann::json& join : joins) {
    EXPECT_NE(join.at("verdict").get<std::string>(), "false") << join.dump();
    num_true += join.at("verdict").get<std::string>() == "true";
  }
  EXPECT_GE(num_true, at_least) << "of " << joins.size() << " that were made";
}

}  // namespace haustra::end_to_end
