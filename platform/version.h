// Which build this is.
#pragma once

namespace haustra {

// The version of the project, and the revision that it was built from where git knows: "0.1.0 (21ebf5b)". What differs
// from that revision makes it "0.1.0 (21ebf5b, changed)".
const char* Version();

}  // namespace haustra
