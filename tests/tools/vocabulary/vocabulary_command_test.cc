#include "tools/vocabulary/vocabulary_command.h"

#include <gtest/gtest.h>

#include <filesystem>
#include <fstream>
#include <iterator>
#include <string>
#include <vector>

#include "platform/vocabulary_loader.h"
#include "tests/capture/temp_folder.h"
#include "tests/tools/command/call_command.h"
#include "tools/exit_codes.h"
#include "tools/render/render_command.h"
#include "tools/run/run_command.h"

namespace haustra {
namespace {

// Exit code of `haustra vocabulary ARGUMENTS`.
int Learn(std::vector<std::string> arguments) {
  arguments.insert(arguments.begin(), {"vocabulary"});
  return CallCommand({AddVocabularyCommand}, arguments).code;
}

std::string BytesOf(const std::string& path) {
  std::ifstream file(path, std::ios::binary);
  return {std::istreambuf_iterator<char>(file), std::istreambuf_iterator<char>()};
}

TEST(VocabularyCommand, WhatCannotBeDoneIsRefusedAndLeavesNoFile) {
  const TempFolder root;
  const std::string out = root.Path("words.voc");
  EXPECT_EQ(Learn({"--out", out}), kExitUsage);
  EXPECT_EQ(Learn({"--out", out, "--rendered", "1", "--set", "features.no_such_key=1"}), kExitConfig);
  EXPECT_EQ(Learn({"--out", out, root.Path("no_such_sequence")}), kExitNoInput);
  EXPECT_EQ(Learn({"--out", root.Path("no_such_folder/words.voc"), "--rendered", "1"}), kExitIo);
  EXPECT_TRUE(std::filesystem::is_empty(root.Path("")));
}

TEST(VocabularyCommand, RenderedColonsGiveTheSameWordsOnAnyNumberOfThreads) {
  const TempFolder root;
  const std::vector<std::string> arguments = {"--rendered", "1",   "--pictures", "4",
                                              "--features", "300", "--depth",    "2"};
  const auto learn = [&](const std::string& out, const std::string& threads) {
    std::vector<std::string> all = arguments;
    all.insert(all.end(), {"--out", out, "--threads", threads});
    return Learn(all);
  };
  ASSERT_EQ(learn(root.Path("one.voc"), "1"), kExitOk);
  ASSERT_EQ(learn(root.Path("three.voc"), "3"), kExitOk);
  EXPECT_EQ(BytesOf(root.Path("one.voc")), BytesOf(root.Path("three.voc")));
  const Result<Vocabulary> vocabulary = LoadVocabulary(root.Path("one.voc"));
  ASSERT_TRUE(vocabulary.ok()) << vocabulary.status().ToString();
  EXPECT_EQ(vocabulary->tree().num_pictures, 4u);
  EXPECT_EQ(vocabulary->tree().num_descriptors, 1200u);
  EXPECT_TRUE(vocabulary->tree().root_sift);
  EXPECT_GT(vocabulary->num_words(), 50);
}

TEST(VocabularyCommand, LearnsFromEveryNthFrameOfSequencesWithTheirKindOfDescriptors) {
  const TempFolder root;
  const std::string colon = root.Path("colon"), out = root.Path("words.voc");
  ASSERT_EQ(CallCommand({AddRenderCommand}, {"render", colon, "--seconds", "0.4", "--size", "360x270"}).code, kExitOk);
  ASSERT_EQ(Learn({"--out", out, colon, colon, "--every-nth", "4", "--set", "features.root_sift=false"}), kExitOk);
  const Result<Vocabulary> vocabulary = LoadVocabulary(out);
  ASSERT_TRUE(vocabulary.ok()) << vocabulary.status().ToString();
  EXPECT_EQ(vocabulary->tree().num_pictures, 6u);  // frames 0, 4, 8 of ten, twice
  EXPECT_FALSE(vocabulary->tree().root_sift);
}

TEST(RunWithVocabulary, RunTakesTheWordsAndSaysWhatIsWrongWithThem) {
  const TempFolder root;
  const std::string colon = root.Path("colon"), words = root.Path("words.voc"), result = root.Path("result");
  ASSERT_EQ(CallCommand({AddRenderCommand}, {"render", colon, "--seconds", "0.4", "--size", "360x270"}).code, kExitOk);
  const auto run = [&](std::vector<std::string> settings) {
    std::vector<std::string> arguments = {"run", colon, "--out", result, "--overwrite", "--device", "cpu"};
    for (std::string& setting : settings) arguments.insert(arguments.end(), {"--set", std::move(setting)});
    return CallCommand({AddRunCommand}, arguments).code;
  };
  const std::string kind = "retrieval.kind=vocabulary", file = "retrieval.vocabulary=" + words;
  EXPECT_EQ(run({kind}), kExitConfig);         // no file named
  EXPECT_EQ(run({kind, file}), kExitNoInput);  // none there
  ASSERT_EQ(Learn({"--out", words, colon, "--features", "200", "--depth", "2"}), kExitOk);
  EXPECT_EQ(run({kind, file, "features.root_sift=false"}), kExitConfig);
  EXPECT_FALSE(std::filesystem::exists(result));
  EXPECT_EQ(run({kind, file}), kExitOk);
  EXPECT_TRUE(std::filesystem::exists(result + "/summary.json"));
  std::filesystem::resize_file(words, std::filesystem::file_size(words) - 100);
  EXPECT_EQ(run({kind, file}), kExitBadData);
}

}  // namespace
}  // namespace haustra
