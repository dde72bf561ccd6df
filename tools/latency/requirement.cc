#include "tools/latency/requirement.h"

#include <yaml-cpp/yaml.h>

#include <charconv>
#include <cmath>

#include "capture/files/whole_file.h"

namespace haustra {
namespace {

std::string Place(const std::string& name, const YAML::Mark& mark) {
  if (mark.is_null()) return name;
  return name + ":" + std::to_string(mark.line + 1) + ":" + std::to_string(mark.column + 1);
}

int FindKey(std::string_view name) {
  for (std::size_t i = 0; i < kRequirementKeys.size(); ++i) {
    if (kRequirementKeys[i].name == name) return static_cast<int>(i);
  }
  return -1;
}

std::string AllKeys() {
  std::string text;
  for (const RequirementKey& key : kRequirementKeys) text += (text.empty() ? "" : ", ") + std::string(key.name);
  return text;
}

bool ParseLimit(const std::string& text, double* limit) {
  const auto [end, error] = std::from_chars(text.data(), text.data() + text.size(), *limit);
  return error == std::errc() && end == text.data() + text.size() && std::isfinite(*limit) && *limit >= 0;
}

}  // namespace

Result<Requirement> ParseRequirement(const std::string& text, const std::string& name) {
  YAML::Node root;
  try {
    root = YAML::Load(text);
  } catch (const YAML::Exception& error) {
    return FailedPrecondition(Place(name, error.mark) + ": " + error.msg);
  }
  if (root.IsNull()) return FailedPrecondition(name + ": requires nothing; keys: " + AllKeys());
  if (!root.IsMap()) {
    return FailedPrecondition(Place(name, root.Mark()) + ": not a map of limits, such as 'p99.9_ms: 25'");
  }
  Requirement requirement;
  std::string problems;
  const auto complain = [&](const YAML::Mark& mark, const std::string& what) {
    problems += (problems.empty() ? "" : "\n") + Place(name, mark) + ": " + what;
  };
  for (const auto& entry : root) {
    const std::string key = entry.first.IsScalar() ? entry.first.Scalar() : std::string("(not a word)");
    const int index = FindKey(key);
    double limit = 0;
    if (index < 0) {
      complain(entry.first.Mark(), key + ": unknown; keys: " + AllKeys());
    } else if (requirement.limits[static_cast<std::size_t>(index)]) {
      complain(entry.first.Mark(), key + ": given twice");
    } else if (!entry.second.IsScalar() || !ParseLimit(entry.second.Scalar(), &limit)) {
      complain(entry.second.Mark(), key + ": not a number of at least 0");
    } else {
      requirement.limits[static_cast<std::size_t>(index)] = limit;
    }
  }
  if (!problems.empty()) return FailedPrecondition(problems);
  return requirement;
}

Result<Requirement> LoadRequirement(const std::string& path) {
  HAUSTRA_ASSIGN(const std::string text, ReadWholeText(path));
  return ParseRequirement(text, path);
}

std::vector<RequirementLine> Judge(const Requirement& requirement, const LatencyFigureValues& values) {
  std::vector<RequirementLine> lines;
  for (std::size_t i = 0; i < kRequirementKeys.size(); ++i) {
    if (!requirement.limits[i]) continue;
    const RequirementKey& key = kRequirementKeys[i];
    const double limit = *requirement.limits[i], value = values.*key.value;
    lines.push_back({key.name, limit, value, key.is_minimum, key.is_minimum ? value >= limit : value <= limit});
  }
  return lines;
}

}  // namespace haustra
