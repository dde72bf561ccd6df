// How far two words are apart (Levenshtein 1966): fewest insertions, deletions and replacements that turn one into the
// other. For "did you mean". O(a b) time; allocates a row. reentrant.
#pragma once

#include <cstddef>
#include <string_view>

namespace haustra {

enum class LetterCase { kMatters, kIgnored };

std::size_t EditDistance(std::string_view a, std::string_view b, LetterCase letter_case);

}  // namespace haustra
