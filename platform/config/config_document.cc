#include "platform/config/config_document.h"

#include <yaml-cpp/eventhandler.h>
#include <yaml-cpp/exceptions.h>
#include <yaml-cpp/parser.h>

#include <exception>
#include <map>
#include <optional>
#include <sstream>

namespace haustra::config {
namespace {

constexpr std::size_t kMaxBytes = 1 << 20;  // a configuration of this size is some other file
constexpr std::size_t kMaxDepth = 8;

// Collects scalars with the path of keys that leads to them; remembers the first thing that is not allowed. Parser
// events are used rather than YAML::Node because a node forgets tags, aliases and where a key stood.
class EntryCollector final : public YAML::EventHandler {
 public:
  explicit EntryCollector(std::string name) : name_(std::move(name)) {}

  void OnDocumentStart(const YAML::Mark& mark) override {
    if (++num_documents_ > 1) Fail(mark, "a second document; one file holds one configuration");
  }
  void OnDocumentEnd() override {}
  void OnNull(const YAML::Mark& mark, YAML::anchor_t anchor) override { Scalar(mark, "", anchor, "", true); }
  void OnAlias(const YAML::Mark& mark, YAML::anchor_t) override { Fail(mark, "aliases (*name) are not allowed"); }
  void OnScalar(const YAML::Mark& mark, const std::string& tag, YAML::anchor_t anchor,
                const std::string& value) override {
    Scalar(mark, tag, anchor, value, false);
  }
  void OnSequenceStart(const YAML::Mark& mark, const std::string&, YAML::anchor_t, YAML::EmitterStyle::value) override {
    Fail(mark, "lists are not allowed");
    // The events of the elements still come; they must find something to belong to.
    path_.push_back({});
  }
  void OnSequenceEnd() override { CloseMap(); }
  void OnMapStart(const YAML::Mark& mark, const std::string& tag, YAML::anchor_t anchor,
                  YAML::EmitterStyle::value) override {
    if (tag != "?" && !tag.empty()) Fail(mark, "tags (" + tag + ") are not allowed");
    if (anchor != YAML::NullAnchor) Fail(mark, "anchors (&name) are not allowed");
    if (path_.size() >= kMaxDepth) Fail(mark, "nested too deep");
    if (!path_.empty() && !path_.back().key) Fail(mark, "a map cannot be a key");
    path_.push_back({});
  }
  void OnMapEnd() override { CloseMap(); }

  // The first problem found, or ok.
  const Status& status() const { return status_; }
  std::vector<ConfigEntry> TakeEntries() { return std::move(entries_); }

 private:
  struct Level {
    std::optional<std::string> key;  // waiting for its value
    YAML::Mark mark;
    std::map<std::string, int> line_of_key;
  };

  void CloseMap() {
    path_.pop_back();
    if (!path_.empty()) path_.back().key.reset();
  }

  void Fail(const YAML::Mark& mark, const std::string& message) {
    if (!status_.ok()) return;
    status_ = FailedPrecondition(name_ + ":" + std::to_string(mark.line + 1) + ":" + std::to_string(mark.column + 1) +
                                 ": " + message);
  }

  void Scalar(const YAML::Mark& mark, const std::string& tag, YAML::anchor_t anchor, const std::string& value,
              bool is_null) {
    if (tag != "?" && tag != "!" && !tag.empty()) Fail(mark, "tags (" + tag + ") are not allowed");
    if (anchor != YAML::NullAnchor) Fail(mark, "anchors (&name) are not allowed");
    if (path_.empty()) {
      if (!is_null) Fail(mark, "expected 'section:' or 'key: value', found '" + value + "'");
      return;
    }
    Level& level = path_.back();
    if (!level.key) {
      if (value.empty() || value.find('.') != std::string::npos) {
        Fail(mark, "'" + value + "' is not a key; write sections as nested maps");
      }
      const auto [known, is_new] = level.line_of_key.emplace(value, mark.line + 1);
      level.key = value;
      level.mark = mark;
      if (!is_new) Fail(mark, JoinedPath() + ": duplicate key, first on line " + std::to_string(known->second));
      return;
    }
    if (is_null) {
      Fail(level.mark, JoinedPath() + ": has no value");
    } else {
      entries_.push_back({.key = JoinedPath(),
                          .value = value,
                          .is_quoted = tag == "!",
                          .key_line = level.mark.line + 1,
                          .key_column = level.mark.column + 1,
                          .value_line = mark.line + 1,
                          .value_column = mark.column + 1});
    }
    level.key.reset();
  }

  std::string JoinedPath() const {
    std::string joined;
    for (const Level& level : path_) {
      if (!joined.empty()) joined += '.';
      joined += level.key.value_or("");
    }
    return joined;
  }

  std::string name_;
  std::vector<ConfigEntry> entries_;
  std::vector<Level> path_;
  Status status_;
  int num_documents_ = 0;
};

}  // namespace

Result<std::vector<ConfigEntry>> ParseConfigText(std::string_view text, const std::string& name) {
  if (text.size() > kMaxBytes) {
    return FailedPrecondition(name + ": " + std::to_string(text.size()) + " bytes; a configuration has at most " +
                              std::to_string(kMaxBytes));
  }
  EntryCollector collector(name);
  try {
    std::istringstream stream{std::string(text)};
    YAML::Parser parser(stream);
    while (collector.status().ok() && parser.HandleNextDocument(collector)) {
    }
  } catch (const YAML::Exception& error) {
    return FailedPrecondition(name + ":" + std::to_string(error.mark.line + 1) + ":" +
                              std::to_string(error.mark.column + 1) + ": not valid YAML: " + error.msg);
  } catch (const std::exception& error) {
    return FailedPrecondition(name + ": not valid YAML: " + error.what());
  }
  HAUSTRA_TRY(collector.status());
  return collector.TakeEntries();
}

}  // namespace haustra::config
