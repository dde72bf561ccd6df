#include "tools/report/chart_data.h"

#include <gtest/gtest.h>

#include <Eigen/Geometry>
#include <cmath>
#include <nlohmann/json.hpp>

#include "tests/tools/report/small_report.h"

namespace haustra::report {
namespace {

using Json = nlohmann::json;

Json DataOf(const evaluate::RunOutput& run, const evaluate::Reference& reference,
            const std::map<int, MapModel>& models = {}) {
  return Json::parse(MakeChartData(run, reference, EvaluateRun(run, reference, {}), models));
}

TEST(ChartData, CoverageHasOneSegmentForEachStretch) {
  const Json data = DataOf(SmallRun(), ShiftedReference(60));
  ASSERT_EQ(data["coverage"].size(), 2u);
  EXPECT_EQ(data["coverage"][0]["name"], "as answered");
  EXPECT_EQ(data["coverage"][0]["segments"],
            Json::parse("[[0.0,0.2,-2],[0.2,1.0,0],[1.0,1.2,-1],[1.2,2.0,1],[2.0,2.2,-1],[2.2,2.4,0]]"));
  EXPECT_EQ(data["coverage"][1]["segments"],
            Json::parse("[[0.0,0.2,-1],[0.2,1.0,0],[1.0,1.2,-1],[1.2,2.0,0],[2.0,2.2,-1],[2.2,2.4,0]]"));
  EXPECT_NEAR(data["duration_s"].get<double>(), 2.4, 1e-9);
}

TEST(ChartData, HiddenSceneIsARowOfItsOwn) {
  evaluate::Reference reference = ShiftedReference(60);
  reference.events = std::vector<evaluate::SequenceEvent>{{25, 29, "redout", false}};
  const Json rows = DataOf(SmallRun(), reference)["coverage"];
  ASSERT_EQ(rows.size(), 3u);
  EXPECT_EQ(rows[0]["segments"][1], Json::parse("[1.0,1.2,-4]"));
}

TEST(ChartData, MarksAreJoinsWithTheirVerdictsAndLosses) {
  const Json marks = DataOf(SmallRun(), ShiftedReference(60))["marks"];
  ASSERT_EQ(marks.size(), 3u);
  EXPECT_EQ(marks[0]["kind"], "loss");
  EXPECT_EQ(marks[0]["t"], 1.0);
  EXPECT_EQ(marks[1]["kind"], "merge");
  EXPECT_EQ(marks[1]["frame"], 49);
  EXPECT_EQ(marks[1]["text"], "map 0 and 1");
  EXPECT_EQ(marks[1]["verdict"], "true");
  EXPECT_EQ(marks[2]["kind"], "relocalisation");
}

TEST(ChartData, AlignedMapLiesOnTheTrueTrajectory) {
  const evaluate::RunOutput run = SmallRun();
  MapModel model;
  // A point 5 mm in front of the camera of frame 10, in the map.
  const Eigen::Vector3d seen = evaluate::TruePose(10) * Eigen::Vector3d(0, 0, 5);
  model.points = {evaluate::MapFromWorld(0) * seen};
  model.rgb = {{200, 100, 90}};
  const Json views = DataOf(run, ShiftedReference(60), {{0, model}})["views"];
  ASSERT_EQ(views.size(), 1u);
  EXPECT_EQ(views[0]["unit"], "mm");
  EXPECT_EQ(views[0]["truth"].size(), 60u);
  const Json& map = views[0]["maps"][0];
  ASSERT_EQ(map["lines"].size(), 3u);  // broken where there was no pose
  ASSERT_EQ(map["lines"][1].size(), 20u);
  const auto distance = [](const Json& a, const Json& b) {
    return std::hypot(a[0].get<double>() - b[0].get<double>(), a[1].get<double>() - b[1].get<double>(),
                      a[2].get<double>() - b[2].get<double>());
  };
  EXPECT_LT(distance(map["lines"][1][3], views[0]["truth"][33]), 0.2);
  EXPECT_NEAR(distance(map["points"][0], views[0]["truth"][10]), 5.0, 0.2);
  EXPECT_EQ(map["rgb"], "yGRa");
  // What turns the map's mesh turns its points.
  for (int row = 0; row < 3; ++row) {
    double at = map["shown_from_map"][4 * row + 3];
    for (int k = 0; k < 3; ++k) at += map["shown_from_map"][4 * row + k].get<double>() * model.points[0][k];
    EXPECT_NEAR(at, map["points"][0][row].get<double>(), 0.01) << row;
  }
}

TEST(ChartData, PinsLieAtTheMarksOfTheirMap) {
  evaluate::RunOutput run = SmallRun();
  // 5 mm in front of the camera of frame 10, in map 0; of the others one has no place, one is of another map.
  const Eigen::Vector3d place = evaluate::MapFromWorld(0) * (evaluate::TruePose(10) * Eigen::Vector3d(0, 0, 5));
  run.marks = SmallMarks();
  run.marks.set[0].position = place;
  run.marks.set.push_back({"elsewhere", 1, place, 1, 9, true});
  const Json view = DataOf(run, ShiftedReference(60))["views"][0];
  const Json& pins = view["maps"][0]["pins"];
  ASSERT_EQ(pins.size(), 1u);
  EXPECT_EQ(pins[0]["label"], "<b>&\"x");
  double square = 0.0;
  for (int axis = 0; axis < 3; ++axis) {
    square += std::pow(pins[0]["position"][axis].get<double>() - view["truth"][10][axis].get<double>(), 2);
  }
  EXPECT_NEAR(std::sqrt(square), 5.0, 0.2);
}

TEST(ChartData, WithoutGroundTruthMapsAreInTheirOwnUnits) {
  const Json views = DataOf(SmallRun(), evaluate::Reference())["views"];
  ASSERT_EQ(views.size(), 1u);
  EXPECT_EQ(views[0]["unit"], "map units");
  EXPECT_TRUE(views[0]["truth"].empty());
}

// Views are turned to the principal axes of what they show. Whatever these are, a left colon stays a left colon.
TEST(ChartData, AViewIsNotAMirrorImage) {
  const Eigen::Vector3d extents(50.0, 20.0, 5.0);
  for (int turn = 0; turn < 8; ++turn) {
    const Eigen::Matrix3d rotation = Eigen::AngleAxisd(0.8 * turn, Eigen::Vector3d(1, 2, 3).normalized()).matrix();
    MapModel model;
    model.points.push_back(Eigen::Vector3d::Zero());
    for (int i = 0; i < 3; ++i) model.points.push_back(rotation.col(i) * extents[i]);
    for (int i = 0; i < 400; ++i) {
      const Eigen::Vector3d some(std::sin(i), std::sin(1.7 * i), std::sin(2.3 * i));
      model.points.push_back(rotation * some.cwiseProduct(extents));
    }
    model.rgb.resize(model.points.size());
    const Json points = DataOf(SmallRun(), evaluate::Reference(), {{0, model}})["views"][0]["maps"][0]["points"];
    Eigen::Matrix3d shown;
    for (int i = 0; i < 3; ++i) {
      for (int axis = 0; axis < 3; ++axis) {
        shown(axis, i) = points[i + 1][axis].get<double>() - points[0][axis].get<double>();
      }
    }
    EXPECT_NEAR(shown.determinant(), extents.prod(), 0.01 * extents.prod()) << turn;
  }
}

// A point whose distance was never known may lie anywhere: path and wall keep their shape.
TEST(ChartData, PointFarAwayDoesNotFlattenTheMap) {
  const evaluate::RunOutput run = SmallRun();
  MapModel model;
  for (int i = 0; i < 60; ++i) {
    model.points.push_back(evaluate::MapFromWorld(0) * (evaluate::TruePose(i) * Eigen::Vector3d(0, 0, 5)));
  }
  model.points.push_back(1e8 * Eigen::Vector3d::Ones());
  model.rgb.resize(model.points.size());
  const auto line_of = [&] {
    return DataOf(run, evaluate::Reference(), {{0, model}})["views"][0]["maps"][0]["lines"][1];
  };
  const Json with_far = line_of();
  model.points.back() = model.points.front();
  const Json without = line_of();
  ASSERT_EQ(with_far.size(), 20u);
  for (std::size_t i = 0; i < with_far.size(); ++i) {
    for (int axis = 0; axis < 3; ++axis) {
      EXPECT_NEAR(with_far[i][axis].get<double>(), without[i][axis].get<double>(), 0.5) << i;
    }
  }
}

TEST(ChartData, ErrorsAreDistancesFromTheTruth) {
  const Json data = DataOf(SmallRun(), ShiftedReference(60));
  ASSERT_EQ(data["errors"].size(), 1u);
  EXPECT_EQ(data["errors"][0]["samples"].size(), 45u);
  for (const Json& sample : data["errors"][0]["samples"]) EXPECT_NEAR(sample[1].get<double>(), 0.1, 0.05);
}

TEST(ChartData, TimesAreTheSamplesOfEachStage) {
  const Json times = DataOf(SmallRun(), ShiftedReference(60))["times"];
  ASSERT_EQ(times.size(), 2u);
  EXPECT_EQ(times[0]["stage"], "tracking/total");
  EXPECT_EQ(times[0]["samples"].size(), 60u);
  EXPECT_EQ(times[0]["samples"][5], Json::parse("[0.2, 25.0]"));
  EXPECT_EQ(times[1]["samples"], Json::parse("[[1.96, 123.25]]"));
}

}  // namespace
}  // namespace haustra::report
