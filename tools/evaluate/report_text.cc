#include "tools/evaluate/report_text.h"

#include <algorithm>
#include <span>

#include "tools/evaluate/number_text.h"
#include "tools/evaluate/paper_tables.h"
#include "tools/evaluate/trajectory_error.h"

namespace haustra::evaluate {
namespace {

constexpr std::size_t kLabelWidth = 18;

std::string Item(std::string_view label, const std::string& value) {
  return std::string("  ").append(PadRight(label, kLabelWidth)).append(value).append("\n");
}

std::string Count(std::size_t count, const char* singular, const char* plural) {
  return std::to_string(count) + " " + (count == 1 ? singular : plural);
}

std::string CoverageLines(const Evaluation& e) {
  const auto line = [](std::string_view label, double coverage, std::size_t localised, std::size_t frames,
                       const char* which) {
    return Item(label, Fixed(coverage, 2) + " %   (" + std::to_string(localised) + " of " +
                           Count(frames, "frame", "frames") + which + ")");
  };
  std::string text =
      line("live coverage", e.live_coverage, e.live_localised, e.frames, ", answered at the time of the frame");
  text += line("coverage", e.coverage, e.localised, e.frames, ", at the end");
  if (e.visible_coverage && e.live_visible_coverage) {
    text += line("live visible", *e.live_visible_coverage, *e.live_visible_localised, *e.visible_frames,
                 " in which the scene can be seen");
    text += line("visible coverage", *e.visible_coverage, *e.visible_localised, *e.visible_frames, ", at the end");
  } else {
    text += Item("visible coverage", "-   (it is not known when the scene can be seen)");
  }
  if (e.unanswered_frames > 0) {
    text +=
        Item("", Count(e.unanswered_frames, "frame", "frames") + " of the sequence without an answer: not localised");
  }
  if (e.frames_without_groundtruth > 0) {
    text += Item("no true pose", Count(e.frames_without_groundtruth, "frame", "frames"));
  }
  return text;
}

bool HasTruth(const Evaluation& e) { return e.frames_without_groundtruth + e.unanswered_frames < e.frames; }

std::string WhyThereIsNoError(const Evaluation& e) {
  if (e.maps == 0) return "no frame is localised in a map";
  if (!HasTruth(e)) return "there is no true pose of any frame";
  const std::string enough = std::to_string(kMinAteFrames);
  const bool has_enough = std::any_of(e.per_map.begin(), e.per_map.end(),
                                      [](const MapEvaluation& map) { return map.true_frames >= kMinAteFrames; });
  return has_enough ? "the paths of all maps with " + enough + " frames lie on a line"
                    : "no map has " + enough + " localised frames with a true pose";
}

std::string ErrorLines(const Evaluation& e) {
  std::string text;
  if (e.rms_ate) {
    text += Item("RMS ATE", Fixed(e.rms_ate, 4) + " " + e.unit + "   (max " + Fixed(e.max_error, 3) + ", " +
                                Count(e.ate_frames, "frame", "frames") + " in " +
                                Count(e.maps - e.left_out_maps, "map", "maps") + ", each with its own Sim(3))");
  } else {
    text += Item("RMS ATE", "-   (" + WhyThereIsNoError(e) + ")");
  }
  if (HasTruth(e) && (e.left_out_maps > 0 || e.left_out_frames > 0)) {
    text += Item("", "left out: " + Count(e.left_out_maps, "map", "maps") + " with too few true poses or on a line, " +
                         Count(e.left_out_frames, "localised frame", "localised frames") + " in all");
  }
  if (e.scene_depth) text += Item("scene depth", Fixed(e.scene_depth, 2) + " " + e.unit);
  if (e.largest_map_rms_ate_percent_of_depth) {
    text += Item("largest map", "RMS ATE " + Fixed(e.largest_map_rms_ate, 4) + " " + e.unit + ", " +
                                    Fixed(e.largest_map_rms_ate_percent_of_depth, 2) + " % of its depth");
  }
  return text;
}

std::string JoinText(const JoinCount& count) {
  std::string text = std::to_string(count.made);
  if (count.made == 0) return text;
  const std::size_t unjudged = count.made - count.judged;
  text += " (" + std::to_string(count.wrong) + " false";
  if (unjudged > 0) text += ", " + std::to_string(unjudged) + " not judged";
  return text + ")";
}

std::string JoinLines(const Evaluation& e) {
  std::string text = Item("maps", std::to_string(e.maps) + "   (" + std::to_string(e.maps_created) +
                                      " begun; largest: " + Count(e.largest_map_frames, "frame", "frames") + ")");
  text += Item("merges", JoinText(e.merges));
  text += Item("loops", JoinText(e.loops));
  text += Item("relocalisations", JoinText(e.relocalisations) + ", " + Count(e.losses, "loss", "losses"));
  text += Item("recoveries", JoinText(e.recoveries) + "   (by brute force while tracking)");
  text += Item("false merges", std::to_string(e.false_merges) + "   (of all four kinds)");
  text += Item("merge recall", RecallText(e.merge_recall, "pairs of maps that share a view"));
  text += Item("relocal. recall", RecallText(e.relocalisation_recall, "losses with the lost map in view again"));
  for (const JoinEvaluation& join : e.joins) {
    if (join.verdict != Verdict::kFalse) continue;
    text += Item("", "FALSE " + std::string(ToString(join.kind)) + " at frame " + std::to_string(join.frame_idx) +
                         ": " + join.reason + " (ATE " + Fixed(join.ate_parts, 3) + " -> " + Fixed(join.ate_joined, 3) +
                         ", " + Fixed(join.rotation_error_deg, 1) + " deg, " + Fixed(join.translation_error_depths, 2) +
                         " depths)");
  }
  return text;
}

std::string TimesText(const Percentiles& ms) {
  return "p50 " + Fixed(ms.p50, 1) + ", p99 " + Fixed(ms.p99, 1) + ", p99.9 " + Fixed(ms.p999, 1) + ", max " +
         Fixed(ms.max, 1) + " ms";
}

std::string TimeLines(const Evaluation& e) {
  std::string text;
  if (e.frame_ms) {
    text += Item("frame time", TimesText(*e.frame_ms) + (e.mode == "sequential" ? "   (processing, not latency)" : ""));
  }
  if (e.joining_frame_ms) {
    text += Item("  while joining", TimesText(*e.joining_frame_ms) + "   (" +
                                        Count(e.joining_frames, "frame", "frames") + " while maps were joined)");
    text += Item("  otherwise", TimesText(*e.other_frame_ms));
  }
  if (e.deadline_misses) {
    text += Item("deadline misses",
                 std::to_string(*e.deadline_misses) + "   (deadline " + Fixed(e.deadline_ms, 1) + " ms)");
  }
  text += Item("dropped, damaged", std::to_string(e.dropped) + ", " + Count(e.damaged, "frame", "frames"));
  if (e.interlaced > 0) {
    text += Item("interlaced", Count(static_cast<std::size_t>(e.interlaced), "picture", "pictures") +
                                   "   (one field of each was used)");
  }
  if (e.realtime_ratio) text += Item("real-time ratio", Fixed(e.realtime_ratio, 2));
  if (e.peak_rss_mb) text += Item("peak memory", Fixed(e.peak_rss_mb, 0) + " MB");
  if (e.stages.empty() && !e.mean_stage_ms.empty()) {
    std::string stages;
    for (const auto& [name, mean_ms] : e.mean_stage_ms) {
      stages += (stages.empty() ? "" : ", ") + name + " " + Fixed(mean_ms, 1);
    }
    text += Item("mapping stages", stages + " ms a keyframe");
  }
  return text;
}

// Indented like the lines above it; nothing for a table without rows.
std::string TableLines(const TextTable& table) {
  if (table.rows.empty()) return {};
  std::string text = "\n";
  const std::string lines = FormatTable(table, TableFormat::kText);
  for (std::size_t start = 0; start < lines.size();) {
    const std::size_t end = lines.find('\n', start) + 1;
    text += "  " + lines.substr(start, end - start);
    start = end;
  }
  return text;
}

// The run's name is above all its tables already.
TextTable WithoutRun(TextTable table) {
  table.header.erase(table.header.begin());
  for (auto& row : table.rows) row.erase(row.begin());
  --table.num_left;
  return table;
}

}  // namespace

std::string RecallText(const std::optional<Recall>& recall, const std::string& of_what) {
  if (!recall) return "-";
  if (recall->occasions == 0) return of_what.empty() ? "-" : "-   (no " + of_what + ")";
  return Fixed(100.0 * *recall->value(), 1) + " %   (" + std::to_string(recall->taken) + " of " +
         std::to_string(recall->occasions) + (of_what.empty() ? "" : " " + of_what) + ")";
}

std::string ToText(const Evaluation& evaluation) {
  std::string text = evaluation.name;
  if (!evaluation.mode.empty()) {
    text += " (" + evaluation.mode;
    if (!evaluation.device.empty()) text += ", " + evaluation.device;
    if (evaluation.seed) text += ", seed " + std::to_string(*evaluation.seed);
    text += ")";
  }
  text += '\n';
  text += CoverageLines(evaluation);
  text += ErrorLines(evaluation);
  text += JoinLines(evaluation);
  text += TimeLines(evaluation);
  const std::span<const Evaluation> one(&evaluation, 1);
  text += TableLines(MakeMapTable(evaluation));
  text += TableLines(MakeSegmentTable(evaluation));
  text += TableLines(WithoutRun(MakeJoinTable(one)));
  text += TableLines(MakeStageTable(one));
  for (const std::string& warning : evaluation.warnings) text += "  warning: " + warning + "\n";
  return text;
}

}  // namespace haustra::evaluate
