#include "platform/daemon/log.h"

#include <unistd.h>

#include <atomic>
#include <cstdio>
#include <cstdlib>

namespace haustra {
namespace {

std::atomic<LogLevel> least_level{LogLevel::kInfo};

std::string_view Word(LogLevel level) {
  switch (level) {
    case LogLevel::kError: return "error ";
    case LogLevel::kWarning: return "warning ";
    case LogLevel::kInfo: return "info ";
    case LogLevel::kDebug: return "debug ";
  }
  return "";
}

void AppendValue(std::string_view value, std::string* line) {
  const bool is_plain = !value.empty() && value.find_first_of(" \"'=\\") == std::string_view::npos &&
                        std::string_view::npos == value.find_first_of("\n\t\r");
  if (!is_plain) *line += '"';
  for (const char c : value) {
    if (c == '"' || c == '\\') {
      *line += '\\';
      *line += c;
    } else if (c == '\n') {
      *line += "\\n";
    } else if (static_cast<unsigned char>(c) < 0x20 || c == 0x7f) {
      *line += '?';
    } else {
      *line += c;
    }
  }
  if (!is_plain) *line += '"';
}

}  // namespace

LogLevel LogLevelFrom(std::string_view name) {
  if (name == "error") return LogLevel::kError;
  if (name == "warning") return LogLevel::kWarning;
  if (name == "debug") return LogLevel::kDebug;
  return LogLevel::kInfo;
}

void SetLogLevel(LogLevel least) { least_level.store(least, std::memory_order_relaxed); }

std::string LogLine(std::string_view event, std::initializer_list<LogValue> values) {
  std::string line(event);
  for (const auto& [key, value] : values) {
    line += ' ';
    line += key;
    line += '=';
    AppendValue(value, &line);
  }
  return line;
}

void Log(LogLevel level, std::string_view event, std::initializer_list<LogValue> values) {
  if (level > least_level.load(std::memory_order_relaxed)) return;
  static const bool is_journal = std::getenv("JOURNAL_STREAM") != nullptr;
  std::string line = is_journal ? "<" + std::to_string(static_cast<int>(level)) + ">" : std::string(Word(level));
  line += LogLine(event, values) + "\n";
  // One call, so that records of two threads do not mix. One that cannot be written is lost.
  [[maybe_unused]] const ssize_t written = ::write(STDERR_FILENO, line.data(), line.size());
}

}  // namespace haustra
