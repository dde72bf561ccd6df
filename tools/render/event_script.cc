#include "tools/render/event_script.h"

#include <algorithm>
#include <array>
#include <charconv>
#include <cmath>
#include <iterator>

namespace haustra::render {
namespace {

struct KindEntry {
  EventKind kind;
  std::string_view name;
  double usual_duration_s;
  bool hides_scene;
};
constexpr std::array<KindEntry, 9> kKinds = {{
    {EventKind::kRedout, "redout", 1.2, true},
    {EventKind::kWater, "water", 1.4, true},
    {EventKind::kBubbles, "bubbles", 1.4, true},
    {EventKind::kDebris, "debris", 1.4, true},
    {EventKind::kBlur, "blur", 1.0, true},
    {EventKind::kJump, "jump", 0.44, true},
    {EventKind::kSlip, "slip", 0.5, true},
    {EventKind::kNarrowBand, "narrowband", 4.0, false},
    {EventKind::kInstrument, "instrument", 5.0, false},
}};
constexpr double kLongestRampS = 0.16;

bool ParseNumber(std::string_view text, double* value) {
  const auto [end, error] = std::from_chars(text.data(), text.data() + text.size(), *value);
  return error == std::errc() && end == text.data() + text.size() && std::isfinite(*value);
}

Result<Event> ParseEvent(std::string_view text) {
  const auto fail = [&](const std::string& why) {
    return InvalidArgument("event '" + std::string(text) + "': " + why +
                           " (like redout@8+1.4: kind@start_s+duration_s)");
  };
  const std::size_t at = text.find('@');
  if (at == std::string_view::npos) return fail("no '@'");
  const auto entry =
      std::find_if(kKinds.begin(), kKinds.end(), [&](const KindEntry& e) { return e.name == text.substr(0, at); });
  if (entry == kKinds.end()) {
    std::string names;
    for (const std::string_view name : EventKindNames()) names += (names.empty() ? "" : ", ") + std::string(name);
    return fail("kind is none of " + names);
  }
  Event event{entry->kind, 0.0, entry->usual_duration_s};
  const std::string_view times = text.substr(at + 1);
  const std::size_t plus = times.find('+');
  if (!ParseNumber(times.substr(0, plus), &event.start_s) || event.start_s < 0.0) return fail("bad start");
  if (plus != std::string_view::npos &&
      (!ParseNumber(times.substr(plus + 1), &event.duration_s) || event.duration_s <= 0.0)) {
    return fail("bad duration");
  }
  return event;
}

}  // namespace

std::string_view ToString(EventKind kind) {
  for (const KindEntry& entry : kKinds) {
    if (entry.kind == kind) return entry.name;
  }
  return "unknown";
}

std::vector<std::string_view> EventKindNames() {
  std::vector<std::string_view> names;
  for (const KindEntry& entry : kKinds) names.push_back(entry.name);
  return names;
}

bool HidesScene(EventKind kind) {
  return std::any_of(kKinds.begin(), kKinds.end(),
                     [kind](const KindEntry& entry) { return entry.kind == kind && entry.hides_scene; });
}

double Event::Envelope(double time_s) const {
  const double ramp = std::min(kLongestRampS, 0.4 * duration_s);
  const double x = std::clamp(std::min(time_s - start_s, start_s + duration_s - time_s) / ramp, 0.0, 1.0);
  return x * x * (3.0 - 2.0 * x);
}

Result<std::vector<Event>> ParseEvents(std::string_view script) {
  std::vector<Event> events;
  if (script.empty() || script == "none") return events;
  while (true) {
    const std::size_t comma = script.find(',');
    HAUSTRA_ASSIGN(const Event event, ParseEvent(script.substr(0, comma)));
    events.push_back(event);
    if (comma == std::string_view::npos) break;
    script.remove_prefix(comma + 1);
  }
  return events;
}

std::vector<FrameSpan> FrameSpans(const std::vector<Event>& events, double rate_hz, int num_frames) {
  std::vector<FrameSpan> spans;
  for (const Event& event : events) {
    // An event may be farther off than an int reaches.
    const double first = std::ceil(event.start_s * rate_hz - 1e-9);
    const double last = std::floor((event.start_s + event.duration_s) * rate_hz + 1e-9);
    if (first >= num_frames || last < 0.0) continue;
    spans.push_back({static_cast<int>(std::max(first, 0.0)),
                     static_cast<int>(std::min(std::max(last, first), num_frames - 1.0)), event.kind});
  }
  std::sort(spans.begin(), spans.end(), [](const FrameSpan& a, const FrameSpan& b) {
    return a.first_frame != b.first_frame ? a.first_frame < b.first_frame : a.last_frame < b.last_frame;
  });
  return spans;
}

std::vector<FrameSpan> HiddenSpans(const std::vector<FrameSpan>& spans) {
  std::vector<FrameSpan> hidden;
  std::copy_if(spans.begin(), spans.end(), std::back_inserter(hidden),
               [](const FrameSpan& span) { return HidesScene(span.kind); });
  return hidden;
}

}  // namespace haustra::render
