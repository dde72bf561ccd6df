// Text and tables as HTML. What comes from files goes through EscapeHtml. reentrant.
#pragma once

#include <string>
#include <string_view>

#include "tools/evaluate/text_table.h"

namespace haustra::report {

// & < > " ' as entities, for text and for attributes in quotes. Bytes that are not UTF-8, and control characters other
// than tab and new line, become U+FFFD.
std::string EscapeHtml(std::string_view text);

// JSON that can stand inside <script type="application/json">: no "<", so no end tag and no comment.
std::string JsonForScript(std::string_view json);

// What every page begins with, up to its title.
inline constexpr std::string_view kPageHead =
    "<!DOCTYPE html>\n<html lang=\"en\">\n<head>\n<meta charset=\"utf-8\">\n<title>";

// The same with the title, up to the heading.
std::string PageStart(std::string_view title);

// Whose library draws the plots, and the views in 3D, at the end of a page.
std::string PlotCredits();
std::string SceneCredits();

// <table> with the title as caption; numbers to the right.
std::string TableHtml(const evaluate::TextTable& table);

}  // namespace haustra::report
