#include "tools/report/page.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <nlohmann/json.hpp>
#include <span>

#include "tests/tools/report/small_report.h"
#include "tools/evaluate/number_text.h"
#include "tools/evaluate/paper_tables.h"
#include "tools/evaluate/report_json.h"
#include "tools/report/html_text.h"
#include "tools/report/page_assets.h"

namespace haustra::report {
namespace {

using ::testing::AnyOf;
using ::testing::HasSubstr;
using ::testing::Not;

class PageTest : public ::testing::Test {
 protected:
  std::string Page(const std::string& pictures = {}, const std::map<int, std::string>& meshes = {}) {
    evaluation_ = EvaluateRun(run_, reference_, {});
    return MakePage({run_, reference_, evaluation_, models_, pictures, {}, meshes});
  }

  evaluate::RunOutput run_ = SmallRun();
  evaluate::Reference reference_ = ShiftedReference(60);
  evaluate::Evaluation evaluation_;
  std::map<int, MapModel> models_;
};

TEST_F(PageTest, EvaluationInThePageIsThatOfEvaluate) {
  const std::string page = Page();
  EXPECT_EQ(nlohmann::json::parse(ScriptText(page, "evaluation")), nlohmann::json::parse(ToJson(evaluation_)));
}

TEST_F(PageTest, MotionBetweenScopeAndWallIsShownWhereItWasLookedFor) {
  EXPECT_THAT(Page(), Not(HasSubstr("motion-section")));
  run_.figures.motions = {{0, 8.0, {{1.5, 61.5, 3.75, 4.25, 2.5e-5}}}, {1, 5.5, {}}, {2, 0.0, {}}};
  const std::string page = Page();
  EXPECT_THAT(page, HasSubstr("<section id=\"motion-section\">"));
  EXPECT_THAT(page, HasSubstr("<td class=\"left\">to and fro</td><td>0</td><td>3.75</td><td>4.2</td><td>1.5</td>"
                              "<td>61.5</td><td>2.5e-05</td>"));
  EXPECT_THAT(page, HasSubstr("<td class=\"left\">none found, up to a period of 5.5 s</td><td>1</td>"));
  EXPECT_THAT(page, HasSubstr("<td class=\"left\">the path is too short to tell</td><td>2</td>"));
}

TEST_F(PageTest, FiguresInTheTextAreThoseOfTheJson) {
  const std::string page = Page();
  const nlohmann::json json = nlohmann::json::parse(ToJson(evaluation_));
  const auto row = [](const std::string& name, const std::string& value) {
    return "<td class=\"left\">" + name + "</td><td class=\"left\">" + value + "</td>";
  };
  const auto fixed = [](const nlohmann::json& value, int decimals) {
    return evaluate::Fixed(value.get<double>(), decimals);
  };
  EXPECT_EQ(json["coverage"], 75.0);
  EXPECT_EQ(json["live_coverage"], 75.0);
  EXPECT_THAT(page, HasSubstr(row("live coverage", fixed(json["live_coverage"], 2) + " %")));
  EXPECT_THAT(page, HasSubstr(row("coverage", fixed(json["coverage"], 2) + " %")));
  EXPECT_THAT(page, HasSubstr(row("RMS ATE", fixed(json["rms_ate"], 4) + " mm")));
  EXPECT_THAT(page, HasSubstr(row("maps", std::to_string(json["maps"].get<int>()))));
  EXPECT_THAT(page, HasSubstr(row("merges", "1, 0 false")));
  EXPECT_THAT(page, HasSubstr(row("recoveries", "0")));
  EXPECT_THAT(page, HasSubstr(row("real-time ratio", fixed(json["realtime_ratio"], 2))));
  const std::span<const evaluate::Evaluation> one(&evaluation_, 1);
  EXPECT_THAT(page, HasSubstr(TableHtml(MakePaperTable(one))));
  EXPECT_THAT(page, HasSubstr(TableHtml(MakeStageTable(one))));
  EXPECT_THAT(page, HasSubstr(TableHtml(MakeJoinTable(one))));
  // Stage times by hand: 20 to 79 ms, every whole one once.
  EXPECT_THAT(page, HasSubstr("<td class=\"left\">tracking/total</td><td>60</td><td>49.00</td><td>79.00</td>"));
}

TEST_F(PageTest, NamesFromFilesAreEscaped) {
  run_.folder = "results/<script>alert(1)</script>";
  run_.events[0].details = "</td><img src=x>";
  run_.events[2].details = "<b>reason keyframe=1";
  run_.warnings = {"a & b"};
  const std::string page = Page();
  EXPECT_THAT(page, Not(HasSubstr("<script>alert")));
  EXPECT_THAT(page, Not(HasSubstr("<img src=x>")));
  EXPECT_THAT(page, Not(HasSubstr("<b>reason")));
  EXPECT_THAT(page, HasSubstr("&lt;/td&gt;&lt;img src=x&gt;"));
  EXPECT_THAT(page, HasSubstr("warning: a &amp; b"));
}

TEST_F(PageTest, MarksAreATableAndTheirLabelsAreText) {
  EXPECT_THAT(Page(), Not(HasSubstr("marks-section"))) << "a run without marks";
  run_.marks = SmallMarks();
  const std::string page = Page();
  EXPECT_THAT(page, HasSubstr("<section id=\"marks-section\">"));
  // Set in frame 8; one frame in front at 0.36 s, one at 2.24 s, two hidden, one unsure, none out of view.
  EXPECT_THAT(page,
              HasSubstr("<td class=\"left\">&lt;b&gt;&amp;&quot;x</td><td class=\"left\">frame 8</td><td>0</td>"
                        "<td>2</td><td>2</td><td>1</td><td>0</td><td>0.4 s, frame 9</td><td>2.2 s, frame 56</td>"));
  EXPECT_THAT(page,
              HasSubstr("<td class=\"left\">old</td><td class=\"left\">session 0, frame 120</td><td>0</td><td>0</td>"
                        "<td>0</td><td>0</td><td>2</td><td>-</td><td>-</td>"));
  EXPECT_THAT(page, HasSubstr("<td class=\"left\">&lt;i&gt;late</td>"
                              "<td class=\"left\">the run ended before its frame came</td><td>70</td>"));
  EXPECT_THAT(page, Not(HasSubstr("<b>&")));
  EXPECT_THAT(page, Not(HasSubstr("<i>late")));
}

TEST_F(PageTest, NeedsNoNetwork) {
  std::string page = Page();
  // three.js could load textures; nobody asks it to (tests/end_to_end/view_page_test.py looks at what is loaded).
  const std::size_t library = page.find(ThreeJs());
  ASSERT_NE(library, std::string::npos);
  page.erase(library, ThreeJs().size());
  for (const char* what : {"src=\"", "<link", "@import", "href=\"http", "url(", "fetch("}) {
    EXPECT_THAT(page, Not(HasSubstr(what)));
  }
  EXPECT_THAT(page, HasSubstr("Chart.js v3"));
  EXPECT_THAT(page, HasSubstr("Permission is hereby granted"));
  EXPECT_THAT(page, HasSubstr("three.js authors"));
}

TEST_F(PageTest, WhatIsMissingIsSaid) {
  reference_ = {};
  run_.times.clear();
  const std::string page = Page();
  EXPECT_THAT(page, HasSubstr("No ground truth was given"));
  EXPECT_THAT(page, HasSubstr("stage times are not known"));
  EXPECT_THAT(page, HasSubstr("No sequence was given"));
  EXPECT_THAT(page, Not(HasSubstr("id=\"errors\"")));
}

TEST_F(PageTest, RejectedCandidatesAreListedWithTheirReasons) {
  const std::string page = Page();
  EXPECT_THAT(page, HasSubstr("<option value=\"no_similarity\">"));
  EXPECT_THAT(page, HasSubstr("what is found covers too little of the image"));
  EXPECT_THAT(page, HasSubstr("<td class=\"left\">merge</td><td class=\"left\">no_similarity</td><td>35</td>"));
}

TEST_F(PageTest, EventsThatAreNotListedAreCounted) {
  EXPECT_THAT(Page(), Not(HasSubstr("events.csv has all")));
  const std::size_t num_small = 4;  // those that are listed: no rejection, and no search for a frame
  for (std::int64_t i = 0; i < 1200; ++i) run_.events.push_back(EventWith(59, "lost", 0, -1, "few_matches"));
  EXPECT_THAT(Page(), HasSubstr("<p>The first 1000 of " + std::to_string(1200 + num_small) +
                                " are listed; events.csv has all.</p>"));
}

TEST_F(PageTest, MapsThatAreNotShownAreCounted) {
  reference_ = {};
  EXPECT_THAT(Page(), Not(HasSubstr("largest of")));
  // Nine maps of six frames each, and one of five.
  for (std::size_t i = 0; i < run_.frames.size(); ++i) {
    run_.frames[i] = evaluate::MakeRunFrame(static_cast<std::int64_t>(i), static_cast<int>(i / 6),
                                            static_cast<int>(i / 6), evaluate::TruePose(static_cast<std::int64_t>(i)));
  }
  run_.maps.clear();
  for (int map_id = 0; map_id < 10; ++map_id) run_.maps.push_back({map_id, "stored", 2, 30});
  const std::string page = Page();
  EXPECT_EQ(nlohmann::json::parse(ScriptText(page, "chart-data"))["views"].size(), 6u);
  EXPECT_THAT(page, HasSubstr("The 6 largest of 10 maps are shown"));
}

TEST_F(PageTest, RunWithoutAnyMapOrEventIsAPageToo) {
  evaluate::RunOutput empty;
  empty.folder = "out";
  for (std::int64_t i = 0; i < 5; ++i) empty.frames.push_back(evaluate::MakeRunFrame(i, -1, -1, SE3()));
  run_ = empty;
  const std::string page = Page();
  EXPECT_THAT(page, HasSubstr("No candidate was rejected."));
  EXPECT_TRUE(nlohmann::json::accept(ScriptText(page, "chart-data")));
}

TEST_F(PageTest, ASurfaceIsInThePageWhileItIsSmall) {
  EXPECT_THAT(Page(), Not(AnyOf(HasSubstr("id=\"mesh-"), HasSubstr("surface of the wall"))));
  const std::string page = Page({}, {{0, "ply\n"}});
  EXPECT_THAT(page, HasSubstr("<script type=\"text/plain\" id=\"mesh-0\">cGx5Cg==</script>"));
  EXPECT_THAT(page, HasSubstr("the surface of the wall is shown in place of the points"));
  EXPECT_THAT(page, HasSubstr("<script type=\"application/json\" id=\"surface-maps\">[]</script>"));
  const std::string large = Page({}, {{0, "ply\n"}, {1, std::string(3'000'000, 'x')}});
  EXPECT_THAT(large, Not(HasSubstr("id=\"mesh-")));
  EXPECT_THAT(large, HasSubstr("The surface of the wall is too large for this page"));
}

TEST_F(PageTest, SameRunGivesTheSameBytes) { EXPECT_EQ(Page(), Page()); }

}  // namespace
}  // namespace haustra::report
