#include "capture/calibration/yaml_map.h"

#include <algorithm>
#include <exception>
#include <utility>

#include "capture/concat.h"
#include "capture/number.h"
#include "hal/core/edit_distance.h"

namespace haustra::capture::internal {
namespace {

// Keys are looked up one by one. Settings files with parameters of a whole system have about a hundred.
constexpr std::size_t kMaxKeys = 500;

std::string Joined(const std::vector<std::string_view>& words) {
  std::string text;
  for (const std::string_view word : words) {
    if (!text.empty()) text += ", ";
    text += word;
  }
  return text;
}

int LineOf(const YAML::Mark& mark, int otherwise) { return mark.is_null() ? otherwise : mark.line + 1; }

std::string AtLine(const std::string& path, int line) { return line > 0 ? path + ":" + std::to_string(line) : path; }

}  // namespace

bool IsOneOf(std::string_view word, std::initializer_list<std::string_view> words) {
  return std::find(words.begin(), words.end(), word) != words.end();
}

std::string_view NearestWord(std::string_view word, const std::vector<std::string_view>& candidates) {
  constexpr std::size_t kLongestWord = 64;  // bounds the cost for damaged files
  if (word.size() > kLongestWord) return {};
  std::string_view nearest;
  std::size_t nearest_distance = std::max<std::size_t>(2, word.size() / 4) + 1;
  for (const std::string_view candidate : candidates) {
    const std::size_t distance = EditDistance(word, candidate, LetterCase::kIgnored);
    if (distance >= nearest_distance || distance >= candidate.size()) continue;
    nearest_distance = distance;
    nearest = candidate;
  }
  return nearest;
}

Result<YamlMap> YamlMap::Parse(const std::string& path, std::string text) {
  if (text.starts_with("%YAML:")) text[0] = '#';
  try {
    return FromNode(path, "", YAML::Load(text), 0);
  } catch (const YAML::Exception& e) {
    return InvalidArgument(AtLine(path, LineOf(e.mark, 0)) + ": not valid YAML: " + e.msg);
  } catch (const std::exception& e) {
    return InvalidArgument(path + ": not valid YAML: " + e.what());
  }
}

Result<YamlMap> YamlMap::FromNode(std::string path, std::string prefix, const YAML::Node& node, int line) {
  YamlMap map;
  map.path_ = std::move(path);
  map.prefix_ = std::move(prefix);
  map.line_ = line;
  const std::string here = AtLine(map.path_, line) + ": ";
  const std::string what =
      map.prefix_.empty() ? "the file" : Concat("'", map.prefix_.substr(0, map.prefix_.size() - 1), "'");
  if (!node.IsDefined() || node.IsNull()) return InvalidArgument(here + what + " is empty");
  if (!node.IsMap()) return InvalidArgument(here + what + " is not a map of keys and values");
  if (node.size() > kMaxKeys) {
    return InvalidArgument(here + what + " has " + std::to_string(node.size()) + " keys; a calibration has at most " +
                           std::to_string(kMaxKeys));
  }
  for (const auto& item : node) {
    const int entry_line = LineOf(item.first.Mark(), line);
    if (!item.first.IsScalar()) return InvalidArgument(AtLine(map.path_, entry_line) + ": a key must be a plain word");
    Entry entry{item.first.Scalar(), item.second, entry_line};
    if (const Entry* first = map.Find(entry.key); first != nullptr) {
      return InvalidArgument(AtLine(map.path_, entry_line) + ": '" + map.prefix_ + entry.key +
                             "' was given before, in line " + std::to_string(first->line));
    }
    map.entries_.push_back(std::move(entry));
  }
  return map;
}

Status YamlMap::RequireKnown(const std::vector<std::string_view>& known) const {
  for (const Entry& entry : entries_) {
    if (std::find(known.begin(), known.end(), entry.key) != known.end()) continue;
    const std::string_view nearest = NearestWord(entry.key, known);
    const std::string hint =
        nearest.empty() ? "; known keys: " + Joined(known) : "; did you mean '" + prefix_ + std::string(nearest) + "'?";
    return InvalidArgument(AtLine(path_, entry.line) + ": unknown key '" + prefix_ + entry.key + "'" + hint);
  }
  return Status::Ok();
}

Status YamlMap::RequireNoMisspelling(const std::vector<std::string_view>& known) const {
  std::vector<std::string_view> missing;
  for (const std::string_view key : known) {
    if (!Has(key)) missing.push_back(key);
  }
  for (const Entry& entry : entries_) {
    if (std::find(known.begin(), known.end(), entry.key) != known.end()) continue;
    const std::string_view nearest = NearestWord(entry.key, missing);
    if (nearest.empty()) continue;
    return InvalidArgument(AtLine(path_, entry.line) + ": unknown key '" + prefix_ + entry.key + "'; did you mean '" +
                           prefix_ + std::string(nearest) + "'?");
  }
  return Status::Ok();
}

bool YamlMap::HasAny(std::initializer_list<std::string_view> keys) const {
  return std::any_of(keys.begin(), keys.end(), [this](std::string_view key) { return Has(key); });
}

bool YamlMap::HasPrefix(std::string_view prefix) const {
  return std::any_of(entries_.begin(), entries_.end(),
                     [&](const Entry& entry) { return entry.key.starts_with(prefix); });
}

std::vector<std::string> YamlMap::Keys() const {
  std::vector<std::string> keys;
  for (const Entry& entry : entries_) keys.push_back(entry.key);
  return keys;
}

std::string YamlMap::Where(std::string_view key) const {
  const Entry* entry = Find(key);
  return AtLine(path_, entry != nullptr ? entry->line : line_) + ": '" + prefix_ + std::string(key) + "'";
}

const YamlMap::Entry* YamlMap::Find(std::string_view key) const {
  const auto found =
      std::find_if(entries_.begin(), entries_.end(), [&](const Entry& entry) { return entry.key == key; });
  return found == entries_.end() ? nullptr : &*found;
}

Result<std::string> YamlMap::Scalar(std::string_view key) const {
  const Entry* entry = Find(key);
  if (entry == nullptr) return InvalidArgument(Where(key) + " is missing");
  if (entry->value.IsNull()) return InvalidArgument(Where(key) + " has no value");
  if (!entry->value.IsScalar()) return InvalidArgument(Where(key) + " is not a single value");
  return entry->value.Scalar();
}

Result<double> YamlMap::Number(std::string_view key) const {
  HAUSTRA_ASSIGN(const std::string text, Scalar(key));
  Result<double> number = ParseDouble(text);
  if (!number.ok()) return InvalidArgument(Where(key) + ": " + number.status().message());
  return number;
}

Result<std::int64_t> YamlMap::IntegerIn(std::string_view key, std::int64_t min, std::int64_t max) const {
  HAUSTRA_ASSIGN(const std::string text, Scalar(key));
  const Result<std::int64_t> number = ParseInteger(text);
  if (!number.ok()) return InvalidArgument(Where(key) + ": " + number.status().message());
  if (*number < min || *number > max) {
    return InvalidArgument(Where(key) + " is " + std::to_string(*number) + ", not in " + std::to_string(min) + " to " +
                           std::to_string(max));
  }
  return *number;
}

Result<std::string> YamlMap::Text(std::string_view key) const { return Scalar(key); }

Result<std::vector<double>> YamlMap::Numbers(std::string_view key) const {
  const Entry* entry = Find(key);
  if (entry == nullptr) return InvalidArgument(Where(key) + " is missing");
  if (!entry->value.IsSequence()) return InvalidArgument(Where(key) + " is not a list of numbers");
  std::vector<double> numbers;
  for (const auto& item : entry->value) {
    const std::string here = AtLine(path_, LineOf(item.Mark(), entry->line)) + ": '" + prefix_ + entry->key +
                             "' number " + std::to_string(numbers.size() + 1);
    if (!item.IsScalar()) return InvalidArgument(here + " is not a number");
    const Result<double> number = ParseDouble(item.Scalar());
    if (!number.ok()) return InvalidArgument(here + ": " + number.status().message());
    numbers.push_back(*number);
  }
  return numbers;
}

Result<YamlMap> YamlMap::Map(std::string_view key) const {
  const Entry* entry = Find(key);
  if (entry == nullptr) return InvalidArgument(Where(key) + " is missing");
  return FromNode(path_, prefix_ + entry->key + ".", entry->value, entry->line);
}

}  // namespace haustra::capture::internal
