// One map as a COLMAP text model: cameras.txt, images.txt, points3D.txt, which COLMAP and its users' tools open as they
// are. Conventions of that format, all applied here and nowhere else:
//   - poses are world to camera (cam_from_map), quaternion with qw first; two lines an image;
//   - pixel coordinates count from the corner of the image, so the centre of the top left pixel is (0.5, 0.5): half a
//     pixel is added to the principal point and to every keypoint;
//   - ids start at 1: image id = keyframe id + 1, point id = ours + 1, one camera with id 1.
// Lengths are map units. reentrant, not rt-safe.
#pragma once

#include <string>
#include <vector>

#include "engine/io/map_export.h"
#include "hal/camera_calibration.h"
#include "hal/core/byte_sink.h"

namespace haustra {

// Kannala-Brandt becomes OPENCV_FISHEYE, radial-tangential OPENCV (FULL_OPENCV when k3 is not zero). OCamCalib has no
// COLMAP model: the fisheye that fits best takes its place, and the residual says how well.
struct ColmapCamera {
  std::string model;
  int width_px = 0;
  int height_px = 0;
  std::vector<double> parameters;  // in COLMAP's order and pixel convention
  bool is_fitted = false;
  double fit_rms_px = 0.0;
  double fit_max_px = 0.0;
};

// kInvalidArgument, kInternal: an OCamCalib calibration that is no camera, or has no fisheye like it.
Result<ColmapCamera> MakeColmapCamera(const CameraCalibration& calibration);

// Errors: what the sink returns; kInvalidArgument when the map is not consistent (Validate in map_export.h), with the
// sink untouched.
Status WriteColmapCameras(ByteSink& sink, const ColmapCamera& camera);
Status WriteColmapImages(ByteSink& sink, const MapExport& map);
Status WriteColmapPoints3D(ByteSink& sink, const MapExport& map);

}  // namespace haustra
