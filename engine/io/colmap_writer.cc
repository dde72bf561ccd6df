#include "engine/io/colmap_writer.h"

#include "engine/camera/camera_model.h"
#include "engine/io/fisheye_fit.h"
#include "engine/io/text_writer.h"

namespace haustra {
namespace {

constexpr double kPixelOrigin = 0.5;  // COLMAP's coordinate of the centre of the first pixel
constexpr int kCameraId = 1;
constexpr std::int64_t kFirstId = 1;

void AddSquareParameters(const CameraCalibration& c, int num_coefficients, std::vector<double>* parameters) {
  *parameters = {c.fx, c.fy, c.cx + kPixelOrigin, c.cy + kPixelOrigin};
  parameters->insert(parameters->end(), c.coefficients.begin(), c.coefficients.begin() + num_coefficients);
}

}  // namespace

Result<ColmapCamera> MakeColmapCamera(const CameraCalibration& calibration) {
  ColmapCamera camera;
  camera.width_px = calibration.width_px;
  camera.height_px = calibration.height_px;
  switch (calibration.kind) {
    case CameraModelKind::kPinhole: {
      // Ours: k1 k2 p1 p2 k3; FULL_OPENCV: k1 k2 p1 p2 k3 k4 k5 k6.
      const bool has_k3 = calibration.coefficients[4] != 0.0;
      camera.model = has_k3 ? "FULL_OPENCV" : "OPENCV";
      AddSquareParameters(calibration, has_k3 ? 5 : 4, &camera.parameters);
      if (has_k3) camera.parameters.insert(camera.parameters.end(), 3, 0.0);
      break;
    }
    case CameraModelKind::kKannalaBrandt:
      camera.model = "OPENCV_FISHEYE";
      AddSquareParameters(calibration, 4, &camera.parameters);
      break;
    case CameraModelKind::kOcamCalib: {
      HAUSTRA_ASSIGN(const CameraModel model, CameraModel::Create(calibration));
      HAUSTRA_ASSIGN(const FisheyeFit fit, FitFisheye(model));
      camera.model = "OPENCV_FISHEYE";
      AddSquareParameters(fit.calibration, 4, &camera.parameters);
      camera.is_fitted = true;
      camera.fit_rms_px = fit.rms_px;
      camera.fit_max_px = fit.max_px;
      break;
    }
  }
  return camera;
}

Status WriteColmapCameras(ByteSink& sink, const ColmapCamera& camera) {
  TextWriter writer(sink);
  writer.Text("# Camera list with one line of data per camera:\n#   CAMERA_ID, MODEL, WIDTH, HEIGHT, PARAMS[]\n");
  if (camera.is_fitted) {
    writer.Text(
        "# The camera is calibrated by OCamCalib, which COLMAP does not know: this fisheye was fitted to it,\n");
    writer.Text("# residual over the image: rms ").Number(camera.fit_rms_px).Text(" px, max ");
    writer.Number(camera.fit_max_px).Text(" px\n");
  }
  writer.Text("# Number of cameras: 1\n");
  writer.Integer(kCameraId).Text(" ").Text(camera.model).Text(" ");
  writer.Integer(camera.width_px).Text(" ").Integer(camera.height_px);
  for (const double parameter : camera.parameters) writer.Text(" ").Number(parameter);
  writer.Text("\n");
  return writer.Finish();
}

Status WriteColmapImages(ByteSink& sink, const MapExport& map) {
  HAUSTRA_TRY(Validate(map));
  TextWriter writer(sink);
  writer.Text(
      "# Image list with two lines of data per image:\n"
      "#   IMAGE_ID, QW, QX, QY, QZ, TX, TY, TZ, CAMERA_ID, NAME (camera from world, map units)\n"
      "#   POINTS2D[] as (X, Y, POINT3D_ID)\n# Number of images: ");
  writer.Integer(static_cast<std::int64_t>(map.keyframes.size())).Text("\n");
  for (const KeyframeExport& keyframe : map.keyframes) {
    const Eigen::Quaterniond& q = keyframe.cam_from_map.rotation;
    const Eigen::Vector3d& t = keyframe.cam_from_map.translation;
    const double sign = q.w() < 0.0 ? -1.0 : 1.0;
    writer.Integer(keyframe.id + kFirstId);
    for (const double value : {sign * q.w(), sign * q.x(), sign * q.y(), sign * q.z(), t.x(), t.y(), t.z()}) {
      writer.Text(" ").Number(value);
    }
    writer.Text(" ").Integer(kCameraId).Text(" ").Text(keyframe.image_name).Text("\n");
    for (std::size_t i = 0; i < keyframe.keypoints.size(); ++i) {
      const Eigen::Vector2f& keypoint = keyframe.keypoints[i];
      const int point_id = keyframe.point_ids[i];
      if (i > 0) writer.Text(" ");
      writer.Number(keypoint.x() + static_cast<float>(kPixelOrigin)).Text(" ");
      writer.Number(keypoint.y() + static_cast<float>(kPixelOrigin)).Text(" ");
      writer.Integer(point_id < 0 ? -1 : point_id + kFirstId);
    }
    writer.Text("\n");
  }
  return writer.Finish();
}

Status WriteColmapPoints3D(ByteSink& sink, const MapExport& map) {
  HAUSTRA_TRY(Validate(map));
  TextWriter writer(sink);
  writer.Text(
      "# 3D point list with one line of data per point:\n"
      "#   POINT3D_ID, X, Y, Z, R, G, B, ERROR, TRACK[] as (IMAGE_ID, POINT2D_IDX)\n# Number of points: ");
  writer.Integer(static_cast<std::int64_t>(map.points.size())).Text("\n");
  for (const PointExport& point : map.points) {
    writer.Integer(point.id + kFirstId);
    for (int axis = 0; axis < 3; ++axis) writer.Text(" ").Number(point.position[axis]);
    for (const std::uint8_t channel : point.rgb) writer.Text(" ").Integer(channel);
    writer.Text(" ").Number(point.reprojection_error_px);
    for (const auto& [keyframe_id, keypoint_idx] : point.track) {
      writer.Text(" ").Integer(keyframe_id + kFirstId).Text(" ").Integer(keypoint_idx);
    }
    writer.Text("\n");
  }
  return writer.Finish();
}

}  // namespace haustra
