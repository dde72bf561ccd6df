#include "capture/ground_truth.h"

#include <cmath>
#include <filesystem>
#include <utility>

#include "capture/calibration/formats.h"
#include "capture/calibration/yaml_map.h"
#include "capture/dataset/folder.h"
#include "capture/dataset/listing_parts.h"
#include "capture/dataset/rotation.h"
#include "capture/dataset/sequence_listing.h"
#include "capture/files/whole_file.h"
#include "capture/number.h"

namespace haustra {
namespace {

using namespace capture::internal;  // NOLINT(google-build-using-namespace): the parts of this library

// Published quaternions and matrices are rounded to a few decimals; what is further off is something else.
constexpr double kMaxUnitError = 0.01;

std::string AtLine(const std::string& path, const TextLine& line) {
  return path + ":" + std::to_string(line.number) + ": ";
}

// Fields first to first + out.size().
template <std::size_t N>
Status ParseFields(const std::vector<std::string_view>& fields, std::size_t first, std::array<double, N>* out) {
  for (std::size_t i = 0; i < N; ++i) {
    HAUSTRA_ASSIGN((*out)[i], ParseDouble(fields[first + i]));
  }
  return Status::Ok();
}

Status SetRotation(const Quaternion& world_from_cam, GroundTruthPose* pose) {
  if (std::abs(Norm(world_from_cam) - 1.0) > kMaxUnitError) {
    return InvalidArgument("the quaternion has length " + FormatDouble(Norm(world_from_cam)) + ", not 1");
  }
  pose->world_from_cam_xyzw = Normalized(world_from_cam);
  return Status::Ok();
}

Status ParseTumLine(const std::vector<std::string_view>& fields, GroundTruthPose* pose) {
  if (fields.size() != 8) {
    return InvalidArgument(std::to_string(fields.size()) + " fields, not 8 (time, position, quaternion x y z w)");
  }
  HAUSTRA_ASSIGN(pose->timestamp_ns, ParseSeconds(fields[0]));
  HAUSTRA_TRY(ParseFields(fields, 1, &pose->position_in_world));
  Quaternion q;
  HAUSTRA_TRY(ParseFields(fields, 4, &q));
  return SetRotation(q, pose);
}

// The pose of the body.
Status ParseEurocLine(const std::vector<std::string_view>& fields, GroundTruthPose* pose) {
  if (fields.size() < 8) {
    return InvalidArgument(std::to_string(fields.size()) +
                           " fields, not 8 or more (time, position, quaternion w x y z)");
  }
  HAUSTRA_ASSIGN(pose->timestamp_ns, ParseInteger(fields[0]));
  HAUSTRA_TRY(ParseFields(fields, 1, &pose->position_in_world));
  Quaternion wxyz;
  HAUSTRA_TRY(ParseFields(fields, 4, &wxyz));
  return SetRotation({wxyz[1], wxyz[2], wxyz[3], wxyz[0]}, pose);
}

Status ParseC3vdLine(const std::vector<std::string_view>& fields, GroundTruthPose* pose) {
  if (fields.size() != 16)
    return InvalidArgument(std::to_string(fields.size()) + " fields, not the 16 of a 4x4 matrix");
  std::array<double, 16> columns{};
  HAUSTRA_TRY(ParseFields(fields, 0, &columns));
  const bool has_last_row = columns[3] == 0.0 && columns[7] == 0.0 && columns[11] == 0.0 && columns[15] == 1.0;
  if (!has_last_row) {
    return InvalidArgument("values 4, 8, 12 and 16 are not 0, 0, 0 and 1: not a pose written column by column");
  }
  const Matrix3 rotation = {columns[0], columns[4], columns[8], columns[1], columns[5],
                            columns[9], columns[2], columns[6], columns[10]};
  if (RotationError(rotation) > kMaxUnitError) return InvalidArgument("the upper left 3x3 block is not a rotation");
  pose->position_in_world = {columns[12], columns[13], columns[14]};
  pose->world_from_cam_xyzw = FromMatrix(rotation);
  return Status::Ok();
}

// body_from_cam of the sequence that the EuRoC trajectory at `path` belongs to.
Result<GroundTruthPose> ReadBodyFromCam(const std::string& path) {
  const std::filesystem::path mav = std::filesystem::path(path).parent_path().parent_path();
  const std::string sensor = (mav / "cam0" / "sensor.yaml").string();
  Result<std::string> text = ReadWholeText(sensor, kMaxTextFileBytes);
  if (!text.ok()) {
    return Status(text.code(), path + ": holds poses of the body; that of the camera on it is not known: " +
                                   text.status().message());
  }
  HAUSTRA_ASSIGN(const YamlMap file, YamlMap::Parse(sensor, std::move(text).value()));
  using Matrix4 = std::array<double, 16>;
  HAUSTRA_ASSIGN(const Matrix4 m, ReadEurocBodyFromCam(file));
  const Matrix3 rotation = {m[0], m[1], m[2], m[4], m[5], m[6], m[8], m[9], m[10]};
  if (RotationError(rotation) > kMaxUnitError) return InvalidArgument(file.Where("T_BS") + " is not a rigid transform");
  GroundTruthPose body_from_cam;
  body_from_cam.position_in_world = {m[3], m[7], m[11]};
  body_from_cam.world_from_cam_xyzw = FromMatrix(rotation);
  return body_from_cam;
}

void ApplyBodyFromCam(const GroundTruthPose& body_from_cam, GroundTruthPose* pose) {
  const Quaternion world_from_body = pose->world_from_cam_xyzw;
  const Vector3 offset = Rotate(world_from_body, body_from_cam.position_in_world);
  for (std::size_t i = 0; i < 3; ++i) pose->position_in_world[i] += offset[i];
  pose->world_from_cam_xyzw = Multiply(world_from_body, body_from_cam.world_from_cam_xyzw);
}

enum class Layout { kTum, kEuroc, kC3vd };

Layout LayoutOf(const TextLine& line) {
  if (line.text.find(',') == std::string_view::npos) return Layout::kTum;
  // EuRoC's own files have 17 columns, so 16 are a matrix.
  return SplitFields(line.text, ',').size() == 16 ? Layout::kC3vd : Layout::kEuroc;
}

}  // namespace

Result<std::vector<GroundTruthPose>> ReadGroundTruth(const std::string& path) {
  HAUSTRA_ASSIGN(const std::string text, ReadWholeText(path, kMaxTextFileBytes));
  const std::vector<TextLine> lines = ContentLines(text);
  if (lines.empty()) return InvalidArgument(path + ": no pose in it");
  const Layout layout = LayoutOf(lines.front());

  std::vector<GroundTruthPose> poses;
  poses.reserve(lines.size());
  StampList stamps(path);
  for (const TextLine& line : lines) {
    GroundTruthPose pose;
    Status status;
    if (layout == Layout::kTum) {
      status = ParseTumLine(SplitFields(line.text, ' '), &pose);
    } else if (layout == Layout::kEuroc) {
      status = ParseEurocLine(SplitFields(line.text, ','), &pose);
    } else {
      status = ParseC3vdLine(SplitFields(line.text, ','), &pose);
      pose.timestamp_ns = StampsAtRate({static_cast<std::int64_t>(poses.size())}, kC3vdRateHz).front();
    }
    if (!status.ok()) return InvalidArgument(AtLine(path, line) + status.message());
    HAUSTRA_TRY(stamps.Add(line.number, pose.timestamp_ns));
    poses.push_back(pose);
  }
  if (layout == Layout::kEuroc) {
    HAUSTRA_ASSIGN(const GroundTruthPose body_from_cam, ReadBodyFromCam(path));
    for (GroundTruthPose& pose : poses) ApplyBodyFromCam(body_from_cam, &pose);
  }
  return poses;
}

}  // namespace haustra
