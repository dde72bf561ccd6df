// `haustra vocabulary`: learns the visual words for retrieval.kind=vocabulary from recorded and rendered pictures.
#pragma once

#include <CLI/CLI.hpp>
#include <functional>

namespace haustra {

// Adds the subcommand; sets `action` when it was chosen.
void AddVocabularyCommand(CLI::App& app, std::function<int()>& action);

}  // namespace haustra
