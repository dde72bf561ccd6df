#include "tools/atlas/atlas_text.h"

#include <algorithm>
#include <cstdarg>
#include <cstdio>
#include <set>
#include <vector>

#include "engine/io/atlas_format.h"

namespace haustra {
namespace {

void Append(std::string* text, const char* format, ...) __attribute__((format(printf, 2, 3)));
void Append(std::string* text, const char* format, ...) {
  char line[256];
  va_list arguments;
  va_start(arguments, format);
  std::vsnprintf(line, sizeof(line), format, arguments);
  va_end(arguments);
  *text += line;
}

const char* NameOf(CameraModelKind kind) {
  switch (kind) {
    case CameraModelKind::kPinhole: return "pinhole";
    case CameraModelKind::kKannalaBrandt: return "Kannala-Brandt";
    case CameraModelKind::kOcamCalib: return "OCamCalib";
  }
  return "unknown";
}

struct MapRow {
  std::size_t num_keyframes = 0;
  std::size_t num_points = 0;
  std::set<std::uint32_t> sessions;
};

}  // namespace

std::string AtlasText(const SavedAtlas& atlas, std::size_t file_bytes) {
  std::vector<MapRow> rows(atlas.maps.size());
  for (const SavedKeyframe& keyframe : atlas.keyframes) {
    ++rows[keyframe.map_idx].num_keyframes;
    rows[keyframe.map_idx].sessions.insert(keyframe.session);
  }
  for (const SavedPoint& point : atlas.points) ++rows[point.map_idx].num_points;

  std::string text;
  const CameraCalibration& c = atlas.camera;
  Append(&text, "  format        version %u, %.1f MB, checksums and contents are right\n", kAtlasFileKind.version,
         static_cast<double>(file_bytes) * 1e-6);
  Append(&text, "  camera        %s %dx%d, fx %.3f fy %.3f cx %.3f cy %.3f\n", NameOf(c.kind), c.width_px, c.height_px,
         c.fx, c.fy, c.cx, c.cy);
  Append(&text, "  descriptors   %s\n", atlas.root_sift ? "RootSIFT" : "SIFT");
  Append(&text, "  sessions      %5u\n", atlas.counters.session);
  Append(&text, "  keyframes     %5zu     (%u were made, up to %d features each)\n", atlas.keyframes.size(),
         atlas.counters.next_keyframe_id, atlas.max_features());
  Append(&text, "  map points    %5zu\n", atlas.points.size());
  Append(&text, "  maps          %5zu\n", atlas.maps.size());
  for (std::size_t i = 0; i < rows.size(); ++i) {
    std::string sessions;
    for (const std::uint32_t session : rows[i].sessions) sessions += " " + std::to_string(session);
    Append(&text, "    map %-4u    %5zu keyframes, %6zu points, of session%s%s\n", atlas.maps[i].id,
           rows[i].num_keyframes, rows[i].num_points, rows[i].sessions.size() == 1 ? "" : "s", sessions.c_str());
  }
  return text;
}

}  // namespace haustra
