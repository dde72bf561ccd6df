#include "tools/run/mark_file.h"

#include <algorithm>
#include <charconv>
#include <cmath>
#include <string_view>

#include "capture/files/whole_file.h"

namespace haustra {
namespace {

constexpr std::string_view kMarkFileHeader = "frame,u,v,label";

template <typename Number>
bool ParseAll(std::string_view text, Number* number) {
  const auto [end, error] = std::from_chars(text.data(), text.data() + text.size(), *number);
  return error == std::errc() && end == text.data() + text.size();
}

Status ParseLine(std::string_view line, MarkRequest* request) {
  std::array<std::string_view, 4> fields;
  for (std::size_t i = 0; i < fields.size(); ++i) {
    const std::size_t end = i + 1 == fields.size() ? std::string_view::npos : line.find(',');
    fields[i] = line.substr(0, end);
    if (i + 1 == fields.size()) break;
    if (end == std::string_view::npos) return InvalidArgument("four fields expected: " + std::string(kMarkFileHeader));
    line.remove_prefix(end + 1);
  }
  if (!ParseAll(fields[0], &request->frame_index) || request->frame_index == kNewestFrame) {
    return InvalidArgument("'" + std::string(fields[0]) + "' is no frame number");
  }
  for (int i = 0; i < 2; ++i) {
    double& value = request->pixel[i];
    const std::string_view field = fields[static_cast<std::size_t>(i) + 1];
    if (!ParseAll(field, &value) || !std::isfinite(value)) {
      return InvalidArgument("'" + std::string(field) + "' is no pixel");
    }
  }
  const std::optional<MarkLabel> label = MarkLabel::From(fields[3]);
  if (!label) {
    return InvalidArgument("'" + std::string(fields[3]) +
                           "' is no label (1 to 31 letters, digits, '.', '_', '-', the first a letter or digit)");
  }
  request->label = *label;
  return Status::Ok();
}

}  // namespace

Result<std::vector<MarkRequest>> ReadMarkFile(const std::string& path) {
  HAUSTRA_ASSIGN(const std::string text, ReadWholeText(path));
  std::vector<MarkRequest> requests;
  int number = 0;
  for (std::string_view rest = text; !rest.empty();) {
    const std::size_t end = rest.find('\n');
    std::string_view line = rest.substr(0, end);
    rest.remove_prefix(end == std::string_view::npos ? rest.size() : end + 1);
    if (line.ends_with('\r')) line.remove_suffix(1);
    const std::string where = path + ":" + std::to_string(++number) + ": ";
    if (number == 1) {
      if (line != kMarkFileHeader) return InvalidArgument(where + "'" + std::string(kMarkFileHeader) + "' expected");
      continue;
    }
    if (line.empty()) continue;
    MarkRequest request;
    if (const Status status = ParseLine(line, &request); !status.ok()) {
      return InvalidArgument(where + status.message());
    }
    requests.push_back(request);
  }
  if (number == 0) return InvalidArgument(path + ": empty");
  std::stable_sort(requests.begin(), requests.end(),
                   [](const MarkRequest& a, const MarkRequest& b) { return a.frame_index < b.frame_index; });
  return requests;
}

}  // namespace haustra
