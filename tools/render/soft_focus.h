// Pictures out of focus: a blurred copy and how to look it up. Pixel coordinates with centres at integers. reentrant.
#pragma once

#include "tools/render/linear_image.h"

namespace haustra::render {

inline float Mix(float a, float b, float t) { return a + t * (b - a); }

// Usual brightness: the mean of the square roots, squared, which highlights hardly move.
float TypicalLevel(const LinearImage& image);
// Averages of blocks of pixels.
LinearImage Blurred(const LinearImage& image);
// Bilinear, clamped to the image. SampleBlurred takes the coordinates of the image that was blurred.
void SampleBilinear(const LinearImage& image, float x, float y, float rgb[3]);
void SampleBlurred(const LinearImage& blurred, float x, float y, float rgb[3]);

}  // namespace haustra::render
