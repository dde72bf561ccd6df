#include "tools/latency/trace_json.h"

#include <nlohmann/json.hpp>

namespace haustra {
namespace {

enum Row { kCapture = 1, kTracking = 2, kStages = 3, kMapping = 4, kMerging = 5 };

class Trace {
 public:
  explicit Trace(TimePoint origin) : origin_(origin) {
    const std::pair<Row, const char*> rows[] = {{kCapture, "capture"},
                                                {kTracking, "tracking"},
                                                {kStages, "stages of tracking"},
                                                {kMapping, "mapping"},
                                                {kMerging, "merging"}};
    for (const auto& [row, name] : rows) {
      events_.push_back({{"name", "thread_name"}, {"ph", "M"}, {"pid", 1}, {"tid", row}, {"args", {{"name", name}}}});
      events_.push_back(
          {{"name", "thread_sort_index"}, {"ph", "M"}, {"pid", 1}, {"tid", row}, {"args", {{"sort_index", row}}}});
    }
  }

  void Span(Row row, std::string_view name, TimePoint start, Duration duration, nlohmann::json args = {}) {
    nlohmann::json event = {{"name", name}, {"ph", "X"}, {"ts", Microseconds(start)}, {"dur", 1e-3 * duration.count()},
                            {"pid", 1},     {"tid", row}};
    if (!args.empty()) event["args"] = std::move(args);
    events_.push_back(std::move(event));
  }
  void Mark(Row row, std::string_view name, TimePoint time) {
    events_.push_back({{"name", name}, {"ph", "i"}, {"s", "t"}, {"ts", Microseconds(time)}, {"pid", 1}, {"tid", row}});
  }
  std::string Text() const { return nlohmann::json{{"displayTimeUnit", "ms"}, {"traceEvents", events_}}.dump() + "\n"; }

 private:
  double Microseconds(TimePoint time) const { return 1e-3 * static_cast<double>((time - origin_).count()); }

  TimePoint origin_;
  nlohmann::json events_ = nlohmann::json::array();
};

}  // namespace

std::string MakeTraceJson(const LatencyRecord& record) {
  const auto& frames = record.last_frames();
  const TimePoint origin = frames.empty() ? TimePoint{} : frames.front().capture_begin;
  Trace trace(origin);
  for (const FrameOutcome& frame : frames) {
    trace.Span(kCapture, "read", frame.capture_begin, frame.capture);
    trace.Mark(kTracking, "due", frame.due);
    trace.Mark(kTracking, frame.is_late ? "deadline MISSED" : "deadline", frame.deadline);
    trace.Span(kTracking, "frame " + std::to_string(frame.result.frame_index), frame.begin, frame.tracking,
               {{"state", ToString(frame.result.state)},
                {"reason", ToString(frame.result.reason)},
                {"rung", ToString(frame.result.rung)},
                {"latency_ms", ToMilliseconds(frame.latency)},
                {"features", frame.result.num_features},
                {"inliers", frame.result.num_inliers},
                {"page_faults", frame.use.minor_faults + frame.use.major_faults},
                {"forced_switches", frame.use.involuntary_switches}});
    TimePoint start = frame.begin;
    for (std::size_t i = 0; i < frame.result.times.size(); ++i) {
      if (frame.result.times[i].count() == 0) continue;
      trace.Span(kStages, ToString(static_cast<Stage>(i)), start, frame.result.times[i]);
      start += frame.result.times[i];
    }
  }
  for (const MappingTimes& times : record.last_mappings()) {
    TimePoint start = times.start;
    if (start < origin) continue;
    for (const auto& [name, duration] : StagesOf(times)) {
      if (duration.count() == 0) continue;
      trace.Span(kMapping, name, start, duration);
      start += duration;
    }
    if (times.recognition.count() > 0) trace.Span(kMerging, "recognition", start, times.recognition);
  }
  return trace.Text();
}

}  // namespace haustra
