// A folder that lives as long as the test, with short ways to fill it.
#pragma once

#include <filesystem>
#include <fstream>
#include <iterator>
#include <string>
#include <string_view>
#include <vector>

#include <gtest/gtest.h>
#include <stdlib.h>  // mkdtemp

#include "capture/codec/image_codec.h"
#include "capture/image.h"

namespace haustra {

class TempFolder {
 public:
  TempFolder() {
    std::string pattern = (std::filesystem::temp_directory_path() / "haustra_test_XXXXXX").string();
    const char* made = mkdtemp(pattern.data());
    if (made == nullptr) ADD_FAILURE() << "no temporary folder";
    path_ = pattern;
  }
  ~TempFolder() {
    std::error_code ignored;
    std::filesystem::remove_all(path_, ignored);
  }
  TempFolder(const TempFolder&) = delete;
  TempFolder& operator=(const TempFolder&) = delete;

  const std::string& path() const { return path_; }
  std::string Path(std::string_view name) const { return (std::filesystem::path(path_) / name).string(); }

  // Makes the folders on the way, too. Returns the path.
  std::string Write(std::string_view name, std::string_view content) const {
    const std::filesystem::path path = Path(name);
    std::filesystem::create_directories(path.parent_path());
    // A new file each time: some file systems flush to the disk when an old one is overwritten.
    std::filesystem::remove(path);
    std::ofstream(path, std::ios::binary).write(content.data(), static_cast<std::streamsize>(content.size()));
    return path.string();
  }
  // A PNG or JPEG (quality 95) by the name's ending.
  std::string WriteImage(std::string_view name, const Image& image) const {
    const std::filesystem::path path = Path(name);
    std::filesystem::create_directories(path.parent_path());
    const Status status =
        path.extension() == ".png" ? WritePng(path.string(), image.view()) : WriteJpeg(path.string(), image.view(), 95);
    EXPECT_TRUE(status.ok()) << status.ToString();
    return path.string();
  }
  std::string Read(std::string_view name) const {
    std::ifstream file(Path(name), std::ios::binary);
    return std::string(std::istreambuf_iterator<char>(file), {});
  }

 private:
  std::string path_;
};

// All channels of all pixels have the value.
inline Image FlatImage(int width_px, int height_px, PixelFormat format, std::uint8_t value) {
  Image image(width_px, height_px, format);
  for (int y = 0; y < height_px; ++y) std::fill_n(image.row(y), width_px * BytesPerPixel(format), value);
  return image;
}

// Smooth, different at every pixel and channel.
inline Image RampImage(int width_px, int height_px, PixelFormat format) {
  Image image(width_px, height_px, format);
  const int channels = BytesPerPixel(format);
  for (int y = 0; y < height_px; ++y) {
    for (int x = 0; x < width_px; ++x) {
      for (int c = 0; c < channels; ++c) image.row(y)[x * channels + c] = static_cast<std::uint8_t>(2 * x + y + 40 * c);
    }
  }
  return image;
}

inline std::vector<std::uint8_t> PixelsOf(ImageView image) {
  std::vector<std::uint8_t> pixels;
  for (int y = 0; y < image.height; ++y) {
    pixels.insert(pixels.end(), image.row(y), image.row(y) + image.width * BytesPerPixel(image.format));
  }
  return pixels;
}

// 64x48, of the size of the images that the tests write.
inline constexpr std::string_view kSmallCalibration =
    "%YAML:1.0\n"
    "Camera.type: \"KannalaBrandt8\"\n"
    "Camera.fx: 40.5\n"
    "Camera.fy: 40.25\n"
    "Camera.cx: 31.5\n"
    "Camera.cy: 24.5\n"
    "Camera.k1: -0.045\n"
    "Camera.k2: 0.008\n"
    "Camera.k3: -0.0031\n"
    "Camera.k4: 0.0005\n"
    "Camera.width: 64\n"
    "Camera.height: 48\n"
    "Camera.fps: 25\n"
    "Camera.RGB: 1\n";

inline std::string Replaced(std::string_view text, std::string_view from, std::string_view to) {
  std::string result(text);
  const std::size_t at = result.find(from);
  EXPECT_NE(at, std::string::npos) << "'" << from << "' is not in the text";
  if (at != std::string::npos) result.replace(at, from.size(), to);
  return result;
}

}  // namespace haustra
