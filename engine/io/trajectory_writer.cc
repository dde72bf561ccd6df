#include "engine/io/trajectory_writer.h"

#include "engine/io/text_writer.h"

namespace haustra {

void AppendTumHeader(std::string_view comment, std::string* text) {
  while (!comment.empty()) {
    const std::size_t end = comment.find('\n');
    text->append("# ");
    text->append(comment.substr(0, end));
    text->push_back('\n');
    comment = end == std::string_view::npos ? std::string_view{} : comment.substr(end + 1);
  }
  text->append("# timestamp tx ty tz qx qy qz qw (world_from_cam; seconds, map units)\n");
}

void AppendTumLine(const StampedPose& pose, std::string* text) {
  const SE3 world_from_cam = pose.cam_from_world.Inverse();
  // Both signs are the same rotation; one of them is chosen so that equal poses give equal lines.
  const double sign = world_from_cam.rotation.w() < 0.0 ? -1.0 : 1.0;
  AppendSeconds(pose.timestamp_ns, text);
  for (const double value :
       {world_from_cam.translation.x(), world_from_cam.translation.y(), world_from_cam.translation.z(),
        sign * world_from_cam.rotation.x(), sign * world_from_cam.rotation.y(), sign * world_from_cam.rotation.z(),
        sign * world_from_cam.rotation.w()}) {
    text->push_back(' ');
    AppendNumber(value, text);
  }
  text->push_back('\n');
}

Status WriteTum(ByteSink& sink, std::span<const StampedPose> poses, std::string_view comment) {
  for (std::size_t i = 0; i < poses.size(); ++i) {
    const SE3& pose = poses[i].cam_from_world;
    if (!pose.translation.allFinite() || !pose.rotation.coeffs().allFinite()) {
      return InvalidArgument("trajectory: pose " + std::to_string(i) + " is not finite");
    }
  }
  TextWriter writer(sink);
  std::string line;
  AppendTumHeader(comment, &line);
  writer.Text(line);
  for (const StampedPose& pose : poses) {
    line.clear();
    AppendTumLine(pose, &line);
    writer.Text(line);
  }
  return writer.Finish();
}

}  // namespace haustra
