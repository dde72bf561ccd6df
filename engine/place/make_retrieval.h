// The retrieval that the configuration asks for.
#pragma once

#include <memory>

#include "engine/config.h"
#include "engine/place/retrieval.h"
#include "engine/place/vocabulary.h"

namespace haustra {

// By config.place.retrieval.kind. `vocabulary` may be null for the exhaustive kind only; it must fit the configuration
// (CheckVocabulary). All that is named outlives the retrieval.
std::unique_ptr<KeyframeRetrieval> MakeRetrieval(const EngineConfig& config, VisionDevice& device,
                                                 const Vocabulary* vocabulary);

// What it will hold on the heap, at most; the vocabulary itself is not counted.
std::size_t RetrievalBytes(const EngineConfig& config);

bool NeedsVocabulary(const RetrievalConfig& retrieval);

// kFailedPrecondition: made for descriptors of another kind than features.root_sift says.
Status CheckVocabulary(const EngineConfig& config, const Vocabulary& vocabulary);

}  // namespace haustra
