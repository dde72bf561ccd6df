// Finds what stands still in the picture while the scene moves behind it: text and frames that the tower paints over
// the video, dirt on the lens, the edge of the scope's window. Nobody need draw a mask of it.
//
// Matches of two views say which features stood still and which moved. One that stands still is evidence where the
// features around it move by many times their noise, and move together: a scene that rests, the far end of the lumen,
// and false matches in a resting picture are none. Evidence is kept in a grid of the picture; it rises with the time
// that a place is seen to stand still, and falls with the time that something moves through it.
// thread-bound(tracking); rt-safe, memory taken at construction, deterministic.
#pragma once

#include <Eigen/Core>
#include <cstddef>
#include <cstdint>
#include <span>
#include <vector>

#include "hal/vision_device.h"

namespace haustra {

class StaticOverlay {
 public:
  // One feature in two views.
  struct Motion {
    Eigen::Vector2f from_px = Eigen::Vector2f::Zero();
    Eigen::Vector2f to_px = Eigen::Vector2f::Zero();
    float sigma_px = 1.0f;  // of where a feature is found, each view
  };

  StaticOverlay(int width_px, int height_px, int max_features);
  // Taken at construction.
  static std::size_t BytesFor(int max_features);

  // What two views have in common, the later of them at most `seconds` after the end of what was observed last; longer
  // times count as kMaxSeconds. Writes which of the matches stand still before what moves: 1, at once, whatever the
  // grid says. At most max_features matches count; none when the spans differ in length.
  void Observe(std::span<const Motion> motions, double seconds, std::span<std::uint8_t> stands_still);

  // Whether a place of the picture has been seen to stand still for long enough.
  bool IsStatic(float x_px, float y_px) const {
    return num_static_ > 0 && grid_[CellOf(x_px, y_px)].evidence >= kStatic;
  }
  // Places of the grid for which that is so.
  int num_static() const { return num_static_; }

  // Pairs of features of two views that may be one that stands still: the same place, scale and angle. Writes for each
  // feature of `now` the index of its twin in `before`, or -1. Both as the device gives them: detected features by
  // octave, then y.
  void FindTwins(std::span<const Keypoint> before, std::span<const Keypoint> now, double sigma_k, double sigma_0_px,
                 std::span<std::int32_t> twins) const;

 private:
  static constexpr int kColumns = 192;  // cells of the grid: of the size of a letter's features
  static constexpr int kRows = 144;
  static constexpr int kPartColumns = 12;  // parts of the picture in which motion is one
  static constexpr int kPartRows = 9;
  static constexpr float kStatic = 0.5f;
  static constexpr double kMaxSeconds = 0.25;

  enum class Kind : std::uint8_t { kSlow, kStill, kMoving, kMovingTogether };
  struct Cell {
    float evidence = 0.0f;
    Kind seen = Kind::kSlow;  // by the current observation
  };
  struct Part {
    int first = 0;  // in order_
    int num = 0;
    int num_slow = 0;
    int num_still = 0;
    int num_moving = 0;  // together
  };
  // Parts up to so many away, cut off at the edges of the picture.
  struct PartRange {
    int first_column, last_column, first_row, last_row;
  };

  std::size_t CellOf(float x_px, float y_px) const;
  int PartOf(const Eigen::Vector2f& px) const;
  static PartRange Around(int part, int reach);
  void SortIntoParts(std::span<const Motion> motions);
  bool MovesTogether(std::span<const Motion> motions, std::size_t i) const;
  bool IsBeforeMotion(int part) const;
  void Learn(std::span<const Motion> motions, double seconds);
  void Mark(float x_px, float y_px, Kind kind, int reach);

  float width_px_, height_px_;
  std::vector<Cell> grid_;
  std::vector<Part> parts_;
  std::vector<std::int32_t> order_;  // matches, by part
  std::vector<Kind> kinds_;          // of the matches
  int num_static_ = 0;
};

}  // namespace haustra
