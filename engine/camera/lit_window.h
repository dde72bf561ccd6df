// How much of the picture the scope's window fills, learnt from what the light falls on. A tower's picture is often a
// third window and two thirds dark surround with letters and a second, small picture in it. Where no mask says so, the
// surround is what has not been lit for two to four seconds: a test card or a menu before the scope is plugged in is
// forgotten after that time. thread-bound(its owner); rt-safe. Of each picture but the first a quarter of the rows is
// looked at in turn, at most 4096 pixels.
#pragma once

#include <array>
#include <cstdint>

#include "hal/core/time.h"
#include "hal/core/views.h"

namespace haustra {

// What says of a pixel whether it is lit, 0 to 255: of colour pictures the brighter of green, which is most of the
// luma, and red, which tissue has most of. Other formats have their luma.
int LitValue(const ImageView& image, int x, int y);

// From here on no compressed surround, and below kDarkThreshold surround if it reaches to the edge of the picture: the
// black of a video is 16, and compression adds to it. What lies between may be either.
inline constexpr int kLitThreshold = 40;
inline constexpr int kDarkThreshold = 24;

class LitWindow {
 public:
  // Any pixel format and size, not empty.
  void Observe(const ImageView& image, TimePoint time);
  // Part of the picture's area, [kMinShare, 1]: the largest lit area, whose rows are filled between their ends, as the
  // lumen is dark. 1 as long as nothing was lit.
  double share() const { return share_; }

  // The smallest window that is believed: the first view of a dark lumen shows a part of it only.
  static constexpr double kMinShare = 0.15;
  // Pictures until all rows have been looked at.
  static constexpr int kTurns = 4;

 private:
  static constexpr int kSide = 64;  // cells in a row and in a column, a bit each
  using Cells = std::array<std::uint64_t, kSide>;

  // Of one row those that are asked about.
  static std::uint64_t LitCells(const ImageView& image, int row_of_cells, std::uint64_t asked);
  // Without what is less than three cells wide or high, such as letters.
  static Cells Open(const Cells& cells);
  static Cells LargestArea(Cells cells);

  Cells recent_{}, older_{};  // lit since `since_`, and in the time before
  Cells ever_{};              // both, when the share was last found
  TimePoint since_;
  std::uint64_t num_pictures_ = 0, first_picture_ = 0;  // all; those before `since_`
  double share_ = 1.0;
};

}  // namespace haustra
