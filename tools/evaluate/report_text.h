// One evaluation for a person at a terminal. reentrant.
#pragma once

#include <string>

#include "tools/evaluate/evaluation.h"

namespace haustra::evaluate {

std::string ToText(const Evaluation& evaluation);

}  // namespace haustra::evaluate
