#include "tools/render/interlace.h"

#include <cstring>

namespace haustra::render {

void WeaveFields(const Image& second, Image* first) {
  const std::size_t bytes = std::size_t(first->width()) * BytesPerPixel(first->format());
  for (int y = 1; y < first->height(); y += 2) std::memcpy(first->row(y), second.row(y), bytes);
}

}  // namespace haustra::render
