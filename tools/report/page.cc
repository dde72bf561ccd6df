#include "tools/report/page.h"

#include <algorithm>
#include <span>

#include "tools/evaluate/number_text.h"
#include "tools/evaluate/paper_tables.h"
#include "tools/evaluate/report_json.h"
#include "tools/evaluate/report_text.h"
#include "tools/report/base64.h"
#include "tools/report/chart_data.h"
#include "tools/report/html_text.h"
#include "tools/report/mark_table.h"
#include "tools/report/motion_table.h"
#include "tools/report/page_assets.h"
#include "tools/report/rejections.h"

namespace haustra::report {
namespace {

using evaluate::Evaluation;
using evaluate::Fixed;
using evaluate::kNothing;
using evaluate::TextTable;

constexpr std::string_view kRunTitle = "haustra run ";
constexpr std::size_t kMaxRejectionRows = 3000;
constexpr std::size_t kMaxEventRows = 1000;

std::string Section(const std::string& id, const std::string& title, const std::string& body) {
  return "<section id=\"" + id + "\">\n<h2>" + EscapeHtml(title) + "</h2>\n" + body + "</section>\n";
}

std::string Paragraph(const std::string& text) { return "<p>" + EscapeHtml(text) + "</p>\n"; }

// A place for a plot; page/report.js fills it.
std::string Plot(const std::string& id, int height_px) {
  return "<div class=\"plot\" style=\"height:" + std::to_string(height_px) + "px\"><canvas id=\"" + id +
         "\"></canvas></div>\n";
}

// A table may be wider than the window.
std::string Wide(const TextTable& table) { return "<div class=\"wide\">" + TableHtml(table) + "</div>\n"; }

std::string CountText(const evaluate::JoinCount& count) {
  std::string text = std::to_string(count.made);
  if (count.made == 0) return text;
  text += ", " + std::to_string(count.wrong) + " false";
  if (count.judged < count.made) text += ", " + std::to_string(count.made - count.judged) + " not judged";
  return text;
}

TextTable SummaryTable(const Evaluation& e) {
  TextTable table;
  table.header = {"figure", "value", "what it is"};
  table.num_left = 3;
  const auto add = [&](std::string name, std::string value, std::string meaning) {
    table.rows.push_back({std::move(name), std::move(value), std::move(meaning)});
  };
  add("live coverage", Fixed(e.live_coverage, 2) + " %",
      std::to_string(e.live_localised) + " of " + std::to_string(e.frames) +
          " frames were answered with a pose in a map that exists at the end");
  add("coverage", Fixed(e.coverage, 2) + " %",
      std::to_string(e.localised) + " of " + std::to_string(e.frames) +
          " frames have a pose in a map that exists at the end");
  if (e.live_visible_coverage) {
    add("live visible coverage", Fixed(e.live_visible_coverage, 2) + " %",
        std::to_string(*e.live_visible_localised) + " of " + std::to_string(*e.visible_frames) +
            " frames in which the scene can be seen");
  }
  add("visible coverage", e.visible_coverage ? Fixed(e.visible_coverage, 2) + " %" : kNothing,
      e.visible_coverage ? std::to_string(*e.visible_localised) + " of " + std::to_string(*e.visible_frames) +
                               " frames in which the scene can be seen"
                         : std::string("it is not known when the scene can be seen"));
  add("RMS ATE", e.rms_ate ? Fixed(e.rms_ate, 4) + " " + e.unit : kNothing,
      "position error after one Sim(3) a map, all maps pooled; max " + Fixed(e.max_error, 3) +
          "; left out: " + std::to_string(e.left_out_maps) + " maps, " + std::to_string(e.left_out_frames) + " frames");
  add("scene depth", e.scene_depth ? Fixed(e.scene_depth, 2) + " " + e.unit : kNothing, "typical distance of the wall");
  add("maps", std::to_string(e.maps),
      std::to_string(e.maps_created) + " begun; the largest has " + std::to_string(e.largest_map_frames) + " frames");
  add("merges", CountText(e.merges), "maps joined; false by the ground truth");
  add("loops", CountText(e.loops), "places met again inside one map");
  add("relocalisations", CountText(e.relocalisations), "after " + std::to_string(e.losses) + " losses");
  add("recoveries", CountText(e.recoveries), "by brute force while tracking");
  add("merge recall", RecallText(e.merge_recall, ""),
      "pairs of maps that share a view by the ground truth and are one map at the end");
  add("relocalisation recall", RecallText(e.relocalisation_recall, ""),
      "losses with the lost map in view again that went on in it");
  if (e.frame_ms) {
    add("frame time",
        "p50 " + Fixed(e.frame_ms->p50, 1) + ", p99 " + Fixed(e.frame_ms->p99, 1) + ", p99.9 " +
            Fixed(e.frame_ms->p999, 1) + ", max " + Fixed(e.frame_ms->max, 1) + " ms",
        e.mode == "sequential" ? "tracking and mapping in turn: processing, not latency"
                               : "from the frame's due time to its pose");
  }
  if (e.deadline_misses) {
    add("deadline misses", std::to_string(*e.deadline_misses), "deadline " + Fixed(e.deadline_ms, 1) + " ms");
  }
  add("dropped, damaged", std::to_string(e.dropped) + ", " + std::to_string(e.damaged),
      "frames that were late, or could not be read");
  if (e.interlaced > 0) {
    add("interlaced", std::to_string(e.interlaced), "pictures of two moments each: one field of each was used");
  }
  add("real-time ratio", Fixed(e.realtime_ratio, 2), "time of the run over duration of the video");
  add("peak memory", e.peak_rss_mb ? Fixed(e.peak_rss_mb, 0) + " MB" : kNothing, "of the process");
  return table;
}

std::string WarningsHtml(const Evaluation& e) {
  if (e.warnings.empty()) return {};
  std::string html = "<ul class=\"warnings\">\n";
  for (const std::string& warning : e.warnings) html += "<li>" + EscapeHtml("warning: " + warning) + "</li>\n";
  return html + "</ul>\n";
}

std::string CoverageHtml(const Evaluation& e) {
  std::string text =
      "A colour is a map, grey is no pose. 'As answered' is what each frame was told at the time; 'in the end' is "
      "after "
      "all merges, with the frames that were placed later.";
  return Paragraph(text) + Plot("coverage", e.visible_coverage ? 230 : 200);
}

// A page is sent by mail and opened on any machine: of meshes it takes so many bytes, before base64 adds a third.
constexpr std::size_t kMaxMeshBytes = 3'000'000;

bool AreShown(const std::map<int, std::string>& meshes) {
  std::size_t bytes = 0;
  for (const auto& [map_id, ply] : meshes) bytes += ply.size();
  return bytes <= kMaxMeshBytes;
}

std::string ViewsHtml(const Evaluation& e, bool has_truth, const std::map<int, std::string>& meshes) {
  std::string text =
      "Camera paths (lines) and map points (dots): in 3D, to be turned with the mouse, and seen along the smallest and "
      "the middle principal axis of the path. ";
  text += has_truth ? "The true path is the thin line, black or in 3D white."
                    : "Each map has its own frame and scale: no ground truth was given.";
  if (!meshes.empty()) {
    text +=
        AreShown(meshes)
            ? " In 3D the surface of the wall is shown in place of the points: from outside, cut open, or from inside. "
              "Its outside is the back of what the scope saw, in one colour. A gap, blue from inside, "
              "was not seen or has no depth."
            : " The surface of the wall is too large for this page; haustra view shows it.";
  }
  const auto num_alone = static_cast<std::size_t>(
      std::count_if(e.per_map.begin(), e.per_map.end(), [](const auto& map) { return !map.truth_from_map; }));
  if (num_alone > kMaxMapsOnTheirOwn) {
    text += " The " + std::to_string(kMaxMapsOnTheirOwn) + " largest of " + std::to_string(num_alone) + " maps " +
            (has_truth ? "that could not be aligned " : "") + "are shown; haustra view shows all.";
  }
  std::string html = Paragraph(text) + "<div id=\"views\"></div>\n";
  if (has_truth) html += "<h3>Position error over time</h3>\n" + Plot("errors", 240);
  return html;
}

std::string TimesHtml(const Evaluation& e, std::span<const Evaluation> one) {
  if (e.stages.empty()) return Paragraph("The run has no times.csv: stage times are not known.");
  std::string text = "Each stage each time that it ran. 'frame/total' is ";
  text += e.mode == "sequential" ? "the processing of a frame, tracking and mapping in turn. "
                                 : "the latency of a frame, from its due time to its pose. ";
  text += "The dashed line is the deadline.";
  return Paragraph(text) + "<h3>Frames over time</h3>\n" + Plot("frame-times", 260) +
         "<h3>Mapping, place recognition and merging over time</h3>\n" + Plot("mapping-times", 260) +
         "<h3>Distribution</h3>\n<div class=\"two\">\n" + Plot("time-shares", 320) + Plot("stage-ranges", 320) +
         "</div>\n" + Wide(MakeStageTable(one));
}

std::string MarksHtml(const evaluate::RunOutput& run) {
  std::string html = Paragraph(
      "Places on the wall that somebody has pointed at. In each frame that its map was tracked in, a mark is in front, "
      "hidden behind the wall, out of view, or the map cannot tell (unsure). Seen is: in front.");
  if (!run.marks.set.empty()) html += Wide(MakeMarkTable(run));
  if (!run.marks.refused.empty()) html += Wide(MakeRefusedMarkTable(run));
  return html;
}

std::string MotionHtml(const evaluate::RunOutput& run) {
  return Paragraph(
             "Motion along the view that comes again and again, as breathing does. A map cannot tell a wall that moves "
             "from a scope that does. The amplitude is from the middle to one end. Chance: that a motion without a "
             "period looks like this somewhere in the path.") +
         Wide(MakeMotionTable(run));
}

// Nothing where all rows are in the table.
std::string HowManyAreListed(std::size_t num_listed, std::size_t num_rows) {
  if (num_rows <= num_listed) return {};
  return Paragraph("The first " + std::to_string(num_listed) + " of " + std::to_string(num_rows) +
                   " are listed; events.csv has all.");
}

std::string EventsHtml(const evaluate::RunOutput& run) {
  TextTable table;
  table.header = {"event", "details", "frame", "map", "other map"};
  table.num_left = 2;
  std::size_t num_events = 0;
  for (const evaluate::RunEventRow& event : run.events) {
    if (event.event == "merge_rejected" || event.event == "frame_not_found") continue;
    if (++num_events > kMaxEventRows) continue;
    table.rows.push_back({event.event, event.details, std::to_string(event.frame_idx),
                          event.map_id < 0 ? kNothing : std::to_string(event.map_id),
                          event.other_map_id < 0 ? kNothing : std::to_string(event.other_map_id)});
  }
  return "<div class=\"scroll\">" + TableHtml(table) + "</div>\n" + HowManyAreListed(kMaxEventRows, num_events);
}

std::string RejectionsHtml(const evaluate::RunOutput& run) {
  const std::vector<Rejection> rejections = FindRejections(run.events);
  if (rejections.empty()) return Paragraph("No candidate was rejected.");
  std::string html = Paragraph(
      "Every keyframe is compared with those that look most like it, in all maps. A candidate has to pass all checks; "
      "the first that it fails is its reason, and counts of later checks are 0.");
  html += Wide(MakeReasonTable(rejections));
  std::vector<std::string> reasons;
  for (const Rejection& rejection : rejections) reasons.push_back(rejection.reason);
  std::sort(reasons.begin(), reasons.end());
  reasons.erase(std::unique(reasons.begin(), reasons.end()), reasons.end());
  html += "<p><label>Show reason <select id=\"reason-filter\"><option value=\"\">all</option>";
  for (const std::string& reason : reasons) {
    html += "<option value=\"" + EscapeHtml(reason) + "\">" + EscapeHtml(reason) + "</option>";
  }
  html += "</select></label> <span id=\"reason-count\"></span></p>\n<div class=\"scroll\" id=\"rejections\">\n" +
          TableHtml(MakeRejectionTable(rejections, run.frames, kMaxRejectionRows)) + "</div>\n";
  return html + HowManyAreListed(kMaxRejectionRows, rejections.size());
}

std::string DataScript(const std::string& id, const std::string& json) {
  return "<script type=\"application/json\" id=\"" + id + "\">" + JsonForScript(json) + "</script>\n";
}

}  // namespace

std::string_view RunPageStart() {
  static const std::string start = std::string(kPageHead) + std::string(kRunTitle);
  return start;
}

std::string MakePage(const PageContent& content) {
  const Evaluation& e = content.evaluation;
  const std::span<const Evaluation> one(&e, 1);
  const bool has_truth = !content.reference.poses.empty();
  const std::string name = evaluate::ShortName(e.name);
  std::string subtitle = e.mode.empty() ? std::string("mode not known") : e.mode + " mode";
  if (!e.device.empty()) subtitle += ", device " + e.device;
  if (e.seed) subtitle += ", seed " + std::to_string(*e.seed);
  subtitle += ", " + std::to_string(e.frames) + " frames";

  std::string page = PageStart(std::string(kRunTitle) + name) + Paragraph(subtitle);
  if (!has_truth) page += Paragraph("No ground truth was given: errors, precision and recall are not known.");
  page += WarningsHtml(e);
  page += Section("summary", "Summary", Wide(SummaryTable(e)));
  page += Section("coverage-section", "Coverage over time", CoverageHtml(e));
  page += Section("views-section", "Trajectories and map points", ViewsHtml(e, has_truth, content.meshes));
  if (!content.run.marks.set.empty() || !content.run.marks.refused.empty()) {
    page += Section("marks-section", "Marks", MarksHtml(content.run));
  }
  if (!content.run.figures.motions.empty()) {
    page += Section("motion-section", "Motion between scope and wall", MotionHtml(content.run));
  }
  page += Section("times-section", "Stage times", TimesHtml(e, one));
  page += Section("tables-section", "Tables",
                  Wide(MakePaperTable(one)) + Wide(MakeMapTable(e)) + Wide(MakePrecisionTable(one)) +
                      (e.joins.empty() ? std::string() : Wide(MakeJoinTable(one))));
  page +=
      Section("pictures-section", "Where maps were joined",
              content.pictures_html.empty() ? Paragraph("No sequence was given (--sequence), so there are no pictures.")
                                            : content.pictures_html);
  if (!content.wall_html.empty()) page += Section("wall-section", "The wall that was looked at", content.wall_html);
  page += Section("events-section", "What happened", EventsHtml(content.run));
  page += Section("rejections-section", "Why no merge here", RejectionsHtml(content.run));
  page += PlotCredits() + SceneCredits();
  page += DataScript("evaluation", ToJson(e));
  page += DataScript("chart-data", MakeChartData(content.run, content.reference, e, content.models));
  if (!content.meshes.empty() && AreShown(content.meshes)) {
    page += DataScript("surface-maps", content.surface_json);
    for (const auto& [map_id, ply] : content.meshes) {
      page += "<script type=\"text/plain\" id=\"mesh-" + std::to_string(map_id) + "\">" +
              ToBase64(std::span(reinterpret_cast<const std::uint8_t*>(ply.data()), ply.size())) + "</script>\n";
    }
  }
  page += "<script>\n";
  page += ChartJs();
  page += "\n</script>\n<script>\n";
  page += ThreeJs();
  page += "\n</script>\n<script>\n";
  page += Scene3dJs();
  page += "\n</script>\n<script>\n";
  page += ReportJs();
  page += "</script>\n</body>\n</html>\n";
  return page;
}

}  // namespace haustra::report
