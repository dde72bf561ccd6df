#include "engine/place/vocabulary.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>
#include <set>
#include <string>

#include "engine/place/vocabulary_file.h"
#include "tests/engine/place/synthetic_words.h"

namespace haustra::test {
namespace {

using ::testing::HasSubstr;

TEST(Vocabulary, FarClustersGetWordsOfTheirOwn) {
  // 36 clusters, branching 6, depth 2, if all goes well; k-means may split one cluster and join two others now and
  // then, but never spread one over many words.
  const VocabularySample sample = ClusteredSample(3, 36, 10, 4);
  VocabularyOptions options;
  options.branching = 6;
  options.depth = 3;
  const Result<Vocabulary> vocabulary = Vocabulary::Train(sample, options);
  ASSERT_TRUE(vocabulary.ok()) << vocabulary.status().ToString();
  std::vector<std::set<std::int32_t>> words_of_cluster(36);
  std::vector<std::set<int>> clusters_of_word(vocabulary->num_words());
  for (std::size_t i = 0; i < sample.num_descriptors(); ++i) {
    const std::int32_t word = vocabulary->WordOf(&sample.descriptors[i * kDescriptorBytes]);
    ASSERT_GE(word, 0);
    ASSERT_LT(word, vocabulary->num_words());
    words_of_cluster[i % 36].insert(word);
    clusters_of_word[word].insert(static_cast<int>(i % 36));
  }
  int num_pure = 0;
  for (const std::set<int>& clusters : clusters_of_word) {
    EXPECT_FALSE(clusters.empty());  // every word was learnt from something
    num_pure += clusters.size() == 1 ? 1 : 0;
  }
  EXPECT_GE(num_pure, 30);
}

TEST(Vocabulary, WeightIsTheLogarithmOfPicturesOverPicturesWithTheWord) {
  const VocabularySample sample = ClusteredSample(4, 20, 12, 3);
  VocabularyOptions options;
  options.branching = 5;
  const Result<Vocabulary> vocabulary = Vocabulary::Train(sample, options);
  ASSERT_TRUE(vocabulary.ok());
  std::vector<std::set<std::size_t>> pictures(vocabulary->num_words());
  for (std::size_t i = 0; i < sample.num_descriptors(); ++i) {
    pictures[vocabulary->WordOf(&sample.descriptors[i * kDescriptorBytes])].insert(i / (20 * 3));
  }
  for (std::int32_t word = 0; word < vocabulary->num_words(); ++word) {
    EXPECT_NEAR(vocabulary->weight(word) / 65536.0, std::log(12.0 / static_cast<double>(pictures[word].size())), 1e-5);
  }
}

std::string BytesOf(const Vocabulary& vocabulary) {
  StringSink sink;
  EXPECT_TRUE(WriteVocabulary(vocabulary, sink).ok());
  return sink.bytes();
}

TEST(Vocabulary, TrainingRepeatsToTheBitAndDependsOnTheSeed) {
  const VocabularySample sample = ClusteredSample(5, 200, 5, 3);
  VocabularyOptions options;
  options.branching = 4;
  const std::string first = BytesOf(Vocabulary::Train(sample, options).value());
  EXPECT_EQ(first, BytesOf(Vocabulary::Train(sample, options).value()));
  options.seed = 2;
  EXPECT_NE(first, BytesOf(Vocabulary::Train(sample, options).value()));
}

TEST(Vocabulary, DescriptorsThatAreAllAlikeAreOneWord) {
  VocabularySample sample;
  sample.descriptors.assign(500 * kDescriptorBytes, 7);
  sample.picture_ends = {100, 100, 500};  // a picture may be empty
  const Result<Vocabulary> vocabulary = Vocabulary::Train(sample, {});
  ASSERT_TRUE(vocabulary.ok());
  EXPECT_EQ(vocabulary->num_words(), 1);
  EXPECT_EQ(vocabulary->WordOf(sample.descriptors.data()), 0);
}

TEST(Vocabulary, DepthAndBranchingAreKept) {
  const VocabularySample sample = ClusteredSample(6, 300, 4, 4);
  VocabularyOptions options;
  options.branching = 3;
  options.depth = 2;
  const Result<Vocabulary> vocabulary = Vocabulary::Train(sample, options);
  ASSERT_TRUE(vocabulary.ok());
  EXPECT_EQ(vocabulary->num_words(), 9);
}

TEST(Vocabulary, BadSamplesAndOptionsAreRefused) {
  const VocabularySample good = ClusteredSample(7, 4, 2, 4);
  const auto message = [](const VocabularySample& sample, const VocabularyOptions& options) {
    const Result<Vocabulary> vocabulary = Vocabulary::Train(sample, options);
    EXPECT_EQ(vocabulary.code(), StatusCode::kInvalidArgument);
    return vocabulary.status().message();
  };
  VocabularySample sample;
  EXPECT_THAT(message(sample, {}), HasSubstr("no descriptors"));
  sample = good;
  sample.descriptors.pop_back();
  EXPECT_THAT(message(sample, {}), HasSubstr("no multiple of 128"));
  sample = good;
  sample.picture_ends.back() -= 1;
  EXPECT_THAT(message(sample, {}), HasSubstr("ends of the pictures"));
  VocabularyOptions options;
  options.branching = 1;
  EXPECT_THAT(message(good, options), HasSubstr("branching is 1, must be in [2, 64]"));
  options = {};
  options.depth = 9;
  EXPECT_THAT(message(good, options), HasSubstr("depth is 9, must be in [1, 8]"));
  options = {};
  options.max_iterations = 0;
  EXPECT_THAT(message(good, options), HasSubstr("max_iterations is 0"));
}

TEST(Vocabulary, WhatIsNoTreeIsRefused) {
  const VocabularyTree good = Vocabulary::Train(ClusteredSample(8, 30, 3, 3), {}).value().tree();
  ASSERT_TRUE(Vocabulary::FromTree(good).ok());
  const auto message = [&](auto&& spoil) {
    VocabularyTree tree = good;
    spoil(&tree);
    const Result<Vocabulary> vocabulary = Vocabulary::FromTree(std::move(tree));
    EXPECT_EQ(vocabulary.code(), StatusCode::kInvalidArgument);
    return vocabulary.status().message();
  };
  EXPECT_THAT(message([](VocabularyTree* t) { t->num_children.clear(); }), HasSubstr("number of nodes is 0"));
  EXPECT_THAT(message([](VocabularyTree* t) { t->centres.pop_back(); }), HasSubstr("bytes of centres"));
  EXPECT_THAT(message([](VocabularyTree* t) { t->num_children[0] = 0; }), HasSubstr("node 1 has no parent"));
  EXPECT_THAT(message([](VocabularyTree* t) { t->num_children[0] = 1; }), HasSubstr("node 0 has 1 children"));
  EXPECT_THAT(message([](VocabularyTree* t) { t->num_children[0] = 11; }), HasSubstr("node 0 has 11 children"));
  EXPECT_THAT(message([](VocabularyTree* t) { t->num_children.back() = 2; }), HasSubstr("children that are not there"));
  EXPECT_THAT(message([](VocabularyTree* t) { t->weights.push_back(0); }), HasSubstr("weights for"));
  EXPECT_THAT(message([](VocabularyTree* t) { t->weights[3] = 0xffffffffu; }), HasSubstr("weight of word 3"));
  EXPECT_THAT(message([](VocabularyTree* t) { t->depth = 1; }), HasSubstr("below the depth"));
}

}  // namespace
}  // namespace haustra::test
