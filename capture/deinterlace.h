// Interlaced video whose fields were woven into pictures: even rows show one moment, odd rows another one, half a
// period away. Edges that move are combed. A picture is shown by its top field alone: the even rows, and between them
// their mean. reentrant, except for Deinterlacer.
#pragma once

#include <string_view>

#include "capture/image.h"
#include "hal/core/status.h"
#include "hal/core/views.h"

namespace haustra {

enum class DeinterlaceChoice {
  kAuto,  // pictures that are combed; once three were, or one clearly, all that follow
  kOff,
  kOn,  // all
};
// "auto", "off" or "on". kInvalidArgument quotes anything else.
Result<DeinterlaceChoice> ParseDeinterlaceChoice(std::string_view text);

// Mean difference between neighbouring rows over that between every other row. White noise has 1; progressive pictures
// lie below, because what is nearer is more alike. Combed pictures lie above. 0: flat, or fewer than three rows.
//
// Three rows of every nine are looked at, all channels of them alike; of kNv12 the luma.
double Combing(ImageView image);

// Whether Combing is above kCombedFrom and the difference is more than a sensor's noise: kMinCombedLevels of 255.
// A picture whose columns are combed, too, was dithered to few colours: then the rows must be kRowsBeforeColumns times
// as far above noise as they.
bool IsCombed(ImageView image);

// Where noise cannot come by chance: of a dark picture it is all there is.
inline constexpr double kCombedFrom = 1.1;
inline constexpr double kMinCombedLevels = 2.0;
// Dithers alternate across as much as down; of those seen, rows were up to 1.4 times as far above noise as columns.
// Fields alternate down only: of woven pictures columns are below noise.
inline constexpr double kRowsBeforeColumns = 2.0;

// Each odd row becomes the mean of the rows above and below, rounded up at a half; the last one, without a row below,
// that above. Of all channels; the rows of colour of kNv12 likewise, among themselves.
void KeepTopField(Image* image);
// The same from a picture that belongs to somebody else, which must not share memory with the result.
void KeepTopField(ImageView image, Image* kept);

// Decides for the pictures of one source, in the order in which they are shown. thread-bound(the reader), rt-safe.
class Deinterlacer {
 public:
  // A source with so many combed pictures, not necessarily in a row, is interlaced, and one that is clearly combed is
  // enough. A picture without motion between its fields is not combed, but the map is best made of one kind of picture
  // from its beginning.
  static constexpr int kMinCombed = 3;
  static constexpr double kClearlyCombedFrom = 1.5;

  explicit Deinterlacer(DeinterlaceChoice choice) : choice_(choice) {}

  // Whether this picture is to be shown by its top field. Looks at it in mode kAuto, until the source is known as
  // interlaced.
  bool WantsTopField(ImageView image);
  // Another source, or another signal: nothing is known of it.
  void Restart() { num_combed_ = 0; }

 private:
  const DeinterlaceChoice choice_;
  int num_combed_ = 0;  // up to kMinCombed
};

}  // namespace haustra
