// What lies on the lens or swims before it while an event lasts: tissue, water, foam, turbid liquid. Works on linear
// light, before exposure, so that the automatic exposure reacts as it would. Immutable; reentrant.
#pragma once

#include <cstdint>
#include <vector>

#include "tools/render/event_script.h"
#include "tools/render/lens_layers.h"
#include "tools/render/linear_image.h"
#include "tools/render/window_mask.h"

namespace haustra::render {

class LensEffects {
 public:
  LensEffects(const std::vector<Event>& events, const WindowMask& window, std::uint64_t seed);

  // Whether anything of the scene is changed at that time.
  bool IsActive(double time_s) const;
  void Apply(double time_s, LinearImage* image) const;

 private:
  struct Active {
    Event event;
    std::uint32_t seed;
    std::vector<Drop> drops;  // foam, or flecks of debris
  };
  struct Copy {
    std::int32_t to, from;  // pixel numbers
  };
  // Continues the picture beyond the window, so that what bends light finds something there.
  void FillSurround(LinearImage* image) const;

  std::vector<Active> active_;
  std::vector<Copy> surround_;
};

}  // namespace haustra::render
