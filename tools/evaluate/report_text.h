// One evaluation for a person at a terminal. reentrant.
#pragma once

#include <optional>
#include <string>

#include "tools/evaluate/evaluation.h"

namespace haustra::evaluate {

// "97.5 %   (39 of 40 OF_WHAT)"; "-" when it is not known or there was no occasion.
std::string RecallText(const std::optional<Recall>& recall, const std::string& of_what);

std::string ToText(const Evaluation& evaluation);

}  // namespace haustra::evaluate
