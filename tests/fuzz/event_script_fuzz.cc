#include <cmath>
#include <string_view>

#include "hal/core/check.h"
#include "tests/fuzz/fuzz_entries.h"
#include "tools/render/event_script.h"

namespace haustra::test {

void FuzzEventScript(std::span<const std::uint8_t> bytes) {
  const std::string_view text(reinterpret_cast<const char*>(bytes.data()), bytes.size());
  const Result<std::vector<render::Event>> events = render::ParseEvents(text);
  if (!events.ok()) {
    HAUSTRA_CHECK(!events.status().message().empty());
    return;
  }
  for (const render::Event& event : *events) {
    HAUSTRA_CHECK(std::isfinite(event.start_s) && std::isfinite(event.duration_s) && event.duration_s > 0.0);
  }
  constexpr int kFrames = 100;
  for (const render::FrameSpan& span : render::FrameSpans(*events, 25.0, kFrames)) {
    HAUSTRA_CHECK(span.first_frame >= 0 && span.last_frame >= span.first_frame && span.last_frame < kFrames);
  }
}

}  // namespace haustra::test
