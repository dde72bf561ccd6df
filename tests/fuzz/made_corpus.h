// The files of the corpora that the program's own writers make: binary formats, which nobody writes by hand.
#pragma once

#include <map>
#include <string>

namespace haustra::test {

// By path in tests/fuzz/corpus.
std::map<std::string, std::string> MadeCorpus();

}  // namespace haustra::test
