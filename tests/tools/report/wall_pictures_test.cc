#include "tools/report/wall_pictures.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "tests/tools/evaluate/text_folder.h"

namespace haustra::report {
namespace {

using ::testing::HasSubstr;
using ::testing::Not;

constexpr const char* kFound =
    R"({"maps": [{"map_id": 0, "lumen": {"found": true, "radius_mu": 0.5, "passed_radii": 4.5}, "wall_coverage": 0.75,
     "seen_poorly": 0.125, "segments": [{"from_radii": 0.0, "to_radii": 2.25, "wall_coverage": 0.5, "seen_poorly": 0.25,
     "first_s": 1.5, "last_s": 9.25}, {"from_radii": 2.25, "to_radii": 4.5, "wall_coverage": 0.0, "seen_poorly": 0.0,
     "first_s": null, "last_s": null}]}]})";

TEST(WallPicturesHtml, ShowsThePictureWithAxesAndTheSegments) {
  const evaluate::TextFolder folder;
  folder.Write("surface.json", kFound);
  folder.Write("map_0000_wall.png", "picture");
  const Result<std::string> html = WallPicturesHtml(folder.At(""));
  ASSERT_TRUE(html.ok()) << html.status().ToString();
  EXPECT_THAT(*html, HasSubstr("data:image/png;base64,cGljdHVyZQ=="));
  EXPECT_THAT(*html, HasSubstr(">270\u00b0</text>"));
  EXPECT_THAT(*html, HasSubstr("along the lumen, radii of it"));
  EXPECT_THAT(*html, HasSubstr(">4</text>"));
  EXPECT_THAT(*html, Not(HasSubstr(">5</text>"))) << "beyond the end";
  for (const char* field : {"0.0 to 2.2", "50.0", "25.0", "1.5", "9.2", "75.0", "12.5"}) {
    EXPECT_THAT(*html, HasSubstr(std::string(">") + field + "</td>"));
  }
}

TEST(WallPicturesHtml, SaysWhyThereIsNoLumen) {
  const evaluate::TextFolder folder;
  folder.Write("surface.json", R"({"maps": [{"map_id": 2, "lumen": {"found": false, "reason": "only <3 frames"}}]})");
  const Result<std::string> html = WallPicturesHtml(folder.At(""));
  ASSERT_TRUE(html.ok());
  EXPECT_THAT(*html, HasSubstr("No lumen was found: only &lt;3 frames."));
  EXPECT_THAT(*html, Not(HasSubstr("<image")));
}

TEST(WallPicturesHtml, WhatIsMissingOrDamagedIsNamed) {
  const evaluate::TextFolder folder;
  EXPECT_EQ(WallPicturesHtml(folder.At("none")).code(), StatusCode::kNotFound);
  const auto error = [&](const char* json) {
    folder.Write("surface.json", json);
    return WallPicturesHtml(folder.At("")).status();
  };
  EXPECT_THAT(error("{").message(), HasSubstr("surface.json: not JSON"));
  EXPECT_THAT(error("{}").message(), HasSubstr("surface.json: "));
  EXPECT_THAT(error(R"({"maps": [{"map_id": 0}]})").message(), HasSubstr("make the surface again"));
  EXPECT_EQ(error(kFound).code(), StatusCode::kNotFound) << "the picture";
}

}  // namespace
}  // namespace haustra::report
