// Evaluations as JSON: for one run its figures, for several {"runs": [...], "mean": {...}, "spread": {...}}. Keys in
// snake_case, in a fixed order; what is not known is null. reentrant.
#pragma once

#include <span>
#include <string>

#include "tools/evaluate/evaluation.h"

namespace haustra::evaluate {

std::string ToJson(const Evaluation& evaluation);
std::string ToJson(std::span<const Evaluation> evaluations);

}  // namespace haustra::evaluate
