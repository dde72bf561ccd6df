#include "tools/export/trajectory_formats.h"

#include "engine/io/text_writer.h"
#include "engine/io/trajectory_writer.h"

namespace haustra::exporting {

std::string TumText(const ExportedMap& map) {
  std::string text;
  AppendTumHeader("map " + std::to_string(map.map_id), &text);
  for (const ExportedFrame& frame : map.frames) {
    AppendTumLine({frame.timestamp_ns, frame.world_from_cam.Inverse()}, &text);
  }
  return text;
}

std::string KittiText(const ExportedMap& map) {
  std::string text;
  for (const ExportedFrame& frame : map.frames) {
    const Eigen::Matrix3d rotation = frame.world_from_cam.matrix3();
    for (int row = 0; row < 3; ++row) {
      for (int column = 0; column < 4; ++column) {
        AppendNumber(column < 3 ? rotation(row, column) : frame.world_from_cam.translation[row], &text);
        text += row == 2 && column == 3 ? '\n' : ' ';
      }
    }
  }
  return text;
}

std::string KittiTimesText(const ExportedMap& map) {
  std::string text;
  for (const ExportedFrame& frame : map.frames) {
    AppendSeconds(frame.timestamp_ns, &text);
    text += '\n';
  }
  return text;
}

std::string CsvText(const ExportedMap& map) {
  std::string text = "frame_idx,timestamp_s,x_mu,y_mu,z_mu,qx,qy,qz,qw\n";
  for (const ExportedFrame& frame : map.frames) {
    const SE3& pose = frame.world_from_cam;
    const double sign = pose.rotation.w() < 0.0 ? -1.0 : 1.0;
    AppendInteger(frame.frame_idx, &text);
    text += ',';
    AppendSeconds(frame.timestamp_ns, &text);
    for (const double value :
         {pose.translation.x(), pose.translation.y(), pose.translation.z(), sign * pose.rotation.x(),
          sign * pose.rotation.y(), sign * pose.rotation.z(), sign * pose.rotation.w()}) {
      text += ',';
      AppendNumber(value, &text);
    }
    text += '\n';
  }
  return text;
}

}  // namespace haustra::exporting
