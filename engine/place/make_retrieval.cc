#include "engine/place/make_retrieval.h"

#include <string>

#include "engine/place/exhaustive_retrieval.h"
#include "engine/place/vocabulary_retrieval.h"

namespace haustra {

bool NeedsVocabulary(const RetrievalConfig& retrieval) { return retrieval.kind == "vocabulary"; }

std::unique_ptr<KeyframeRetrieval> MakeRetrieval(const EngineConfig& config, VisionDevice& device,
                                                 const Vocabulary* vocabulary) {
  const RetrievalConfig& retrieval = config.place.retrieval;
  if (!NeedsVocabulary(retrieval)) return std::make_unique<ExhaustiveRetrieval>(config, retrieval, device);
  HAUSTRA_CHECK(vocabulary != nullptr);
  return std::make_unique<VocabularyRetrieval>(config, retrieval, device, *vocabulary);
}

std::size_t RetrievalBytes(const EngineConfig& config) {
  return NeedsVocabulary(config.place.retrieval) ? VocabularyRetrieval::BytesFor(config)
                                                 : ExhaustiveRetrieval::BytesFor(config);
}

Status CheckVocabulary(const EngineConfig& config, const Vocabulary& vocabulary) {
  const auto name = [](bool root_sift) { return std::string(root_sift ? "RootSIFT" : "SIFT"); };
  if (vocabulary.tree().root_sift != config.features.root_sift) {
    return FailedPrecondition("the vocabulary is one of " + name(vocabulary.tree().root_sift) +
                              " descriptors, features.root_sift asks for " + name(config.features.root_sift));
  }
  return Status::Ok();
}

}  // namespace haustra
