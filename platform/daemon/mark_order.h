// What is asked of the marks of a running procedure. Made by any thread, done by the mapping thread, the only one that
// may change the atlas.
#pragma once

#include <functional>
#include <string>

#include "engine/engine.h"

namespace haustra {

struct MarkOrder {
  enum class Kind { kSet, kRemove, kList };
  Kind kind = Kind::kList;
  MarkRequest request;  // kSet; kRemove: the label
  std::function<void(const Result<std::string>&)> done;
};

// Mapping thread between two steps, or any when it has ended. The text for a person; errors of Engine::SetMark and
// RemoveMark.
Result<std::string> DoMarkOrder(const MarkOrder& order, Engine& engine);

}  // namespace haustra
