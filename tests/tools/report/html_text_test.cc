#include "tools/report/html_text.h"

#include <gtest/gtest.h>

#include <nlohmann/json.hpp>

#include "tools/report/base64.h"

namespace haustra::report {
namespace {

TEST(EscapeHtml, MarkupIsText) {
  EXPECT_EQ(EscapeHtml("<b a=\"1\" c='2'>&amp;"), "&lt;b a=&quot;1&quot; c=&#39;2&#39;&gt;&amp;amp;");
  EXPECT_EQ(EscapeHtml(""), "");
  EXPECT_EQ(EscapeHtml("a\tb\nc"), "a\tb\nc");
}

TEST(EscapeHtml, LettersOfSeveralBytesStay) {
  EXPECT_EQ(EscapeHtml("Größe \xe2\x82\xac \xf0\x9f\x98\x80"), "Größe \xe2\x82\xac \xf0\x9f\x98\x80");
}

TEST(EscapeHtml, WhatIsNotUtf8IsReplaced) {
  const std::string replacement = "\xef\xbf\xbd";
  EXPECT_EQ(EscapeHtml("a\xff"), "a" + replacement);
  EXPECT_EQ(EscapeHtml("\xe2\x82"), replacement + replacement);     // cut short
  EXPECT_EQ(EscapeHtml("\xc0\xbc"), replacement + replacement);     // '<' in two bytes
  EXPECT_EQ(EscapeHtml("\xed\xa0\x80").substr(0, 3), replacement);  // half of a surrogate pair
  EXPECT_EQ(EscapeHtml(std::string("a\0b", 3)), "a" + replacement + "b");
  EXPECT_EQ(EscapeHtml("\x1b[31m"), replacement + "[31m");
}

TEST(JsonForScript, EndTagInAStringDoesNotEndTheScript) {
  const std::string json = R"({"name": "</script><!--"})";
  const std::string text = JsonForScript(json);
  EXPECT_EQ(text.find('<'), std::string::npos);
  EXPECT_EQ(nlohmann::json::parse(text), nlohmann::json::parse(json));
}

TEST(TableHtml, CellsAreEscapedAndWordsStandLeft) {
  evaluate::TextTable table;
  table.title = "a & b";
  table.groups = {{"", 1}, {"both", 2}};
  table.header = {"name", "x", "y"};
  table.rows = {{"<i>", "1", "-"}};
  EXPECT_EQ(TableHtml(table),
            "<table>\n<caption>a &amp; b</caption>\n<thead>\n"
            "<tr><th class=\"group\" colspan=\"1\"></th><th class=\"group\" colspan=\"2\">both</th></tr>\n"
            "<tr><th class=\"left\">name</th><th>x</th><th>y</th></tr>\n</thead>\n<tbody>\n"
            "<tr><td class=\"left\">&lt;i&gt;</td><td>1</td><td>-</td></tr>\n</tbody>\n</table>\n");
}

std::string Base64Of(const std::string& text) {
  return ToBase64({reinterpret_cast<const std::uint8_t*>(text.data()), text.size()});
}

// The examples of RFC 4648, section 10.
TEST(ToBase64, ExamplesOfTheStandard) {
  EXPECT_EQ(Base64Of(""), "");
  EXPECT_EQ(Base64Of("f"), "Zg==");
  EXPECT_EQ(Base64Of("fo"), "Zm8=");
  EXPECT_EQ(Base64Of("foo"), "Zm9v");
  EXPECT_EQ(Base64Of("foobar"), "Zm9vYmFy");
  EXPECT_EQ(Base64Of("\xff\xff\xfe"), "///+");
}

}  // namespace
}  // namespace haustra::report
