// The vocabulary that the configuration names, from its file.
#pragma once

#include <memory>
#include <string>

#include "engine/config.h"
#include "engine/place/vocabulary.h"
#include "hal/core/status.h"

namespace haustra {

// kNotFound: no such file. kUnavailable: it cannot be read. Others as ReadVocabulary. Messages name the file.
Result<Vocabulary> LoadVocabulary(const std::string& path);

// Null when config.place.retrieval asks for none; else the vocabulary, which fits the configuration
// (CheckVocabulary). Errors: as above, and kFailedPrecondition when it does not fit.
Result<std::unique_ptr<const Vocabulary>> LoadVocabularyFor(const EngineConfig& config);

}  // namespace haustra
