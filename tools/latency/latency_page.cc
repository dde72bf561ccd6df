#include "tools/latency/latency_page.h"

#include <algorithm>
#include <cstdarg>
#include <cstdio>
#include <nlohmann/json.hpp>

#include "tools/report/html_text.h"
#include "tools/report/page_assets.h"

namespace haustra {
namespace {

using report::EscapeHtml;

std::string Format(const char* format, ...) __attribute__((format(printf, 1, 2)));
std::string Format(const char* format, ...) {
  char line[512];
  va_list arguments;
  va_start(arguments, format);
  std::vsnprintf(line, sizeof(line), format, arguments);
  va_end(arguments);
  return line;
}

std::string Number(double value) {
  return value == static_cast<double>(static_cast<long long>(value)) ? Format("%.0f", value) : Format("%.3f", value);
}

evaluate::TextTable StageTable(const LatencyRecord& record) {
  evaluate::TextTable table;
  table.header = {"stage", "count", "mean ms", "p50", "p99", "p99.9", "max"};
  table.num_left = 1;
  for (const LatencyRecord::StageHistogram& stage : record.stages()) {
    const LatencyHistogram& h = stage.histogram;
    if (h.count() == 0) continue;
    table.rows.push_back({stage.name, std::to_string(h.count()), Format("%.3f", ToMilliseconds(h.mean())),
                          Format("%.3f", ToMilliseconds(h.Quantile(0.5))),
                          Format("%.3f", ToMilliseconds(h.Quantile(0.99))),
                          Format("%.3f", ToMilliseconds(h.Quantile(0.999))), Format("%.3f", ToMilliseconds(h.max()))});
  }
  return table;
}

// What happened beside the times.
std::vector<std::pair<std::string, std::string>> CountLines(const LatencyReport& report) {
  const LatencyRecord& record = *report.record;
  const LatencyFigureValues values = record.Values();
  std::vector<std::pair<std::string, std::string>> lines = {
      {"frames measured", Number(values.frames) + " (and " + std::to_string(record.num_warm_up()) + " to warm up)"},
      {"deadline", Format("%.1f ms from capture to pose", report.deadline_ms)},
      {"misses", Number(values.misses)},
      {"drops", Number(values.drops)},
      {"tracking", std::to_string(record.num_tracking()) + " frames had a pose"}};
  for (int i = 1; i < kNumRungs; ++i) {
    lines.emplace_back("rung " + std::string(ToString(static_cast<Rung>(i))),
                       std::to_string(record.num_on_rung()[static_cast<std::size_t>(i)]) + " frames");
  }
  const ThreadUse& use = record.use();
  lines.emplace_back("page faults", std::to_string(use.minor_faults) + " minor, " + std::to_string(use.major_faults) +
                                        " major, of the tracking thread");
  lines.emplace_back("context switches", std::to_string(use.voluntary_switches) + " waits, " +
                                             std::to_string(use.involuntary_switches) + " forced");
  return lines;
}

// "1500 MHz, now 1200 MHz" where it changed.
BoardState MergedBoard(const LatencyReport& report) {
  BoardState merged = report.board_before;
  for (auto& [what, value] : merged) {
    for (const auto& [what_after, value_after] : report.board_after) {
      if (what_after == what && value_after != value) value += "; afterwards " + value_after;
    }
  }
  return merged;
}

std::string VerdictLine(const RequirementLine& line) {
  return Format("%-12s %s %s, measured %s: %s", std::string(line.name).c_str(),
                line.is_minimum ? "at least" : "at most", Number(line.limit).c_str(), Number(line.value).c_str(),
                line.is_met ? "met" : "NOT MET");
}

nlohmann::ordered_json ChartData(const LatencyReport& report) {
  nlohmann::ordered_json data;
  data["deadline_ms"] = report.deadline_ms;
  // Half-millisecond bars are what a page can show; the file has the histogram itself.
  std::vector<std::uint64_t> bars;
  for (const LatencyHistogram::Bucket& bucket : report.record->end_to_end().Buckets()) {
    const auto bar = std::min<std::size_t>(400, static_cast<std::size_t>(2.0 * ToMilliseconds(bucket.upper)));
    if (bars.size() <= bar) bars.resize(bar + 1, 0);
    bars[bar] += bucket.count;
  }
  data["bars"] = bars;
  data["bar_ms"] = 0.5;
  data["worst_of_second"] = report.record->worst_of_second();
  return data;
}

constexpr std::string_view kScript = R"js(
const data = JSON.parse(document.getElementById('chart-data').textContent);
const line = {id: 'deadline', afterDraw(chart) {
  const {ctx, chartArea: area, scales} = chart, vertical = chart.canvas.id === 'histogram';
  const at = vertical ? scales.x.getPixelForValue(data.deadline_ms / data.bar_ms) : scales.y.getPixelForValue(data.deadline_ms);
  ctx.save(); ctx.strokeStyle = '#c00'; ctx.setLineDash([6, 4]); ctx.beginPath();
  if (vertical) { ctx.moveTo(at, area.top); ctx.lineTo(at, area.bottom); }
  else { ctx.moveTo(area.left, at); ctx.lineTo(area.right, at); }
  ctx.stroke(); ctx.restore();
}};
const bars = Math.max(data.bars.length, Math.ceil(1.1 * data.deadline_ms / data.bar_ms));
new Chart('histogram', {type: 'bar', plugins: [line],
  data: {labels: Array.from({length: bars}, (_, i) => (i * data.bar_ms).toFixed(1)),
         datasets: [{data: data.bars, backgroundColor: '#357', barPercentage: 1, categoryPercentage: 1}]},
  options: {animation: false, maintainAspectRatio: false, plugins: {legend: {display: false}},
            scales: {x: {title: {display: true, text: 'from capture to pose, ms'}},
                     y: {type: 'logarithmic', min: 0.5, title: {display: true, text: 'frames'}}}}});
new Chart('worst', {type: 'line', plugins: [line],
  data: {labels: data.worst_of_second.map((_, i) => i),
         datasets: [{data: data.worst_of_second, borderColor: '#357', borderWidth: 1, pointRadius: 0}]},
  options: {animation: false, maintainAspectRatio: false, plugins: {legend: {display: false}},
            scales: {x: {title: {display: true, text: 'seconds'}},
                     y: {min: 0, suggestedMax: 1.1 * data.deadline_ms, title: {display: true, text: 'worst of a second, ms'}}}}});
)js";

std::string PairsHtml(const std::vector<std::pair<std::string, std::string>>& pairs) {
  evaluate::TextTable table;
  table.header = {"what", "value"};
  table.num_left = 2;
  for (const auto& [what, value] : pairs) table.rows.push_back({what, value});
  return report::TableHtml(table);
}

}  // namespace

bool LatencyReport::is_met() const {
  return record->num_measured() > 0 &&
         std::all_of(verdict.begin(), verdict.end(), [](const RequirementLine& line) { return line.is_met; });
}

std::string ToText(const LatencyReport& report) {
  const LatencyRecord& record = *report.record;
  std::string text = report.title + "\n";
  for (const auto& [what, value] : report.settings) text += Format("  %-18s %s\n", what.c_str(), value.c_str());
  for (const auto& [what, value] : MergedBoard(report)) text += Format("  %-18s %s\n", what.c_str(), value.c_str());
  if (record.realtime()) text += ToText(*record.realtime());
  text += "\n" + evaluate::FormatTable(StageTable(record), evaluate::TableFormat::kText) + "\n";
  for (const auto& [what, value] : CountLines(report)) text += Format("  %-18s %s\n", what.c_str(), value.c_str());
  if (report.verdict.empty()) return text;
  text += "\n";
  for (const RequirementLine& line : report.verdict) text += "  " + VerdictLine(line) + "\n";
  return text + (report.is_met() ? "REQUIREMENT MET\n" : "REQUIREMENT NOT MET\n");
}

std::string ToJson(const LatencyReport& report) {
  const LatencyRecord& record = *report.record;
  const LatencyFigureValues values = record.Values();
  nlohmann::ordered_json json;
  json["title"] = report.title;
  for (const auto& [what, value] : report.settings) json["settings"][what] = value;
  for (const auto& [what, value] : MergedBoard(report)) json["board"][what] = value;
  json["deadline_ms"] = report.deadline_ms;
  for (const RequirementKey& key : kRequirementKeys) json[std::string(key.name)] = values.*key.value;
  for (int i = 0; i < kNumRungs; ++i) {
    json["rungs"][std::string(ToString(static_cast<Rung>(i)))] = record.num_on_rung()[static_cast<std::size_t>(i)];
  }
  json["context_switches"] = {{"voluntary", record.use().voluntary_switches},
                              {"involuntary", record.use().involuntary_switches}};
  for (const LatencyRecord::StageHistogram& stage : record.stages()) {
    const LatencyHistogram& h = stage.histogram;
    if (h.count() == 0) continue;
    json["stages"][stage.name] = {{"count", h.count()},
                                  {"mean_ms", ToMilliseconds(h.mean())},
                                  {"p50_ms", ToMilliseconds(h.Quantile(0.5))},
                                  {"p99_ms", ToMilliseconds(h.Quantile(0.99))},
                                  {"p99.9_ms", ToMilliseconds(h.Quantile(0.999))},
                                  {"max_ms", ToMilliseconds(h.max())}};
  }
  if (record.realtime()) {
    json["realtime"] = {{"all_granted", record.realtime()->is_all_granted()},
                        {"refusals", Refusals(*record.realtime())}};
  }
  for (const RequirementLine& line : report.verdict) {
    json["verdict"][std::string(line.name)] = {{"limit", line.limit}, {"value", line.value}, {"met", line.is_met}};
  }
  if (!report.verdict.empty()) json["met"] = report.is_met();
  // Names of files need not be UTF-8.
  return json.dump(2, ' ', false, nlohmann::ordered_json::error_handler_t::replace) + "\n";
}

std::string MakeLatencyPage(const LatencyReport& report) {
  const LatencyRecord& record = *report.record;
  std::string page = report::PageStart(report.title);
  if (!report.verdict.empty()) {
    page += std::string("<h2>") + (report.is_met() ? "Requirement met" : "Requirement not met") + "</h2>\n<ul>\n";
    for (const RequirementLine& line : report.verdict) {
      page +=
          std::string("<li") + (line.is_met ? ">" : " class=\"warnings\">") + EscapeHtml(VerdictLine(line)) + "</li>\n";
    }
    page += "</ul>\n";
  }
  page +=
      "<h2>From capture to pose</h2>\n<p>The dashed line is the deadline. Frames on a logarithmic scale.</p>\n"
      "<div class=\"plot\" style=\"height:260px\"><canvas id=\"histogram\"></canvas></div>\n"
      "<div class=\"plot\" style=\"height:200px\"><canvas id=\"worst\"></canvas></div>\n";
  page += "<div class=\"two\"><div>" + PairsHtml(CountLines(report)) + "</div><div>" + PairsHtml(report.settings) +
          PairsHtml(MergedBoard(report)) + "</div></div>\n";
  page += "<h2>Stages</h2>\n" + report::TableHtml(StageTable(record));
  if (record.realtime()) page += "<h2>Scheduling</h2>\n<pre>" + EscapeHtml(ToText(*record.realtime())) + "</pre>\n";
  page += report::PlotCredits();
  page += "<script type=\"application/json\" id=\"chart-data\">" + report::JsonForScript(ChartData(report).dump()) +
          "</script>\n<script>\n";
  page += report::ChartJs();
  page += "\n</script>\n<script>";
  page += kScript;
  page += "</script>\n</body>\n</html>\n";
  return page;
}

}  // namespace haustra
