#include "platform/config/config_table.h"

#include <algorithm>
#include <filesystem>
#include <set>

#include "capture/files/whole_file.h"
#include "hal/core/edit_distance.h"
#include "platform/config/config_document.h"

namespace haustra {
namespace {

constexpr std::string_view kPresetKey = "preset";
constexpr int kMaxPresetDepth = 4;  // deeper is taken for a circle
constexpr int kMaxProblems = 20;    // reported at once

std::string_view Section(std::string_view key) {
  const std::size_t dot = key.rfind('.');
  return dot == std::string_view::npos ? std::string_view() : key.substr(0, dot);
}
std::string_view Leaf(std::string_view key) {
  const std::size_t dot = key.rfind('.');
  return dot == std::string_view::npos ? key : key.substr(dot + 1);
}

std::string At(const std::string& name, int line, int column) {
  return name + ":" + std::to_string(line) + ":" + std::to_string(column) + ": ";
}

// As it is written in a file: text in quotes, so that it is never taken for something else.
std::string ValueInFile(const ConfigField& field, const void* config) {
  std::string text = ToText(field.read(config));
  if (field.type != ConfigType::kText) return text;
  std::string quoted = "'";
  for (const char c : text) quoted += c == '\'' ? std::string("''") : std::string(1, c);
  return quoted + "'";
}

// Gathers problems, so that a file can be mended in one go.
class Problems {
 public:
  void Add(const std::string& line) {
    if (++count_ > kMaxProblems) return;
    if (!text_.empty()) text_ += '\n';
    text_ += line;
  }
  Status status() const {
    if (count_ == 0) return Status::Ok();
    if (count_ <= kMaxProblems) return FailedPrecondition(text_);
    return FailedPrecondition(text_ + "\nand " + std::to_string(count_ - kMaxProblems) + " more");
  }

 private:
  std::string text_;
  int count_ = 0;
};

}  // namespace

std::string ConfigOrigin::ToString() const {
  switch (kind) {
    case Kind::kDefault: return "default";
    case Kind::kFile: return where;
    case Kind::kCommandLine: return "command line: " + where;
  }
  return where;
}

ConfigTable::ConfigTable(std::vector<ConfigField> fields) : fields_(std::move(fields)) {
  std::set<std::string_view> keys;
  std::set<std::string_view> closed_sections;
  std::string_view section;
  for (const ConfigField& field : fields_) {
    HAUSTRA_CHECK(!field.key.empty() && field.key != kPresetKey);
    HAUSTRA_CHECK(keys.insert(field.key).second);
    HAUSTRA_CHECK(field.read != nullptr && field.write != nullptr);
    HAUSTRA_CHECK(field.range.min <= field.range.max);
    if (Section(field.key) != section) {
      closed_sections.insert(section);
      section = Section(field.key);
      HAUSTRA_CHECK(section.empty() || !closed_sections.contains(section));
    }
  }
}

int ConfigTable::FindField(std::string_view key) const {
  for (std::size_t i = 0; i < fields_.size(); ++i) {
    if (fields_[i].key == key) return static_cast<int>(i);
  }
  return -1;
}

std::string ConfigTable::NearestKey(std::string_view key) const {
  // Right name in the wrong section is likelier than a typing error.
  for (const ConfigField& field : fields_) {
    if (Leaf(field.key) == Leaf(key)) return field.key;
  }
  const ConfigField* nearest = nullptr;
  int best = 0;
  for (const ConfigField& field : fields_) {
    const auto distance = static_cast<int>(EditDistance(field.key, key, LetterCase::kMatters));
    if (nearest == nullptr || distance < best) {
      nearest = &field;
      best = distance;
    }
  }
  const int limit = std::max<int>(2, static_cast<int>(key.size()) / 3);
  return nearest != nullptr && best <= limit ? nearest->key : std::string();
}

std::string ConfigTable::DescribeUnknown(std::string_view key) const {
  const std::string name(key);
  for (const ConfigField& field : fields_) {
    if (field.key.starts_with(name + ".")) return name + ": is a section, not a value";
  }
  const std::string nearest = NearestKey(key);
  return name + ": unknown key" + (nearest.empty() ? "" : "; did you mean " + nearest + "?");
}

Status ConfigTable::ApplyFile(const std::string& path, void* config, std::vector<ConfigOrigin>* origins) const {
  return ReadAndApply(path, 0, config, origins);
}

Status ConfigTable::ApplyText(std::string_view text, const std::string& name, void* config,
                              std::vector<ConfigOrigin>* origins) const {
  return Apply(text, name, 0, config, origins);
}

Status ConfigTable::ReadAndApply(const std::string& path, int depth, void* config,
                                 std::vector<ConfigOrigin>* origins) const {
  HAUSTRA_ASSIGN(const std::string text, ReadWholeText(path));
  return Apply(text, path, depth, config, origins);
}

Status ConfigTable::Apply(std::string_view text, const std::string& name, int depth, void* config,
                          std::vector<ConfigOrigin>* origins) const {
  HAUSTRA_ASSIGN(const std::vector<config::ConfigEntry> entries, config::ParseConfigText(text, name));
  for (const config::ConfigEntry& entry : entries) {
    if (entry.key != kPresetKey) continue;
    if (depth + 1 >= kMaxPresetDepth) {
      return FailedPrecondition(At(name, entry.value_line, entry.value_column) + "preset: more than " +
                                std::to_string(kMaxPresetDepth) + " presets in a row; is it a circle?");
    }
    const std::string path = (std::filesystem::path(name).parent_path() / entry.value).string();
    const Status applied = ReadAndApply(path, depth + 1, config, origins);
    if (!applied.ok()) {
      return Status(applied.code(), At(name, entry.value_line, entry.value_column) + "preset:\n" + applied.message());
    }
  }
  Problems problems;
  for (const config::ConfigEntry& entry : entries) {
    if (entry.key == kPresetKey) continue;
    const int field_idx = FindField(entry.key);
    if (field_idx < 0) {
      problems.Add(At(name, entry.key_line, entry.key_column) + DescribeUnknown(entry.key));
      continue;
    }
    const ConfigField& field = fields_[static_cast<std::size_t>(field_idx)];
    const Result<ConfigValue> value = field.Parse(entry.value, entry.is_quoted);
    if (!value.ok()) {
      problems.Add(At(name, entry.value_line, entry.value_column) + entry.key + ": " + value.status().message());
      continue;
    }
    field.write(config, *value);
    (*origins)[static_cast<std::size_t>(field_idx)] = {ConfigOrigin::Kind::kFile,
                                                       name + ":" + std::to_string(entry.value_line)};
  }
  return problems.status();
}

Status ConfigTable::ApplyAssignment(std::string_view assignment, void* config,
                                    std::vector<ConfigOrigin>* origins) const {
  const std::string given(assignment);
  const std::size_t equals = assignment.find('=');
  if (equals == std::string_view::npos || equals == 0) {
    return FailedPrecondition("command line: '" + given + "' is not key=value");
  }
  const std::string_view key = assignment.substr(0, equals);
  const int field_idx = FindField(key);
  if (field_idx < 0) return FailedPrecondition("command line: " + DescribeUnknown(key));
  const ConfigField& field = fields_[static_cast<std::size_t>(field_idx)];
  const Result<ConfigValue> value = field.Parse(assignment.substr(equals + 1), false);
  if (!value.ok()) {
    return FailedPrecondition("command line: " + std::string(key) + ": " + value.status().message());
  }
  field.write(config, *value);
  (*origins)[static_cast<std::size_t>(field_idx)] = {ConfigOrigin::Kind::kCommandLine, given};
  return Status::Ok();
}

std::string ConfigTable::Print(const void* config, const std::vector<ConfigOrigin>& origins) const {
  std::ostringstream out;
  std::string_view section;
  for (std::size_t i = 0; i < fields_.size(); ++i) {
    const ConfigField& field = fields_[i];
    if (Section(field.key) != section) {
      section = Section(field.key);
      std::string indent;
      std::string_view rest = section;
      while (!rest.empty()) {
        const std::size_t dot = rest.find('.');
        out << indent << rest.substr(0, dot) << ":\n";
        rest = dot == std::string_view::npos ? std::string_view() : rest.substr(dot + 1);
        indent += "  ";
      }
    }
    const auto depth = static_cast<std::size_t>(std::count(field.key.begin(), field.key.end(), '.'));
    out << std::string(2 * depth, ' ') << Leaf(field.key) << ": " << ValueInFile(field, config) << "  # "
        << origins[i].ToString() << '\n';
  }
  return out.str();
}

std::string ConfigTable::Reference(const void* defaults) const {
  std::ostringstream out;
  out << "| key | default | allowed | unit | reload | meaning |\n| --- | --- | --- | --- | --- | --- |\n";
  for (const ConfigField& field : fields_) {
    out << "| `" << field.key << "` | " << ValueInFile(field, defaults) << " | " << field.Allowed() << " | "
        << field.unit << " | " << (field.reload == ConfigReload::kLive ? "live" : "restart") << " | "
        << field.description << " |\n";
  }
  return out.str();
}

}  // namespace haustra
