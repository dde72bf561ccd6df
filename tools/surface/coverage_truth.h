// Coverage of the wall against what a rendered sequence knows (haustra render --seen-wall).
#pragma once

#include <Eigen/Core>
#include <cstddef>
#include <optional>
#include <string>
#include <vector>

#include "engine/coverage/wall_grid.h"
#include "hal/core/status.h"
#include "tools/evaluate/evaluation.h"
#include "tools/surface/map_coverage.h"

namespace haustra::surface {

// The wall of the colon in rows along the lumen, each of the same number of cells around it.
struct TrueWall {
  struct Cell {
    Eigen::Vector3d position = Eigen::Vector3d::Zero();  // world, mm
    WallView view = WallView::kNever;
  };
  int columns = 0;
  std::vector<Cell> cells;
  std::vector<Eigen::Vector3d> middles;  // of the rows

  int num_rows() const { return static_cast<int>(middles.size()); }
};

// kNotFound, kUnavailable: the file. kInvalidArgument with file and line: not such a table, or rows are not complete.
Result<TrueWall> ReadTrueWall(const std::string& path);

struct CoverageScore {
  struct Segment {
    int map_id = 0;
    double begin_radii = 0.0, end_radii = 0.0;
    double found = 0.0, truth = 0.0;            // shares seen well
    double found_seen = 0.0, truth_seen = 0.0;  // shares seen at all, well or poorly
    double points() const { return 100.0 * (found - truth); }
    double seen_points() const { return 100.0 * (found_seen - truth_seen); }
  };
  // Of the places that hang together, in whose cells the wall was never seen and was called seen: all, and the largest.
  struct FalsePlaces {
    double all_mm2 = 0.0, largest_mm2 = 0.0;
  };
  std::vector<Segment> segments;
  // Cells of the maps by what they were called and what the nearest place of the true wall was: [called][true].
  std::size_t cells[3][3] = {};
  FalsePlaces falsely_seen;  // called well or poorly
  FalsePlaces falsely_well;  // called well

  std::size_t num_cells() const;
  double worst_points() const;       // of the segments, without its sign; 0: none
  double worst_seen_points() const;  // the same
  double agreement() const;          // share of the cells
};

// Maps are laid on the truth by the Sim(3) that `evaluation` has found; those without one, or without a lumen, are left
// out. A segment is compared with the rows of the true wall from its first to its last row. Nothing when no map can be
// judged.
std::optional<CoverageScore> JudgeCoverage(const std::vector<SurfaceMap>& maps,
                                           const std::vector<MapCoverage>& coverages,
                                           const evaluate::Evaluation& evaluation, const TrueWall& truth);

}  // namespace haustra::surface
