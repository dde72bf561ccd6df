// EndoMapper as published: Sequences/Seq_NNN/ with Seq_NNN.mov and Seq_NNN_info.json, whose `endoscope_number` leads to
// Calibrations/Endoscope_NN/Endoscope_NN_geometrical.xml (a Calibu rig). The calibration recordings lie beside their
// XML.
#pragma once

#include <memory>
#include <string>

#include "capture/sequence_options.h"
#include "hal/frame_source.h"

namespace haustra {

// Whether the folder holds a recorded video.
bool LooksLikeEndomapper(const std::string& folder);
// `folder` is that of one recording. kInvalidArgument: more than one recording, or pictures beside it but mask.png.
// Errors of OpenVideo.
Result<std::unique_ptr<FrameSource>> OpenEndomapper(const std::string& folder, const SequenceOptions& options);

}  // namespace haustra
