#include "tools/run/two_views.h"

#include <memory>

#include "capture/open_sequence.h"
#include "capture/side_by_side.h"

namespace haustra {
namespace {

// So many pictures with texture are looked at, not neighbours, as they show the same.
constexpr int kNumPictures = 5;
constexpr std::uint32_t kEveryNth = 4;
// Recordings begin black, or with a cap on the scope. Four seconds are read in a fraction of one.
constexpr std::uint32_t kMaxFrames = 100;

}  // namespace

std::string TwoViewsRemark(const std::string& sequence, const SequenceOptions& options) {
  const Result<std::unique_ptr<FrameSource>> source = OpenSequence(sequence, options);
  if (!source.ok()) return "";
  HalvesMatch beside, above;
  int num_pictures = 0;
  for (std::uint32_t i = 0; i < kMaxFrames && num_pictures < kNumPictures; ++i) {
    const Result<Frame> frame = (*source)->Next(kNoDeadline);
    if (frame.code() == StatusCode::kDataLoss) continue;
    if (!frame.ok()) break;
    if (i % kEveryNth != 0) continue;
    const HalvesMatch in_picture = MatchHalves(frame->image, Halves::kLeftAndRight);
    beside += in_picture;
    above += MatchHalves(frame->image, Halves::kTopAndBottom);
    num_pictures += in_picture.num_blocks > 0;
  }
  const bool are_beside = AreTwoViews(beside);
  if (!are_beside && !AreTwoViews(above)) return "";
  const std::string halves = are_beside ? "left and right half" : "upper and lower half";
  const std::string crop = are_beside ? "crop=iw/2:ih:0:0" : "crop=iw:ih/2:0:0";
  return sequence + ": " + halves + " of the pictures show the same scene. They are taken for one view, and maps and " +
         "calibration come out wrong. Cut one half out first: ffmpeg -i VIDEO -vf " + crop + " HALF.mkv";
}

}  // namespace haustra
