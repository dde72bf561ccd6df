#include "platform/vocabulary_loader.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <filesystem>
#include <fstream>
#include <string>

#include "capture/files/file_sink.h"
#include "engine/place/vocabulary_file.h"
#include "tests/capture/temp_folder.h"
#include "tests/engine/place/synthetic_words.h"

namespace haustra::test {
namespace {

using ::testing::HasSubstr;

class VocabularyLoaderTest : public testing::Test {
 protected:
  VocabularyLoaderTest() : path_(root_.Path("words.voc")) {
    Result<FileSink> sink = FileSink::Create(path_);
    EXPECT_TRUE(sink.ok());
    EXPECT_TRUE(WriteVocabulary(Vocabulary::Train(ClusteredSample(1, 30, 3, 4), {}).value(), *sink).ok());
    EXPECT_TRUE(sink->Commit().ok());
    config_.features.root_sift = false;
    config_.place.retrieval.kind = "vocabulary";
    config_.place.retrieval.vocabulary = path_;
  }

  // The file is named in every message.
  Status Refusal() {
    const auto loaded = LoadVocabularyFor(config_);
    EXPECT_FALSE(loaded.ok());
    EXPECT_THAT(loaded.status().message(), HasSubstr(config_.place.retrieval.vocabulary));
    return loaded.status();
  }

  TempFolder root_;
  std::string path_;
  EngineConfig config_;
};

TEST_F(VocabularyLoaderTest, GivesTheVocabularyThatTheConfigurationNames) {
  const auto loaded = LoadVocabularyFor(config_);
  ASSERT_TRUE(loaded.ok()) << loaded.status().ToString();
  ASSERT_NE(*loaded, nullptr);
  EXPECT_EQ((*loaded)->tree().num_pictures, 3u);
}

TEST_F(VocabularyLoaderTest, LooksAtNoFileWhenNoneIsNeeded) {
  config_.place.retrieval.kind = "exhaustive";
  config_.place.retrieval.vocabulary = root_.Path("no_such_file");
  const auto loaded = LoadVocabularyFor(config_);
  ASSERT_TRUE(loaded.ok());
  EXPECT_EQ(*loaded, nullptr);
}

TEST_F(VocabularyLoaderTest, MissingFileOrFolderIsRefused) {
  config_.place.retrieval.vocabulary = root_.Path("no_such_file");
  EXPECT_EQ(Refusal().code(), StatusCode::kNotFound);
  config_.place.retrieval.vocabulary = root_.Path("");
  EXPECT_EQ(Refusal().code(), StatusCode::kDataLoss);
}

TEST_F(VocabularyLoaderTest, BrokenFileIsRefused) {
  std::filesystem::resize_file(path_, std::filesystem::file_size(path_) - 1);
  EXPECT_EQ(Refusal().code(), StatusCode::kDataLoss);
  std::ofstream(path_) << "retrieval: {kind: vocabulary}\n";
  EXPECT_EQ(Refusal().code(), StatusCode::kInvalidArgument);
  std::ofstream(path_, std::ios::trunc).flush();
  EXPECT_FALSE(Refusal().ok());
}

TEST_F(VocabularyLoaderTest, WordsOfAnotherKindOfDescriptorsAreRefused) {
  config_.features.root_sift = true;
  const Status status = Refusal();
  EXPECT_EQ(status.code(), StatusCode::kFailedPrecondition);
  EXPECT_THAT(status.message(), HasSubstr("one of SIFT descriptors, features.root_sift asks for RootSIFT"));
}

}  // namespace
}  // namespace haustra::test
