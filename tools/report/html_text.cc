#include "tools/report/html_text.h"

#include "tools/report/page_assets.h"

namespace haustra::report {
namespace {

constexpr std::string_view kReplacement = "\xef\xbf\xbd";

// Bytes of the UTF-8 sequence that `text` begins with; 0 when it is none (RFC 3629: no overlong forms, no surrogates).
std::size_t SequenceLength(std::string_view text) {
  const auto byte = [&](std::size_t i) { return i < text.size() ? static_cast<unsigned char>(text[i]) : 0u; };
  const auto is_tail = [&](std::size_t i) { return (byte(i) & 0xc0) == 0x80; };
  const unsigned lead = byte(0);
  if (lead < 0x80) return 1;
  if (lead >= 0xc2 && lead <= 0xdf) return is_tail(1) ? 2 : 0;
  if (lead >= 0xe0 && lead <= 0xef) {
    if (!is_tail(1) || !is_tail(2)) return 0;
    if ((lead == 0xe0 && byte(1) < 0xa0) || (lead == 0xed && byte(1) > 0x9f)) return 0;
    return 3;
  }
  if (lead >= 0xf0 && lead <= 0xf4) {
    if (!is_tail(1) || !is_tail(2) || !is_tail(3)) return 0;
    if ((lead == 0xf0 && byte(1) < 0x90) || (lead == 0xf4 && byte(1) > 0x8f)) return 0;
    return 4;
  }
  return 0;
}

std::string Cell(const std::string& tag, bool is_left, const std::string& text) {
  return "<" + tag + (is_left ? " class=\"left\">" : ">") + EscapeHtml(text) + "</" + tag + ">";
}

std::string Credits(std::string_view what, std::string_view licence) {
  return "<footer><details><summary>" + EscapeHtml(what) + " (MIT License)</summary><pre>" + EscapeHtml(licence) +
         "</pre></details></footer>\n";
}

}  // namespace

std::string EscapeHtml(std::string_view text) {
  std::string html;
  html.reserve(text.size());
  while (!text.empty()) {
    const std::size_t length = SequenceLength(text);
    const char c = text.front();
    const bool is_control = static_cast<unsigned char>(c) < 0x20 && c != '\t' && c != '\n';
    if (length == 0 || is_control || c == 0x7f) {
      html += kReplacement;
      text.remove_prefix(1);
      continue;
    }
    switch (c) {
      case '&': html += "&amp;"; break;
      case '<': html += "&lt;"; break;
      case '>': html += "&gt;"; break;
      case '"': html += "&quot;"; break;
      case '\'': html += "&#39;"; break;
      default: html += text.substr(0, length);
    }
    text.remove_prefix(length);
  }
  return html;
}

std::string JsonForScript(std::string_view json) {
  std::string text;
  text.reserve(json.size());
  for (const char c : json) {
    // Only strings can hold it, and there the escape means the same.
    if (c == '<') {
      text += "\\u003c";
    } else {
      text += c;
    }
  }
  return text;
}

std::string TableHtml(const evaluate::TextTable& table) {
  std::string html = "<table>\n";
  if (!table.title.empty()) html += "<caption>" + EscapeHtml(table.title) + "</caption>\n";
  html += "<thead>\n";
  if (!table.groups.empty()) {
    html += "<tr>";
    for (const evaluate::TextTable::Group& group : table.groups) {
      html +=
          "<th class=\"group\" colspan=\"" + std::to_string(group.columns) + "\">" + EscapeHtml(group.name) + "</th>";
    }
    html += "</tr>\n";
  }
  html += "<tr>";
  for (std::size_t i = 0; i < table.header.size(); ++i) html += Cell("th", i < table.num_left, table.header[i]);
  html += "</tr>\n</thead>\n<tbody>\n";
  for (const std::vector<std::string>& row : table.rows) {
    html += "<tr>";
    for (std::size_t i = 0; i < row.size(); ++i) html += Cell("td", i < table.num_left, row[i]);
    html += "</tr>\n";
  }
  return html + "</tbody>\n</table>\n";
}

std::string PageStart(std::string_view title) {
  const std::string text = EscapeHtml(title);
  std::string page(kPageHead);
  page += text + "</title>\n<style>\n";
  page += ReportCss();
  return page + "</style>\n</head>\n<body>\n<h1>" + text + "</h1>\n";
}

std::string PlotCredits() { return Credits("Plots by Chart.js", ChartJsLicence()); }
std::string SceneCredits() { return Credits("Views in 3D by three.js", ThreeJsLicence()); }

}  // namespace haustra::report
