#include "engine/coverage/coverage_options.h"

#include <string>

namespace haustra {
namespace {

Status Bad(const char* field, double value, const char* range) {
  return InvalidArgument(std::string(field) + " is " + std::to_string(value) + ", must be in " + range);
}

}  // namespace

Status CoverageOptions::Validate() const {
  if (!(max_range_radii > 0.0 && max_range_radii <= 6.0)) return Bad("max_range_radii", max_range_radii, "(0, 6]");
  if (!(max_slant_deg > 0.0 && max_slant_deg < 90.0)) return Bad("max_slant_deg", max_slant_deg, "(0, 90)");
  if (!(far_radii >= max_range_radii && far_radii <= 12.0)) return Bad("far_radii", far_radii, "[max_range_radii, 12]");
  if (!(segment_radii > 0.0 && segment_radii <= 100.0)) return Bad("segment_radii", segment_radii, "(0, 100]");
  if (max_hole_cells < 0 || max_hole_cells > 8) return Bad("max_hole_cells", max_hole_cells, "[0, 8]");
  return Status::Ok();
}

}  // namespace haustra
