#include "tools/report/wall_pictures.h"

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <nlohmann/json.hpp>
#include <span>
#include <utility>

#include "capture/files/whole_file.h"
#include "tools/evaluate/number_text.h"
#include "tools/evaluate/text_table.h"
#include "tools/report/base64.h"
#include "tools/report/html_text.h"
#include "tools/run/map_name.h"

namespace haustra::report {
namespace {

using evaluate::Fixed;
using evaluate::TextTable;
using nlohmann::json;

// Units of the drawing.
constexpr double kWidth = 1100.0, kHeight = 220.0;  // of the picture at most
constexpr double kLeft = 60.0, kTop = 8.0, kBottom = 46.0;

std::string Text(double x, double y, const char* anchor, const std::string& text, const char* more = "") {
  return "<text x=\"" + Fixed(x, 1) + "\" y=\"" + Fixed(y, 1) + "\" text-anchor=\"" + anchor + "\"" + more + ">" +
         EscapeHtml(text) + "</text>\n";
}

std::string Line(double x0, double y0, double x1, double y1) {
  return "<line x1=\"" + Fixed(x0, 1) + "\" y1=\"" + Fixed(y0, 1) + "\" x2=\"" + Fixed(x1, 1) + "\" y2=\"" +
         Fixed(y1, 1) + "\"/>\n";
}

// Length along the lumen to the right, angle around it downwards; cells are square where there is room.
std::string Drawing(const std::string& png, double length_radii) {
  const double height = kHeight;
  const double width = std::min(kWidth, height * length_radii / (2.0 * 3.14159265));
  const double bottom = kTop + height;
  std::string svg = "<svg class=\"wall\" viewBox=\"0 0 " + Fixed(kLeft + kWidth + 20.0, 0) + " " +
                    Fixed(kTop + height + kBottom, 0) + "\" role=\"img\">\n";
  svg += "<image x=\"" + Fixed(kLeft, 1) + "\" y=\"" + Fixed(kTop, 1) + "\" width=\"" + Fixed(width, 1) +
         "\" height=\"" + Fixed(height, 1) + "\" preserveAspectRatio=\"none\" href=\"data:image/png;base64," +
         ToBase64(std::span(reinterpret_cast<const std::uint8_t*>(png.data()), png.size())) + "\"/>\n";
  for (int degrees = 0; degrees <= 360; degrees += 90) {
    const double y = kTop + height * degrees / 360.0;
    svg += Line(kLeft - 5.0, y, kLeft, y);
    svg += Text(kLeft - 8.0, y + 4.0, "end", std::to_string(degrees) + "\u00b0");
  }
  // At most a dozen marks, at 1, 2 or 5 times a power of ten.
  double step = 1.0;
  for (int k = 0; length_radii / step > 12.0; ++k) step *= k % 3 == 1 ? 2.5 : 2.0;
  for (double at = 0.0; at <= length_radii; at += step) {
    const double x = kLeft + width * at / length_radii;
    svg += Line(x, bottom, x, bottom + 5.0);
    svg += Text(x, bottom + 18.0, "middle", Fixed(at, 0));
  }
  svg += Text(kLeft, bottom + 38.0, "start", "along the lumen, radii of it, from where the scope first was");
  svg += Text(-(kTop + 0.5 * height), 14.0, "middle", "angle around it", " transform=\"rotate(-90)\"");
  return svg + "</svg>\n";
}

std::string Share(const json& share) { return Fixed(100.0 * share.get<double>(), 1); }

std::string Time(const json& time) { return time.is_null() ? std::string("-") : Fixed(time.get<double>(), 1); }

TextTable SegmentTable(const json& map) {
  TextTable table;
  table.header = {"radii along the lumen", "seen %", "slant or far %", "never %", "first s", "last s"};
  const auto add = [&](std::string name, const json& each, std::string first, std::string last) {
    const double never = 1.0 - each.at("wall_coverage").get<double>() - each.at("seen_poorly").get<double>();
    table.rows.push_back({std::move(name), Share(each.at("wall_coverage")), Share(each.at("seen_poorly")),
                          Fixed(100.0 * never, 1), std::move(first), std::move(last)});
  };
  for (const json& segment : map.at("segments")) {
    add(Fixed(segment.at("from_radii").get<double>(), 1) + " to " + Fixed(segment.at("to_radii").get<double>(), 1),
        segment, Time(segment.at("first_s")), Time(segment.at("last_s")));
  }
  add("all", map, "", "");
  return table;
}

Result<std::string> MapHtml(const std::string& folder, const json& map) {
  const int map_id = map.at("map_id").get<int>();
  std::string html = "<h3>Map " + std::to_string(map_id) + "</h3>\n";
  const json& lumen = map.at("lumen");
  if (!lumen.at("found").get<bool>()) {
    return html + "<p>" + EscapeHtml("No lumen was found: " + lumen.at("reason").get<std::string>() + ".") + "</p>\n";
  }
  HAUSTRA_ASSIGN(const std::string png, ReadWholeText(folder + "/" + MapName(map_id) + "_wall.png"));
  html += Drawing(png, std::max(lumen.at("passed_radii").get<double>(), 1e-3));
  return html + "<div class=\"wide\">" + TableHtml(SegmentTable(map)) + "</div>\n";
}

}  // namespace

Result<std::string> WallPicturesHtml(const std::string& folder) {
  const std::string path = folder + "/surface.json";
  HAUSTRA_ASSIGN(const std::string text, ReadWholeText(path));
  const json surface = json::parse(text, nullptr, false);
  if (surface.is_discarded()) return InvalidArgument(path + ": not JSON");
  std::string html =
      "<p>The wall along the part of the lumen that the scope passed, unrolled. Times are those of the video.</p>\n"
      "<p class=\"legend\"><span class=\"seen\"></span> seen <span class=\"poorly\"></span> only at a slant or from "
      "too "
      "far <span class=\"never\"></span> never seen, or not reconstructed</p>\n";
  try {
    for (const json& map : surface.at("maps")) {
      if (!map.contains("lumen")) {
        return InvalidArgument(path + ": has no coverage of the wall; make the surface again");
      }
      HAUSTRA_ASSIGN(const std::string part, MapHtml(folder, map));
      html += part;
    }
  } catch (const json::exception& error) {
    return InvalidArgument(path + ": " + error.what());
  }
  return html;
}

}  // namespace haustra::report
