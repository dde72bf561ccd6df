// A picture before memory that may not be read.
#pragma once

#include <gtest/gtest.h>
#include <sys/mman.h>
#include <unistd.h>

#include <algorithm>
#include <cstddef>
#include <cstdint>

#include "tests/engine/surface/textured_scene.h"

namespace haustra {

// A copy of a picture; what reads beyond its last byte ends the program.
class GuardedPicture {
 public:
  explicit GuardedPicture(const Picture& picture) : width_(picture.width), height_(picture.height) {
    const auto page = static_cast<std::size_t>(sysconf(_SC_PAGESIZE));
    const std::size_t num_readable = (picture.pixels.size() + page - 1) / page * page;
    num_bytes_ = num_readable + page;
    pages_ = static_cast<std::uint8_t*>(
        mmap(nullptr, num_bytes_, PROT_READ | PROT_WRITE, MAP_PRIVATE | MAP_ANONYMOUS, -1, 0));
    EXPECT_EQ(mprotect(pages_ + num_readable, page, PROT_NONE), 0);
    pixels_ = pages_ + num_readable - picture.pixels.size();
    std::copy(picture.pixels.begin(), picture.pixels.end(), pixels_);
  }
  ~GuardedPicture() { munmap(pages_, num_bytes_); }
  GuardedPicture(const GuardedPicture&) = delete;
  GuardedPicture& operator=(const GuardedPicture&) = delete;

  ImageView view() const { return {pixels_, width_, height_, width_, PixelFormat::kGrey8}; }

 private:
  int width_, height_;
  std::size_t num_bytes_ = 0;
  std::uint8_t* pages_ = nullptr;
  std::uint8_t* pixels_ = nullptr;
};

}  // namespace haustra
