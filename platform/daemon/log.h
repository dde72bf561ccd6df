// The service's log: one line a record on standard error, "event key=value ...", with the level in front in the way
// that the journal reads ("<4>") when it listens, else as a word. thread-safe; not for the tracking thread.
#pragma once

#include <initializer_list>
#include <string>
#include <string_view>
#include <utility>

namespace haustra {

enum class LogLevel { kError = 3, kWarning = 4, kInfo = 6, kDebug = 7 };  // as syslog's

LogLevel LogLevelFrom(std::string_view name);  // a choice of log.level
void SetLogLevel(LogLevel least);

using LogValue = std::pair<std::string_view, std::string>;
// Values with blanks, quotes or bytes that are not printable are quoted and escaped: a record is always one line.
void Log(LogLevel level, std::string_view event, std::initializer_list<LogValue> values = {});

std::string LogLine(std::string_view event, std::initializer_list<LogValue> values);

}  // namespace haustra
