// What a sequence of image files consists of, found out before any pixel is read. Every layout that is supported has
// one function that makes such a listing of a folder.
#pragma once

#include <cstdint>
#include <string>
#include <string_view>
#include <vector>

#include "capture/sequence_options.h"
#include "hal/camera_calibration.h"
#include "hal/core/status.h"

namespace haustra {

struct SequenceListing {
  std::string folder;                       // for messages
  std::vector<std::string> image_paths;     // in time order, at least one
  std::vector<std::int64_t> timestamps_ns;  // one an image, strictly increasing
  CameraCalibration calibration;            // of the images as they are stored
  std::string calibration_path;             // for messages
  std::string mask_path;                    // empty: no mask
};

// Each: kNotFound (folder or a file that must be there is missing), kInvalidArgument (a file's content is wrong; the
// message names file and line), kUnavailable (cannot be read). `options` gives paths that replace those of the
// sequence.

// `frames/` with PNG or JPEG files in natural order of their names (or the images in the folder itself), `calib.yaml`,
// optional `mask.png`, and `times.txt` with one capture time in seconds a line. Without times.txt, image k (from 0, as
// stored) has the time k / rate: that of the options, or else of the calibration; one of them must state it.
//
// Of a recording that was cut (IsCutRecording) it lists the frames whose times are there.
Result<SequenceListing> ListSequenceFolder(const std::string& folder, const SequenceOptions& options);
bool LooksLikeSequenceFolder(const std::string& folder);

// Stands for times.txt while `haustra capture` records: the name of a file in frames/ and its capture time in seconds a
// line, in any order. A line is there when its frame is whole.
inline constexpr std::string_view kRecordedTimesName = "times.recording";
// Whether a folder of our layout is what a recording left that did not come to its end.
bool IsCutRecording(const std::string& folder);

// C3VD as published: `N_color.png` (N not zero-padded) in one folder; depth, normal and flow images beside them are
// left alone. Frame N has the time N / 29.97 Hz, which is also what ReadGroundTruth gives to line N of pose.txt. The
// data set publishes one camera a version and none with the sequence, so the options name a calibration, or a
// calib.yaml was put into the folder.
inline constexpr double kC3vdRateHz = 29.97;
Result<SequenceListing> ListC3vd(const std::string& folder, const SequenceOptions& options);
bool LooksLikeC3vd(const std::string& folder);

// EuRoC (ASL): `folder` holds mav0/, or is mav0 itself; cam0/data.csv (time in ns, file name), cam0/data/,
// cam0/sensor.yaml.
Result<SequenceListing> ListEuroc(const std::string& folder, const SequenceOptions& options);
bool LooksLikeEuroc(const std::string& folder);

// TUM: rgb.txt (time in seconds, file name relative to the folder). The data set publishes its cameras in a paper, so
// the options name a calibration, or a calib.yaml was put into the folder.
Result<SequenceListing> ListTum(const std::string& folder, const SequenceOptions& options);
bool LooksLikeTum(const std::string& folder);

}  // namespace haustra
