#include "engine/camera/lit_window.h"

#include <algorithm>
#include <bit>
#include <chrono>

namespace haustra {
namespace {

// A scope that looks about has lit all of its window, and a test card is soon forgotten.
constexpr std::chrono::seconds kMemory{2};
constexpr int kSamples = 2;  // of a cell, across and down

}  // namespace

int LitValue(const ImageView& image, int x, int y) {
  const std::uint8_t* row = image.row(y);
  switch (image.format) {
    case PixelFormat::kBgr8: return std::max(row[3 * x + 1], row[3 * x + 2]);
    case PixelFormat::kYuyv: return row[2 * x];
    case PixelFormat::kUyvy: return row[2 * x + 1];
    case PixelFormat::kGrey8:
    case PixelFormat::kNv12: break;
  }
  return row[x];
}

void LitWindow::Observe(const ImageView& image, TimePoint time) {
  // The first picture as a whole, so that nothing waits for the window.
  const int step = num_pictures_ == 0 ? 1 : kTurns;
  const bool is_over = time < since_ || time - since_ >= kMemory;
  if (num_pictures_ == 0 || (is_over && num_pictures_ - first_picture_ >= kTurns)) {
    older_ = recent_;
    recent_ = {};
    since_ = time;
    first_picture_ = num_pictures_;
  }
  const auto first_row = static_cast<int>(num_pictures_++ % static_cast<std::uint64_t>(step));
  Cells ever;
  for (int y = first_row; y < kSide; y += step) recent_[y] |= LitCells(image, y, ~recent_[y]);
  for (int y = 0; y < kSide; ++y) ever[y] = recent_[y] | older_[y];
  if (ever == ever_) return;
  ever_ = ever;
  const Cells window = LargestArea(Open(ever));
  int num = 0;
  for (const std::uint64_t row : window) {
    if (row != 0) num += kSide - std::countl_zero(row) - std::countr_zero(row);
  }
  if (num > 0) share_ = std::max(kMinShare, static_cast<double>(num) / (kSide * kSide));
}

std::uint64_t LitWindow::LitCells(const ImageView& image, int row_of_cells, std::uint64_t asked) {
  constexpr int kPerSide = kSide * kSamples;
  std::uint64_t lit = 0;
  for (std::uint64_t left = asked; left != 0; left &= left - 1) {
    const int x = std::countr_zero(left);
    int sum = 0;
    for (int k = 0; k < kSamples * kSamples; ++k) {
      const int column = kSamples * x + k % kSamples, row = kSamples * row_of_cells + k / kSamples;
      sum += LitValue(image, (2 * column + 1) * image.width / (2 * kPerSide),
                      (2 * row + 1) * image.height / (2 * kPerSide));
    }
    if (sum >= kLitThreshold * kSamples * kSamples) lit |= std::uint64_t{1} << x;
  }
  return lit;
}

LitWindow::Cells LitWindow::Open(const Cells& cells) {
  // The picture's edge cuts the window off: beyond it the last row and column go on.
  constexpr std::uint64_t kFirst = 1, kLast = std::uint64_t{1} << (kSide - 1);
  Cells eroded, opened;
  for (int y = 0; y < kSide; ++y) {
    const std::uint64_t row = cells[std::max(y - 1, 0)] & cells[y] & cells[std::min(y + 1, kSide - 1)];
    eroded[y] = row & (row << 1 | (row & kFirst)) & (row >> 1 | (row & kLast));
  }
  for (int y = 0; y < kSide; ++y) {
    const std::uint64_t row = eroded[std::max(y - 1, 0)] | eroded[y] | eroded[std::min(y + 1, kSide - 1)];
    opened[y] = row | row << 1 | row >> 1;
  }
  return opened;
}

LitWindow::Cells LitWindow::LargestArea(Cells cells) {
  Cells largest{};
  int most = 0;
  for (int y = 0; y < kSide; ++y) {
    while (cells[y] != 0) {
      // Grows from one cell, row by row and up and down, until it stays as it is.
      Cells area{};
      area[y] = cells[y] & (~cells[y] + 1);
      for (bool grows = true; grows;) {
        grows = false;
        for (int pass = 0; pass < 2 * kSide; ++pass) {
          const int at = pass < kSide ? pass : 2 * kSide - 1 - pass;
          std::uint64_t row = area[at] | area[std::max(at - 1, 0)] | area[std::min(at + 1, kSide - 1)];
          row &= cells[at];
          for (std::uint64_t before = 0; before != row;) {
            before = row;
            row |= (row << 1 | row >> 1) & cells[at];
          }
          grows = grows || row != area[at];
          area[at] = row;
        }
      }
      int num = 0;
      for (int at = 0; at < kSide; ++at) {
        num += std::popcount(area[at]);
        cells[at] &= ~area[at];
      }
      if (num > most) {
        most = num;
        largest = area;
      }
    }
  }
  return largest;
}

}  // namespace haustra
