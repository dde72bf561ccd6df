// What the page of `haustra view` is made of, whatever it shows: HTML, styles, scripts, and the libraries with their
// licences, built into the program. reentrant.
#pragma once

#include <string_view>

#include "tools/view/view_server.h"

namespace haustra::view {

// kLiveWithMarking: marks can be set and removed on the page.
enum class PageKind { kRun, kLive, kLiveWithMarking };

// Data of the run, or the stream, are the caller's to add.
ViewSite MakePageSite(PageKind kind);

}  // namespace haustra::view
