// A configuration as a table of fields bound to a struct: reads YAML files and command-line assignments into it,
// refuses what is not in the table, knows where every value came from, and writes itself out as a file again.
#pragma once

#include <string>
#include <string_view>
#include <utility>
#include <vector>

#include "hal/core/status.h"
#include "platform/config/config_field.h"

namespace haustra {

struct ConfigOrigin {
  enum class Kind { kDefault, kFile, kCommandLine };
  Kind kind = Kind::kDefault;
  std::string where;  // "colon.yaml:12"; the argument as it was given

  std::string ToString() const;  // "default", "colon.yaml:12", "command line: noise.k=2"
};

// The untyped half: fields, and operations on the struct behind a pointer. Use ConfigStore.
class ConfigTable {
 public:
  // Fields of one section stand together. Stops the process on a table that contradicts itself (programmer error).
  explicit ConfigTable(std::vector<ConfigField> fields);

  const std::vector<ConfigField>& fields() const { return fields_; }
  // -1 when there is none.
  int FindField(std::string_view key) const;

  // The key that was probably meant, or empty.
  std::string NearestKey(std::string_view key) const;

  Status ApplyFile(const std::string& path, void* config, std::vector<ConfigOrigin>* origins) const;
  Status ApplyText(std::string_view text, const std::string& name, void* config,
                   std::vector<ConfigOrigin>* origins) const;
  Status ApplyAssignment(std::string_view assignment, void* config, std::vector<ConfigOrigin>* origins) const;
  std::string Print(const void* config, const std::vector<ConfigOrigin>& origins) const;
  // The reference page: a Markdown table of every key with default, range, unit and meaning.
  std::string Reference(const void* defaults) const;

 private:
  std::string DescribeUnknown(std::string_view key) const;
  Status Apply(std::string_view text, const std::string& name, int depth, void* config,
               std::vector<ConfigOrigin>* origins) const;
  Status ReadAndApply(const std::string& path, int depth, void* config, std::vector<ConfigOrigin>* origins) const;

  std::vector<ConfigField> fields_;
};

// A configuration of type `Config` (default constructible, copyable) and the origin of each of its values. Every Apply
// is all or nothing: on an error the configuration is as it was. thread-bound(its owner).
//
// Errors of the Apply functions: kFailedPrecondition, one line a problem, each "file:line:column: key: what is wrong;
// allowed: ..." (or the key nearest to an unknown one); of a file the errors of capture/files/whole_file.h.
//
// A file may name another one to start from, relative to its own folder: `preset: colon.yaml`. The values of the
// preset apply first, at whatever line the key stands.
template <typename Config>
class ConfigStore {
 public:
  explicit ConfigStore(std::vector<ConfigField> fields) : table_(std::move(fields)), origins_(table_.fields().size()) {}

  const Config& config() const { return config_; }
  const ConfigTable& table() const { return table_; }
  // Of a key in the table.
  const ConfigOrigin& origin(std::string_view key) const {
    const int field = table_.FindField(key);
    HAUSTRA_CHECK(field >= 0);
    return origins_[static_cast<std::size_t>(field)];
  }

  Status ApplyFile(const std::string& path) {
    return Change([&](Config* config, auto* origins) { return table_.ApplyFile(path, config, origins); });
  }
  // `name` stands for the file in messages and origins.
  Status ApplyText(std::string_view text, const std::string& name) {
    return Change([&](Config* config, auto* origins) { return table_.ApplyText(text, name, config, origins); });
  }
  // "noise.k=2", from the command line.
  Status ApplyAssignment(std::string_view assignment) {
    return Change([&](Config* config, auto* origins) { return table_.ApplyAssignment(assignment, config, origins); });
  }

  // Every key with its value and origin, as a file that gives the same configuration.
  std::string Print() const { return table_.Print(&config_, origins_); }
  std::string Reference() const {
    const Config defaults;
    return table_.Reference(&defaults);
  }

 private:
  template <typename Function>
  Status Change(Function change) {
    Config config = config_;
    std::vector<ConfigOrigin> origins = origins_;
    HAUSTRA_TRY(change(&config, &origins));
    config_ = std::move(config);
    origins_ = std::move(origins);
    return Status::Ok();
  }

  ConfigTable table_;
  Config config_;
  std::vector<ConfigOrigin> origins_;
};

}  // namespace haustra
