// Depth of a keyframe by multi-view stereo with the camera's own model.
//
// Every cell of the grid holds a plane (depth_seeds.h). Its window is carried into the sources by the plane's
// homography of rays and the Jacobian of the camera model, and compared by zero-mean normalised correlation, which the
// moving light does not disturb. Planes begin at the sparse points, spread between neighbours on a checkerboard, and
// are varied by pseudo-random steps that become smaller. The wall of a lumen is seen at a slant nearly everywhere; a
// sweep of constant depth would smear it, slanted windows do not. Sources: Bleyer, Rhemann, Rother 2011 (PatchMatch
// stereo); Galliani, Lasinger, Schindler 2015 (checkerboard, best-K over the views, homographies of planes); Besse et
// al. 2014 (smoothness of planes within PatchMatch).
#pragma once

#include <Eigen/Core>
#include <atomic>
#include <cstdint>
#include <span>
#include <vector>

#include "engine/camera/camera_model.h"
#include "engine/geometry/se3.h"
#include "engine/surface/depth_map.h"
#include "engine/surface/depth_median.h"
#include "engine/surface/depth_seeds.h"
#include "engine/surface/window_sampler.h"
#include "hal/core/status.h"
#include "hal/core/views.h"
#include "hal/depth_options.h"
#include "hal/depth_solver.h"

namespace haustra {

// A picture with its pose. Not owning.
struct DepthView {
  ImageView grey;  // kGrey8, of the camera's size
  SE3 cam_from_map;
};

// thread-bound(its owner). All memory is taken at construction and by SearchOn, but for what more seeds than ever
// before need. Match does not lock or wait; with a solver it waits for that.
class DepthMatcher {
 public:
  static constexpr std::size_t kMinSeeds = 8;

  // `camera`: of the pictures that are matched. `mask`: 255 where they show the scene, kGrey8 of the same size, copied;
  // empty: everywhere but in what is dark from the edge of the picture on. options.Validate() must be ok.
  DepthMatcher(const CameraModel& camera, ImageView mask, const DepthOptions& options);

  // Of the depth maps: the camera's size over step_px, rounded down.
  int width() const { return width_; }
  int height() const { return height_; }
  // Unit ray of a cell in the camera; zero where the model has none or the mask hides it.
  const Eigen::Vector3d& bearing(int cell) const { return cells_[cell].bearing; }

  // What a solver for this matcher is made for. Valid as long as the matcher.
  DepthSolverPlan solver_plan() const;
  // Its sizes alone, without a matcher.
  static DepthSolverPlan SolverSizes(const CameraModel& camera, const DepthOptions& options);
  // From now on the search runs on the solver, which outlives the matcher. Takes memory: before the first Match.
  void SearchOn(DepthSolver* solver);

  // A search of our own gives up soon after this becomes true: kCancelled. It lives until another one is named; null:
  // never.
  void StopWhen(const std::atomic<bool>* stop) { stop_ = stop; }

  // What one of so many pixels takes on the heap.
  static std::size_t BytesFor(int width_px, int height_px, const DepthOptions& options);

  // Fills `map`, which has this size. Cells without a source that sees them under enough parallax have no depth.
  // Ranges lie within a factor of two of those of the seeds; outliers are replaced (depth_median.h). Of more than
  // max_sources sources the first are used.
  // Same input, same bits. kInvalidArgument: a picture or the map is of another size. kFailedPrecondition: no source,
  // or fewer than kMinSeeds seeds with a positive inverse range; the map has no depth then. kCancelled: stopped;
  // what the map holds is anything. Or what the solver says.
  // Cost without one: cells * iterations * 16 * sources windows at most; 1.0 s for 90x67 cells and 6 sources on one
  // x86-64 core of 2 GHz.
  Status Match(const DepthView& reference, std::span<const DepthView> sources, std::span<const DepthSeed> seeds,
               DepthMap* map);

 private:
  struct Cell {
    Eigen::Vector3d bearing, bearing_dx, bearing_dy;  // change to the next pixel
    double centre_x = 0.0, centre_y = 0.0;            // pixel
    bool is_usable = false;
  };
  struct Source {
    ImageView grey;
    Eigen::Matrix3d rotation;     // source_from_reference
    Eigen::Vector3d translation;  // map units
  };
  struct Estimate {
    InversePlane plane;
    float data = 0.0f;  // cost of the pictures alone
  };

  // Where no mask tells: what is dark from the edge of the picture on, along a row or a column.
  void EraseSurround(ImageView grey, DepthMap* map) const;
  Status Search(ImageView reference, DepthMap* map);
  Status SearchElsewhere(ImageView reference, DepthMap* map);
  void PrepareWindows(ImageView grey);
  // Mean over the sources that match best; depth_search::kNoCost where the cell has no window, or no source shows it.
  float DataCost(int cell, const InversePlane& plane) const;
  float SourceCost(int cell, const InversePlane& plane, const Source& source, bool* is_seen) const;
  // By distance, then left, right, up, down; -1: there is no usable cell.
  int NeighbourOf(int cell, int which) const;
  double SmoothCost(int cell, const InversePlane& plane) const;
  double TotalCost(int cell, const Estimate& estimate) const;
  bool IsPossible(int cell, const InversePlane& plane) const;
  void Consider(int cell, const InversePlane& plane, Estimate* best, double* best_cost) const;
  void Improve(int cell, int iteration);
  // Relative step of the range that moves the picture in the source with most parallax by one pixel; 0: no parallax.
  double StepOfOnePixel(int cell, const InversePlane& plane) const;
  void Answer(int cell, DepthMap* map) const;

  CameraModel camera_;
  DepthOptions options_;
  double max_cosine_ = 1.0;  // of the angle between the rays of reference and source
  int width_ = 0, height_ = 0;
  SeedGrid seed_grid_;
  DepthMedian median_;
  WindowSampler sampler_;
  bool has_mask_ = false;
  std::vector<std::uint8_t> is_scene_;  // of the matched picture, 1 where the mask shows it
  std::vector<Cell> cells_;
  std::vector<Estimate> estimates_;
  std::vector<InversePlane> first_;  // from the seeds
  std::vector<float> weight_;        // sampler_.padded_size() a cell: of the sample, all of a window sum to one
  std::vector<float> pattern_;       // weight times deviation from the mean
  std::vector<float> variance_;      // of the window
  std::vector<Source> sources_;      // max_sources
  int num_sources_ = 0;
  double min_inverse_ = 0.0, max_inverse_ = 0.0;
  const std::atomic<bool>* stop_ = nullptr;

  // Of a solver.
  DepthSolver* solver_ = nullptr;
  std::vector<DepthCell> solver_cells_;
  std::vector<DepthSource> solver_sources_;
  std::vector<float> solver_planes_;
  std::vector<float> solver_ranges_;
  std::vector<std::uint8_t> solver_confidences_;
};

}  // namespace haustra
