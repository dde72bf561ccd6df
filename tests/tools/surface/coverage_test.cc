// Coverage of a tube that is known by geometry, its files, and its judge.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <nlohmann/json.hpp>

#include "tests/tools/evaluate/text_folder.h"
#include "tests/tools/surface/tube_surface.h"
#include "tools/surface/coverage_picture.h"
#include "tools/surface/coverage_text.h"
#include "tools/surface/coverage_truth.h"

namespace haustra::surface {
namespace {

using ::testing::HasSubstr;
using ::testing::StartsWith;

MapCoverage CoverageOfTube() {
  const TubeSurface tube;
  Result<MapCoverage> coverage =
      MakeMapCoverage(tube.map, tube.surface, FramesOf(tube.run, tube.map.map_id), {}, nullptr, CoverageOptions());
  EXPECT_TRUE(coverage.ok()) << coverage.status().ToString();
  return *coverage;
}

// As the map, in a world of 40 mm a map unit.
const Sim3 kTruthFromMap(40.0, Eigen::Quaterniond(Eigen::AngleAxisd(0.6, Eigen::Vector3d::UnitX())),
                         Eigen::Vector3d(10.0, -5.0, 3.0));

TrueWall TruthLike(const WallGrid& wall) {
  TrueWall truth;
  truth.columns = WallGrid::kAngles;
  for (int row = 0; row < wall.num_rows(); ++row) {
    Eigen::Vector3d sum = Eigen::Vector3d::Zero();
    for (int column = 0; column < WallGrid::kAngles; ++column) {
      const Eigen::Vector3d position = kTruthFromMap * wall.PointOf(row, column).position_in_map;
      truth.cells.push_back({position, wall.cell(row, column).view});
      sum += position / WallGrid::kAngles;
    }
    truth.middles.push_back(sum);
  }
  return truth;
}

evaluate::Evaluation Aligned() {
  evaluate::Evaluation evaluation;
  evaluate::MapEvaluation& map = evaluation.per_map.emplace_back();
  map.map_id = 0;
  map.truth_from_map = kTruthFromMap;
  return evaluation;
}

TEST(MapCoverage, OfATubeIsWhatItsGeometrySays) {
  const MapCoverage coverage = CoverageOfTube();
  ASSERT_TRUE(coverage.wall) << coverage.no_lumen;
  const WallGrid& wall = *coverage.wall;
  EXPECT_NEAR(wall.lumen().radius_mu, kTubeRadius, 0.02);
  // The scope passed from 1 to 4. What lies 0.6 and more beyond its first place was in the picture, on all sides.
  EXPECT_NEAR((wall.end_claimed_row() - wall.first_claimed_row()) * wall.step_mu(), 3.0, 0.1);
  for (int row = wall.first_claimed_row(); row < wall.end_claimed_row(); ++row) {
    const double beyond = wall.LengthOf(row) - wall.first_claimed_row() * wall.step_mu();
    int well = 0;
    for (int column = 0; column < WallGrid::kAngles; ++column) {
      well += wall.cell(row, column).view == WallView::kWell ? 1 : 0;
    }
    if (beyond > 0.7) {
      EXPECT_GE(well, WallGrid::kAngles - 1) << beyond;
    }
    if (beyond < 0.15) {
      EXPECT_LT(well, WallGrid::kAngles / 3) << beyond << ": only in the corners of the picture";
    }
  }
  ASSERT_EQ(coverage.segments.size(), 3u);
  EXPECT_GT(coverage.segments[2].well, 0.98);
  EXPECT_LT(coverage.segments[0].well, 0.8);
  // Times are seconds since the first frame: the last place is seen until the end, and from when it is near enough.
  const WallCell& last = wall.cell(wall.end_claimed_row() - 1, 0);
  EXPECT_GT(last.first_s, 0.8);
  EXPECT_LE(last.last_s, 2.4);
}

// No depth is found in a dark surround. The wall that it covers is known by the depth of other keyframes, and was not
// looked at; what has no depth within the window, as the far end of the lumen, was.
TEST(MapCoverage, ADarkSurroundThatNoMaskTellsShowsNoWall) {
  RecordProperty("req", "COV-001");
  TubeSurface tube;
  const int width = tube.map.camera.width_px, height = tube.map.camera.height_px;
  std::vector<std::uint8_t> window(static_cast<std::size_t>(width) * height, 0);
  for (int y = 24; y < height - 24; ++y)
    std::fill_n(&window[static_cast<std::size_t>(y) * width + 40], width - 80, 255);
  for (KeyframeDepth& each : tube.surface.depths) {
    for (int i = 0; i < each.depth.num_cells(); ++i) {
      const int x = i % each.depth.width(), y = i / each.depth.width();
      if (window[static_cast<std::size_t>(4 * y) * width + 4 * x] == 0) each.depth.Erase(i);
    }
  }
  const auto cover = [&](ImageView mask) {
    Result<MapCoverage> coverage =
        MakeMapCoverage(tube.map, tube.surface, FramesOf(tube.run, tube.map.map_id), mask, nullptr, CoverageOptions());
    EXPECT_TRUE(coverage.ok() && coverage->wall);
    return *coverage;
  };
  const MapCoverage truth = cover({window.data(), width, height, width, PixelFormat::kGrey8});
  const MapCoverage learnt = cover({});
  EXPECT_NEAR(learnt.whole.well, truth.whole.well, 1e-9);
  EXPECT_NEAR(learnt.whole.poorly, truth.whole.poorly, 1e-9);
  EXPECT_GT(truth.whole.well, 0.3);
}

TEST(MapCoverage, AFlatWallHasNoLumenAndSaysWhy) {
  RecordProperty("req", "COV-003");
  // A wall at the side, seen by a camera that goes along it.
  const TubeSurface flat(
      [](double, const Eigen::Vector3d& bearing) { return bearing.y() > 0.1 ? 0.5 / bearing.y() : 0.0; });
  const Result<MapCoverage> coverage =
      MakeMapCoverage(flat.map, flat.surface, FramesOf(flat.run, flat.map.map_id), {}, nullptr, CoverageOptions());
  ASSERT_TRUE(coverage.ok());
  EXPECT_FALSE(coverage->wall);
  EXPECT_THAT(coverage->no_lumen, HasSubstr("of the directions around the path"));
  EXPECT_THAT(ToText(3, *coverage), StartsWith("map 3: no lumen found: "));
  nlohmann::ordered_json json;
  AddCoverage(*coverage, &json);
  EXPECT_EQ(json["lumen"]["found"], false);
  EXPECT_EQ(json["lumen"]["reason"], coverage->no_lumen);
  EXPECT_FALSE(json.contains("wall_coverage"));
}

// What a search has found: the depths of the tube.
FoundDepths DepthsOf(const TubeSurface& tube) {
  FoundDepths found;
  found.step_px = 4;
  for (const KeyframeDepth& each : tube.surface.depths) {
    FoundDepth& depth = found.depths.emplace_back();
    depth.keyframe = each.keyframe;
    depth.raw = each.depth;
    depth.colour.Resize(60, 45, PixelFormat::kGrey8);
  }
  return found;
}

// A ring narrows the tube: on which side of its edge a cell lies is a matter of a pixel.
TEST(MapSurface, BesideTheEdgeOfAFoldNothingIsClaimed) {
  const TubeSurface tube([](double z, const Eigen::Vector3d& bearing) {
    const double to_wall = TubeSurface::TubeRange(z, bearing), to_ring = (3.0 - z) / bearing.z();
    const Eigen::Vector2d place = Eigen::Vector2d(0.04, -0.03) + to_ring * bearing.head<2>();
    return to_ring > 0.0 && to_ring < to_wall && place.norm() > 0.25 ? to_ring : to_wall;
  });
  const Result<MapSurface> surface = MakeMapSurface(tube.map, DepthsOf(tube), SurfaceOptions());
  ASSERT_TRUE(surface.ok()) << surface.status().ToString();
  const auto num_jumps = [](const DepthMap& map) {
    int count = 0;
    for (int cell = 0; cell + 60 < map.num_cells(); ++cell) {
      for (const int other : {cell + 1, cell + 60}) {
        if (!map.has_depth(cell) || !map.has_depth(other) || (other % 60 == 0 && other == cell + 1)) continue;
        count += std::abs(std::log(map.range_mu(cell) / map.range_mu(other))) > 0.45 ? 1 : 0;
      }
    }
    return count;
  };
  const DepthMap& truth = tube.surface.depths[4].depth;
  const DepthMap& answer = surface->depths[4].depth;
  EXPECT_GT(num_jumps(truth), 30);
  EXPECT_EQ(num_jumps(answer), 0);
  const auto num_known = [](const DepthMap& map) {
    return map.num_cells() - std::count(map.codes().begin(), map.codes().end(), DepthMap::kNoDepth);
  };
  EXPECT_GT(num_known(answer), 0.8 * num_known(truth));
}

// What a keyframe claims before the wall hangs in the lumen: the others see through it, and say how far the wall is.
TEST(MapSurface, AStripThatOthersSeeThroughGetsTheirRange) {
  const TubeSurface tube;
  FoundDepths found = DepthsOf(tube);
  DepthMap& raw = found.depths[4].raw;
  for (int cell = 8 * 60 + 10; cell < 8 * 60 + 20; ++cell) raw.Set(cell, 2.0 * raw.inverse_range(cell), 200);
  for (const int num_threads : {1, 3}) {
    SurfaceOptions options;
    options.num_threads = num_threads;
    const Result<MapSurface> surface = MakeMapSurface(tube.map, found, options);
    ASSERT_TRUE(surface.ok()) << surface.status().ToString();
    for (int cell = 8 * 60 + 10; cell < 8 * 60 + 20; ++cell) {
      ASSERT_TRUE(surface->depths[4].depth.has_depth(cell));
      // One cell of another keyframe reaches over 5 % of the range here.
      EXPECT_NEAR(surface->depths[4].depth.range_mu(cell) / tube.surface.depths[4].depth.range_mu(cell), 1.0, 0.06);
    }
  }
}

TEST(CoverageText, CellsAreALineEach) {
  const MapCoverage coverage = CoverageOfTube();
  const std::string csv = CellsCsv(*coverage.wall);
  EXPECT_THAT(csv, StartsWith("row,column,length_radii,angle_deg,x_mu,y_mu,z_mu,seen,first_s,last_s\n0,0,0.0"));
  const int rows = coverage.wall->end_claimed_row() - coverage.wall->first_claimed_row();
  EXPECT_EQ(std::count(csv.begin(), csv.end(), '\n'), 1 + rows * WallGrid::kAngles);
  EXPECT_THAT(csv, HasSubstr(",never,,\n"));
  EXPECT_THAT(csv, HasSubstr(",well,"));
}

TEST(CoverageText, TheSummaryHasTheWholeAndItsSegments) {
  const MapCoverage coverage = CoverageOfTube();
  nlohmann::ordered_json json;
  AddCoverage(coverage, &json);
  EXPECT_EQ(json["lumen"]["found"], true);
  // Through the middle of the tube, from where the scope began to where it ended.
  const auto line = json["lumen"]["line"].get<std::vector<double>>();
  ASSERT_GE(line.size(), 3u * 4 * 6);
  ASSERT_EQ(line.size() % 3, 0u);
  for (std::size_t i = 0; i < line.size(); i += 3) EXPECT_LT(std::hypot(line[i], line[i + 1]), 0.1 * kTubeRadius);
  EXPECT_NEAR(line[line.size() - 1] - line[2], 6.0 * kTubeRadius, 0.1);
  EXPECT_EQ(json["wall_coverage"], coverage.whole.well);
  ASSERT_EQ(json["segments"].size(), 3u);
  EXPECT_EQ(json["segments"][1]["wall_coverage"], coverage.segments[1].well);
  EXPECT_NEAR(json["segments"][1]["from_radii"].get<double>(), 2.0, 0.1);
  EXPECT_EQ(json["segments"][0]["first_s"], 0.0);
  EXPECT_THAT(ToText(0, coverage), HasSubstr("of the wall along 6.0 radii of the lumen"));
}

TEST(UnrolledPicture, HasASquareOfItsColourForEachCell) {
  MapCoverage coverage = CoverageOfTube();
  WallGrid& wall = *coverage.wall;
  const int first = wall.first_claimed_row();
  wall.cell(first + 2, 5).view = WallView::kPoorly;
  wall.cell(first + 3, 5).view = WallView::kWell;
  wall.cell(first + 4, 5).view = WallView::kNever;
  const Image picture = UnrolledPicture(wall);
  EXPECT_EQ(picture.width(), (wall.end_claimed_row() - first) * kCellPx);
  EXPECT_EQ(picture.height(), WallGrid::kAngles * kCellPx);
  for (int k = 2; k < 5; ++k) {
    const std::array<std::uint8_t, 3> rgb = ColourOf(wall.cell(first + k, 5).view);
    const std::uint8_t* pixel = picture.row(5 * kCellPx + 1) + 3 * (k * kCellPx + 2);
    EXPECT_THAT((std::array<int, 3>{pixel[2], pixel[1], pixel[0]}), ::testing::ElementsAre(rgb[0], rgb[1], rgb[2]));
  }
}

TEST(JudgeCoverage, TheTruthItselfIsWithoutFault) {
  const MapCoverage coverage = CoverageOfTube();
  const TubeSurface tube;
  const auto score = JudgeCoverage({tube.map}, {coverage}, Aligned(), TruthLike(*coverage.wall));
  ASSERT_TRUE(score);
  EXPECT_EQ(score->segments.size(), 3u);
  EXPECT_EQ(score->worst_points(), 0.0);
  EXPECT_EQ(score->worst_seen_points(), 0.0);
  EXPECT_EQ(score->agreement(), 1.0);
  EXPECT_EQ(score->falsely_seen.all_mm2, 0.0);
  EXPECT_EQ(score->falsely_well.all_mm2, 0.0);
}

TEST(JudgeCoverage, WhatWasNeverSeenIsMeasuredWhereItHangsTogether) {
  const MapCoverage coverage = CoverageOfTube();
  const WallGrid& wall = *coverage.wall;
  const TubeSurface tube;
  TrueWall truth = TruthLike(wall);
  // A block across the seam of the angle, and one cell apart from it.
  const int row = wall.end_claimed_row() - 10;
  for (int r = row; r < row + 4; ++r) {
    for (int c = -3; c < 3; ++c) truth.cells[r * 64 + (c + 64) % 64].view = WallView::kNever;
  }
  truth.cells[(row + 1) * 64 + 30].view = WallView::kNever;
  const auto score = JudgeCoverage({tube.map}, {coverage}, Aligned(), truth);
  ASSERT_TRUE(score);
  const double cell_mm2 = std::pow(40.0 * wall.step_mu(), 2);
  EXPECT_NEAR(score->falsely_well.largest_mm2, 24 * cell_mm2, 0.1 * 24 * cell_mm2);
  EXPECT_NEAR(score->falsely_well.all_mm2, 25 * cell_mm2, 0.1 * 25 * cell_mm2);
  EXPECT_EQ(score->falsely_seen.largest_mm2, score->falsely_well.largest_mm2);
  EXPECT_EQ(score->cells[2][0], 25u) << "called well, was never";
  const nlohmann::ordered_json json = ToJson(*score);
  EXPECT_EQ(json["cells"]["called_well_was_never"], 25);
  EXPECT_EQ(json["segments"].size(), 3u);
  EXPECT_THAT(ToText(*score), HasSubstr("called seen, never was"));
}

// Whoever reads the picture takes both for seen.
TEST(JudgeCoverage, WhatIsCalledPoorlySeenIsCalledSeen) {
  RecordProperty("req", "COV-001");
  MapCoverage coverage = CoverageOfTube();
  const TubeSurface tube;
  TrueWall truth = TruthLike(*coverage.wall);
  // A block of four by six cells, of which half is called seen well; two cells further on one that is called never.
  const int row = coverage.wall->end_claimed_row() - 10;
  for (int r = row; r < row + 4; ++r) {
    for (int c = 10; c < 16; ++c) {
      truth.cells[r * 64 + c].view = WallView::kNever;
      coverage.wall->cell(r, c).view = c < 13 ? WallView::kWell : WallView::kPoorly;
    }
    truth.cells[r * 64 + 18].view = WallView::kNever;
    coverage.wall->cell(r, 18).view = WallView::kNever;
  }
  const auto score = JudgeCoverage({tube.map}, {coverage}, Aligned(), truth);
  ASSERT_TRUE(score);
  const double cell_mm2 = std::pow(40.0 * coverage.wall->step_mu(), 2);
  EXPECT_NEAR(score->falsely_seen.largest_mm2, 24 * cell_mm2, 0.1 * 24 * cell_mm2);
  EXPECT_NEAR(score->falsely_seen.all_mm2, 24 * cell_mm2, 0.1 * 24 * cell_mm2);
  EXPECT_NEAR(score->falsely_well.largest_mm2, 12 * cell_mm2, 0.1 * 12 * cell_mm2);
  EXPECT_NEAR(score->falsely_well.all_mm2, 12 * cell_mm2, 0.1 * 12 * cell_mm2);
  const nlohmann::ordered_json json = ToJson(*score);
  EXPECT_EQ(json["false_mm2"], score->falsely_seen.all_mm2);
  EXPECT_EQ(json["largest_false_mm2"], score->falsely_seen.largest_mm2);
  EXPECT_EQ(json["false_well_mm2"], score->falsely_well.all_mm2);
  EXPECT_EQ(json["largest_false_well_mm2"], score->falsely_well.largest_mm2);
  EXPECT_THAT(ToText(*score), HasSubstr("called seen well, never was"));
}

TEST(JudgeCoverage, SegmentsSayHowMuchWasSeenAtAll) {
  MapCoverage coverage = CoverageOfTube();
  const TubeSurface tube;
  const TrueWall truth = TruthLike(*coverage.wall);
  // Of a segment some rows are called seen poorly that were seen well: what was seen at all is the same.
  const WallCoverage middle = coverage.segments[1];
  for (int r = middle.first_row; r < middle.first_row + 5; ++r) {
    for (int c = 0; c < WallGrid::kAngles; ++c) {
      WallCell& cell = coverage.wall->cell(r, c);
      if (cell.view == WallView::kWell) cell.view = WallView::kPoorly;
    }
  }
  coverage.segments[1] = CoverageOf(*coverage.wall, middle.first_row, middle.end_row);
  const auto score = JudgeCoverage({tube.map}, {coverage}, Aligned(), truth);
  ASSERT_TRUE(score);
  EXPECT_LT(score->segments[1].points(), -5.0);
  EXPECT_NEAR(score->segments[1].seen_points(), 0.0, 1e-9);
  const nlohmann::ordered_json json = ToJson(*score);
  EXPECT_NEAR(json["worst_seen_points"].get<double>(), 0.0, 1e-9);
  EXPECT_NEAR(json["segments"][1]["seen"].get<double>(), json["segments"][1]["true_seen"].get<double>(), 1e-9);
}

TEST(JudgeCoverage, WithoutAnAlignmentThereIsNothing) {
  const MapCoverage coverage = CoverageOfTube();
  const TubeSurface tube;
  EXPECT_FALSE(JudgeCoverage({tube.map}, {coverage}, {}, TruthLike(*coverage.wall)));
}

TEST(ReadTrueWall, SaysWhatIsWrongWithFileAndLine) {
  const evaluate::TextFolder folder;
  const std::string header = "row,column,arc_mm,angle_deg,x_mm,y_mm,z_mm,area_mm2,seen\n";
  const std::string row0 = "0,0,1,2,1.5,2.5,3.5,4,well\n0,1,1,2,3.5,2.5,3.5,4,poorly\n";
  const auto error = [&](const std::string& text) {
    folder.Write("w.csv", text);
    return ReadTrueWall(folder.At("w.csv")).status().message();
  };
  folder.Write("w.csv", header + row0 + "1,0,1,2,1,2,3,4,never\n1,1,1,2,1,2,3,4,well\n");
  const Result<TrueWall> wall = ReadTrueWall(folder.At("w.csv"));
  ASSERT_TRUE(wall.ok()) << wall.status().ToString();
  EXPECT_EQ(wall->columns, 2);
  EXPECT_EQ(wall->num_rows(), 2);
  EXPECT_EQ(wall->cells[1].view, WallView::kPoorly);
  EXPECT_EQ(wall->middles[0], Eigen::Vector3d(2.5, 2.5, 3.5));
  EXPECT_THAT(error(header + row0 + "1,1,1,2,1,2,3,4,well\n"), HasSubstr("w.csv:4: row and column do not follow"));
  EXPECT_THAT(error(header + row0 + "1,0,1,2,1,2,3,4,well\n"), HasSubstr("the last row is not complete"));
  EXPECT_THAT(error(header + "0,0,1,2,1,2,3,4,half\n"),
              HasSubstr("w.csv:2: seen is 'half', not well, poorly or never"));
  EXPECT_THAT(error(header + "0,0,1,2,x,2,3,4,well\n"), HasSubstr("w.csv:2: x_mm is 'x'"));
  EXPECT_THAT(error(header), HasSubstr("not complete"));
  EXPECT_EQ(ReadTrueWall(folder.At("none.csv")).code(), StatusCode::kNotFound);
}

TEST(MapCoverage, CanBeStopped) {
  const TubeSurface tube;
  const std::atomic<bool> stop{true};
  EXPECT_EQ(MakeMapCoverage(tube.map, tube.surface, FramesOf(tube.run, tube.map.map_id), {}, &stop, {}).code(),
            StatusCode::kCancelled);
}

}  // namespace
}  // namespace haustra::surface
