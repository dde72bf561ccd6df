// One entrance to every recorded sequence and every camera.
#pragma once

#include <memory>
#include <string>

#include "capture/sequence_options.h"
#include "hal/core/status.h"
#include "hal/frame_source.h"

namespace haustra {

// Tells from what is in the folder which layout it has, in this order: EuRoC (mav0/cam0/data.csv), TUM (rgb.txt), C3VD
// (N_color.png), our own (frames/), EndoMapper (a recording), images in the folder itself; a file is opened as a video,
// whatever its name, and "v4l2:..." is a live camera (v4l2/v4l2_options.h), which needs a calibration and answers
// num_frames() 0. When nothing fits, the message says what was looked for. kNotFound: no such path, or something that
// must be there is missing. kInvalidArgument: content or options are wrong, the layout is unknown. kDataLoss,
// kUnavailable: see the readers (dataset/sequence_listing.h, image_folder_source.h, video_source.h).
Result<std::unique_ptr<FrameSource>> OpenSequence(const std::string& path, const SequenceOptions& options);

}  // namespace haustra
