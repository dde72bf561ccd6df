#include "tools/render/sequence_writer.h"

#include <cstdarg>
#include <cstdio>
#include <filesystem>
#include <system_error>

#include "tools/command/output_folder.h"

namespace haustra::render {
namespace {

// A line in printf's notation; locale-independent for our formats because the program never sets a locale.
[[gnu::format(printf, 1, 2)]] std::string Line(const char* format, ...) {
  char buffer[256];
  va_list arguments;
  va_start(arguments, format);
  std::vsnprintf(buffer, sizeof(buffer), format, arguments);
  va_end(arguments);
  return buffer;
}

Status MakeFolder(const std::string& path) {
  std::error_code error;
  std::filesystem::create_directories(path, error);
  if (error) return Unavailable(path + ": cannot be made: " + error.message());
  return Status::Ok();
}

}  // namespace

Status MakeFramesFolder(const std::string& folder) { return MakeFolder(folder + "/frames"); }

Status MakeDepthFolder(const std::string& folder) { return MakeFolder(folder + "/depth"); }

Status MakeNormalsFolder(const std::string& folder) { return MakeFolder(folder + "/normals"); }

std::string DepthPath(const std::string& folder, int frame) { return folder + Line("/depth/%06d.pgm", frame); }

std::string NormalsPath(const std::string& folder, int frame) { return folder + Line("/normals/%06d.png", frame); }

std::string FramePath(const std::string& folder, int frame) { return folder + Line("/frames/%06d.jpg", frame); }

Status WriteTimes(const std::string& folder, const std::vector<double>& times_s) {
  std::string text;
  for (const double t : times_s) text += Line("%.6f\n", t);
  return WriteFile(folder + "/times.txt", text);
}

Status WriteGroundTruth(const std::string& folder, const std::vector<double>& times_s,
                        const std::vector<SE3>& world_from_cam) {
  std::string text =
      "# timestamp tx ty tz qx qy qz qw   (camera-to-world, millimetres; camera x right, y down, z forward)\n";
  for (std::size_t i = 0; i < times_s.size(); ++i) {
    const Eigen::Vector3d& t = world_from_cam[i].translation;
    Eigen::Quaterniond q = world_from_cam[i].rotation;
    if (q.w() < 0.0) q.coeffs() *= -1.0;
    text +=
        Line("%.6f %.6f %.6f %.6f %.9f %.9f %.9f %.9f\n", times_s[i], t.x(), t.y(), t.z(), q.x(), q.y(), q.z(), q.w());
  }
  return WriteFile(folder + "/groundtruth.txt", text);
}

Status WriteEvents(const std::string& folder, const std::vector<FrameSpan>& spans) {
  std::string text = "first_frame,last_frame,kind,visible\n";
  for (const FrameSpan& span : spans) {
    text += Line("%d,%d,%s,%d\n", span.first_frame, span.last_frame, std::string(ToString(span.kind)).c_str(),
                 HidesScene(span.kind) ? 0 : 1);
  }
  return WriteFile(folder + "/events.csv", text);
}

Status WriteRevisits(const std::string& folder, const std::vector<Revisit>& revisits) {
  std::string text = "frame_a,frame_b,dt_s,distance_mm,axis_angle_deg\n";
  for (const Revisit& r : revisits) {
    text += Line("%d,%d,%.2f,%.2f,%.1f\n", r.frame_a, r.frame_b, r.dt_s, r.distance_mm, r.axis_angle_deg);
  }
  return WriteFile(folder + "/revisits.csv", text);
}

}  // namespace haustra::render
