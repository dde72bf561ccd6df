#include "hal/depth_options.h"

#include <string>

#include "hal/depth_solver.h"

namespace haustra {
namespace {

Status Bad(const char* field, double value, const std::string& range) {
  return InvalidArgument(std::string(field) + " is " + std::to_string(value) + ", must be in " + range);
}

}  // namespace

Status DepthOptions::Validate() const {
  if (step_px < 1 || step_px > 8) return Bad("step_px", step_px, "[1, 8]");
  if (window_radius < 1 || window_radius > 5) return Bad("window_radius", window_radius, "[1, 5]");
  if (window_step_px < 1 || window_step_px > 4) return Bad("window_step_px", window_step_px, "[1, 4]");
  if (num_iterations < 1 || num_iterations > 20) return Bad("num_iterations", num_iterations, "[1, 20]");
  if (max_sources < 1 || max_sources > kMaxDepthSources) {
    return Bad("max_sources", max_sources, "[1, " + std::to_string(kMaxDepthSources) + "]");
  }
  if (best_sources < 1 || best_sources > max_sources) return Bad("best_sources", best_sources, "[1, max_sources]");
  if (!(noise_grey > 0.0 && noise_grey < 100.0)) return Bad("noise_grey", noise_grey, "(0, 100)");
  if (!(smoothness >= 0.0 && smoothness < 100.0)) return Bad("smoothness", smoothness, "[0, 100)");
  if (!(smooth_step > 0.0 && smooth_step < 1.0)) return Bad("smooth_step", smooth_step, "(0, 1)");
  if (!(min_parallax_deg > 0.0 && min_parallax_deg < 30.0)) return Bad("min_parallax_deg", min_parallax_deg, "(0, 30)");
  return Status::Ok();
}

}  // namespace haustra
