// Camera calibration files in and out. Which format a file has is told from its keys, never from its name; what a file
// does not say (above all which distortion model its coefficients belong to) is an error, never a guess: fisheye
// coefficients read as radial-tangential ones, or the other way round, are the classic cause of a system that makes no
// map.
//
// Read:
//   settings   `Camera.type: KannalaBrandt8` or `PinHole`, Camera.fx fy cx cy, Camera.k1 k2 k3 k4 (PinHole: k1 k2 p1 p2
//   [k3],
//              or none of them), Camera.width, Camera.height, [Camera.fps], [Camera.RGB],
//              [Camera.focal_guess_sigma]
//   haustra    our own, the only one that holds all three models:
//                  model: pinhole | kannala_brandt | ocamcalib
//                  width_px: 1350
//                  height_px: 1080
//                  rate_hz: 29.97            # optional
//                  max_half_angle_deg: 85    # optional: do not use the model beyond
//                  focal_guess_sigma: 0.15   # optional: fx is a guess, with this relative standard deviation
//                  intrinsics: {fx: , fy: , cx: , cy: }        # ocamcalib: {cx: , cy: }
//                  coefficients: {k1: , k2: , k3: , k4: }      # pinhole: k1 k2 p1 p2 [k3]; ocamcalib: a0 a2 a3 a4 c d
//                  e
//   OpenCV     FileStorage YAML with camera_matrix, distortion_coefficients, image_width, image_height, and a key
//   `model`
//              (or `distortion_model`) or `fisheye` (or `fisheye_model`) that says which model it is
//   Kalibr     camchain with one camera, pinhole with radtan, equidistant or no distortion
//   EuRoC      sensor.yaml, pinhole with radial-tangential or equidistant distortion
//   Calibu     the rig XML of Vicalib and EndoMapper with one camera: calibu_fu_fv_u0_v0, the same with _k1_k2,
//   _k1_k2_k3
//              or _kb4, and ocamcalib_cx_cy_a0_a2_a3_a4_e_f_g
// Pixel centres at integers in all of them. reentrant.
#pragma once

#include <string>
#include <string_view>

#include "hal/camera_calibration.h"
#include "hal/core/status.h"

namespace haustra {

// kNotFound, kUnavailable: the file cannot be read. kInvalidArgument: anything wrong in it (unknown or missing key, not
// a number, not finite, out of range, unsupported model); the message names file, line, key and value.
Result<CameraCalibration> ReadCalibration(const std::string& path);

// The settings format for pinhole and Kannala-Brandt, our own for OCamCalib and for a calibration with
// max_half_angle_deg. Numbers are such that reading gives the same doubles. remark: one line of comment at its head.
// Of a calibration that ReadCalibration would accept.
std::string CalibrationText(const CameraCalibration& calibration, std::string_view remark = {});

// Writes CalibrationText, as a whole or not at all. kInvalidArgument: the calibration is not one that ReadCalibration
// would accept. kNotFound: no such folder. kUnavailable: the file cannot be written.
Status WriteCalibration(const std::string& path, const CameraCalibration& calibration, std::string_view remark = {});

}  // namespace haustra
