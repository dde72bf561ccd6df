#include "engine/io/map_export.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <limits>

#include "tests/engine/io/small_map.h"

namespace haustra {
namespace {

using ::testing::HasSubstr;

TEST(ValidateMapExport, ConsistentMapIsOk) { EXPECT_TRUE(Validate(SmallMap()).ok()); }

TEST(ValidateMapExport, EmptyMapIsOk) { EXPECT_TRUE(Validate(MapExport{}).ok()); }

struct Defect {
  const char* name;
  void (*make)(MapExport*);
  const char* message;
};

class ValidateDefect : public ::testing::TestWithParam<Defect> {};

TEST_P(ValidateDefect, IsNamed) {
  MapExport map = SmallMap();
  GetParam().make(&map);
  const Status status = Validate(map);
  EXPECT_EQ(status.code(), StatusCode::kInvalidArgument);
  EXPECT_THAT(status.message(), HasSubstr(GetParam().message));
}

INSTANTIATE_TEST_SUITE_P(
    All, ValidateDefect,
    ::testing::Values(
        Defect{"KeyframeTwice", [](MapExport* m) { m->keyframes[1].id = 0; }, "keyframe 0 is there twice"},
        Defect{"NegativeKeyframeId", [](MapExport* m) { m->keyframes[0].id = -3; }, "keyframe -3 has a negative id"},
        Defect{"PointTwice", [](MapExport* m) { m->points[1].id = 5; }, "point 5 is there twice"},
        Defect{"NoName", [](MapExport* m) { m->keyframes[0].image_name.clear(); }, "has no image name"},
        Defect{"BlankInName", [](MapExport* m) { m->keyframes[0].image_name = "a b.jpg"; }, "'a b.jpg'"},
        Defect{"MissingPointIds", [](MapExport* m) { m->keyframes[0].point_ids.pop_back(); },
               "2 keypoints but 1 point ids"},
        Defect{"UnknownKeyframe", [](MapExport* m) { m->points[0].track[0].first = 3; }, "keyframe 3, which is not"},
        Defect{"KeypointOutOfRange", [](MapExport* m) { m->points[0].track[1].second = 3; },
               "keypoint 3 of keyframe 12"},
        Defect{"TrackToOtherPoint", [](MapExport* m) { m->points[0].track[1].second = 0; }, "says otherwise"},
        Defect{"KeypointWithoutTrack", [](MapExport* m) { m->points[1].track.clear(); }, "3 times, the tracks have 2"},
        Defect{"PositionNotFinite",
               [](MapExport* m) { m->points[1].position.x() = std::numeric_limits<double>::infinity(); },
               "point 9 has a position that is not finite"},
        Defect{"PoseNotFinite",
               [](MapExport* m) {
                 m->keyframes[1].cam_from_map.translation.x() = std::numeric_limits<double>::quiet_NaN();
               },
               "keyframe 12 has a pose that is not finite"}),
    [](const auto& defect) { return std::string(defect.param.name); });

}  // namespace
}  // namespace haustra
