// Frames from recorded video (mp4, mov, avi, mkv, webm, MPEG program and transport streams, wmv) through FFmpeg's
// libraries. They are an optional component of the build; without them everything here answers kUnavailable.
#pragma once

#include <memory>
#include <string>

#include "capture/sequence_options.h"
#include "hal/frame_source.h"

namespace haustra {

// Whether this build can read video.
bool HasVideoSupport();

// Opens the first video stream; which container it is the content says, not the name. The calibration is that of the
// options, or else <name>_geometrical.xml, the only
// *_geometrical.xml in the video's folder, <name>.yaml or calib.yaml there; the mask that of the options or mask.png
// there. Frame times are those of the recording, from 0 at its first frame.
//
// The source decodes on demand, on the reader's thread. A picture that does not decode, that the decoder marks as
// corrupt, or whose time is not after that of the one before is a lost frame: kDataLoss, and Next goes on after it.
// Where times jump back by a second, or ahead by ten, other recordings were joined to the first: they go on at the
// stream's rate (StampRemark). num_frames is what the container states, or else its duration times its mean rate, which
// may be off; 0 when it says neither. kNotFound: no such file, no calibration. kDataLoss: not a video, or damaged from
// the start. kInvalidArgument: no video stream, a codec that is not built in, the size is not that of the calibration.
// kUnavailable: built without video support.
Result<std::unique_ptr<FrameSource>> OpenVideo(const std::string& path, const SequenceOptions& options);

// What is to be said about the times of a source of OpenVideo once it has been read: where they jumped and were made to
// go on. Empty: nothing, or another source. thread-bound(the reader).
std::string StampRemark(const FrameSource& source);

}  // namespace haustra
