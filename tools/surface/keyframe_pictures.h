// The pictures of a run's keyframes, from the sequence that the run was made from. thread-bound(caller).
#pragma once

#include <cstdint>
#include <map>
#include <set>
#include <string>

#include "capture/deinterlace.h"
#include "capture/image.h"
#include "hal/camera_calibration.h"
#include "hal/core/status.h"
#include "tools/evaluate/run_output.h"

namespace haustra::surface {

struct KeyframePicture {
  std::int64_t frame_idx = 0;     // of the run
  std::int64_t stored_frame = 0;  // of the sequence
  Image colour;                   // kBgr8 or kGrey8
  Image grey;
};

struct KeyframePictures {
  std::map<std::string, KeyframePicture> by_name;
  Image mask;  // 255 where the scene is shown; empty: everywhere
};

// The mask that the run has kept: of a run that kept depth, or was given a mask. Empty: none. kInvalidArgument: not of
// the size of `camera`, that of the run; errors of ReadImage.
Result<Image> ReadMaskOfRun(const evaluate::RunOutput& run, const CameraCalibration& camera);

// names: of the wanted frames, '_' for a blank. camera: of the run, for its size; a sequence whose frames have twice
// its size is halved, as the run did. The mask is that of the run, else the sequence's. Frames that the sequence does
// not have are left out. Errors of OpenSequence; kInvalidArgument when frames have another size, or another time than
// the run gives them.
Result<KeyframePictures> ReadKeyframePictures(const evaluate::RunOutput& run, const std::set<std::string>& names,
                                              const CameraCalibration& camera, const std::string& sequence,
                                              DeinterlaceChoice deinterlace);

}  // namespace haustra::surface
