// Files of the page, built into the program (tools/report/embed_assets.cmake). reentrant.
#pragma once

#include <string_view>

namespace haustra::view {

std::string_view ViewHtml();
std::string_view ViewCss();
std::string_view PanelsJs();  // what both kinds of page share
std::string_view RunJs();     // of a finished run
std::string_view LiveJs();    // of a running engine

}  // namespace haustra::view
