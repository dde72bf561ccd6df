#include "platform/control/control_protocol.h"

#include <algorithm>
#include <array>
#include <cctype>
#include <charconv>
#include <cmath>

namespace haustra {
namespace {

constexpr std::string_view kMarkArguments = " X Y LABEL [FRAME [PROCEDURE]]";
struct CommandName {
  std::string_view name;
  ControlCommand command;
  std::string_view arguments = {};
};
constexpr std::array<CommandName, 9> kCommands{{{"status", ControlCommand::kStatus},
                                                {"metrics", ControlCommand::kMetrics},
                                                {"begin", ControlCommand::kBegin, " [LABEL]"},
                                                {"resume", ControlCommand::kResume},
                                                {"end", ControlCommand::kEnd, " [keep|wipe]"},
                                                {"save", ControlCommand::kSave, " NAME"},
                                                {"mark", ControlCommand::kMark, kMarkArguments},
                                                {"marks", ControlCommand::kMarks},
                                                {"unmark", ControlCommand::kUnmark, " LABEL [PROCEDURE]"}}};

std::string MarkForm() { return "; mark" + std::string(kMarkArguments); }

bool IsPrintable(char c) { return c >= 0x20 && c < 0x7f; }

// Never longer than a name: the message goes to logs and terminals.
std::string Quoted(std::string_view text) {
  std::string quoted = "'";
  for (const char c : text.substr(0, kMaxNameBytes)) quoted += IsPrintable(c) ? c : '?';
  return quoted + (text.size() > kMaxNameBytes ? "...'" : "'");
}

bool IsMarkName(std::string_view name) { return name.size() <= kMaxMarkNameBytes && IsControlName(name); }

template <typename Number>
bool ParseAll(std::string_view text, Number* number) {
  const auto [end, error] = std::from_chars(text.data(), text.data() + text.size(), *number);
  return error == std::errc() && end == text.data() + text.size();
}

template <typename Number>
std::string NumberText(Number number) {
  std::array<char, 32> text;
  return {text.data(), std::to_chars(text.data(), text.data() + text.size(), number).ptr};
}

// The word up to the next space, which is taken off with it.
std::string_view TakeWord(std::string_view* text) {
  const std::size_t space = text->find(' ');
  const std::string_view word = text->substr(0, space);
  text->remove_prefix(space == std::string_view::npos ? text->size() : space + 1);
  return word;
}

// May be left out.
Status ParseProcedure(std::string_view argument, ControlRequest* request) {
  if (argument.empty()) return Status::Ok();
  std::uint64_t number = 0;
  if (!ParseAll(argument, &number)) return InvalidArgument(Quoted(argument) + " is no number of a procedure");
  request->procedure = number;
  return Status::Ok();
}

Status ParseMark(std::string_view argument, ControlRequest* request) {
  const auto missing = [](const char* what) {
    return InvalidArgument(std::string("mark: ") + what + " is missing" + MarkForm());
  };
  for (double* value : {&request->x_px, &request->y_px}) {
    if (argument.empty()) return missing(value == &request->x_px ? "X" : "Y");
    const std::string_view word = TakeWord(&argument);
    if (!ParseAll(word, value) || !(std::abs(*value) <= kMaxMarkPixel)) {
      return InvalidArgument("mark: " + Quoted(word) + " is no pixel" + MarkForm());
    }
  }
  if (argument.empty()) return missing("LABEL");
  const std::string_view name = TakeWord(&argument);
  if (!IsMarkName(name)) {
    return InvalidArgument("mark: " + Quoted(name) +
                           " is not a label (1 to 31 letters, digits, '.', '_', '-', the first a letter or digit)");
  }
  request->name = name;
  if (argument.empty()) return Status::Ok();
  const std::string_view frame = TakeWord(&argument);
  std::uint32_t frame_index = 0;
  if (!ParseAll(frame, &frame_index)) return InvalidArgument("mark: " + Quoted(frame) + " is no frame number");
  request->frame_index = frame_index;
  return ParseProcedure(argument, request);
}

}  // namespace

bool IsControlName(std::string_view name) {
  const auto is_alphanumeric = [](char c) { return std::isalnum(static_cast<unsigned char>(c)) != 0; };
  return !name.empty() && name.size() <= kMaxNameBytes && is_alphanumeric(name.front()) &&
         std::all_of(name.begin(), name.end(),
                     [&](char c) { return is_alphanumeric(c) || c == '.' || c == '_' || c == '-'; });
}

std::vector<std::string> ControlWords() {
  std::vector<std::string> words;
  for (const CommandName& command : kCommands) words.emplace_back(command.name);
  return words;
}

std::string ControlForms() {
  std::string forms;
  for (const CommandName& command : kCommands) {
    forms += (forms.empty() ? "" : ", ") + std::string(command.name) + std::string(command.arguments);
  }
  return forms;
}

Result<ControlRequest> ParseControlRequest(std::string_view packet) {
  if (packet.size() > kMaxRequestBytes) {
    return InvalidArgument("request is longer than " + std::to_string(kMaxRequestBytes) + " bytes");
  }
  // A line end at the end is what people send by hand.
  if (packet.ends_with('\n')) packet.remove_suffix(1);
  if (!std::all_of(packet.begin(), packet.end(), IsPrintable)) {
    return InvalidArgument("request " + Quoted(packet) + " has bytes that are not printable ASCII");
  }
  const std::size_t space = packet.find(' ');
  const std::string_view word = packet.substr(0, space);
  std::string_view argument = space == std::string_view::npos ? std::string_view() : packet.substr(space + 1);
  const auto* found =
      std::find_if(kCommands.begin(), kCommands.end(), [&](const CommandName& c) { return c.name == word; });
  if (found == kCommands.end()) {
    return InvalidArgument("unknown request " + Quoted(word) + "; there are " + ControlForms());
  }
  if (packet.ends_with(' ')) return InvalidArgument("request ends in a space");

  ControlRequest request;
  request.command = found->command;
  switch (request.command) {
    case ControlCommand::kBegin:
    case ControlCommand::kSave:
      if (argument.empty() && request.command == ControlCommand::kBegin) break;
      if (argument.empty()) return InvalidArgument("save: NAME is missing");
      if (!IsControlName(argument)) {
        return InvalidArgument(std::string(word) + ": " + Quoted(argument) +
                               " is not a name (1 to 64 letters, digits, '.', '_', '-', the first a letter or digit)");
      }
      request.name = argument;
      break;
    case ControlCommand::kMark: HAUSTRA_TRY(ParseMark(argument, &request)); break;
    case ControlCommand::kUnmark:
      if (argument.empty()) return InvalidArgument("unmark: LABEL is missing");
      request.name = TakeWord(&argument);
      if (!IsMarkName(request.name)) {
        return InvalidArgument("unmark: " + Quoted(request.name) + " is not a label of a mark");
      }
      HAUSTRA_TRY(ParseProcedure(argument, &request));
      break;
    case ControlCommand::kEnd:
      if (argument.empty()) break;
      if (argument != "keep" && argument != "wipe") {
        return InvalidArgument("end: " + Quoted(argument) + " is neither keep nor wipe");
      }
      request.keep = argument == "keep";
      break;
    default:
      if (!argument.empty()) return InvalidArgument(std::string(word) + " takes no argument");
  }
  return request;
}

std::string ToText(const ControlRequest& request) {
  std::string text;
  for (const CommandName& command : kCommands) {
    if (command.command == request.command) text = command.name;
  }
  if (request.command == ControlCommand::kMark) {
    text += " " + NumberText(request.x_px) + " " + NumberText(request.y_px);
  }
  if (!request.name.empty()) text += " " + request.name;
  if (request.frame_index) text += " " + NumberText(*request.frame_index);
  if (request.procedure) text += " " + NumberText(*request.procedure);
  if (request.keep) text += *request.keep ? " keep" : " wipe";
  return text;
}

std::string ReplyText(const Result<std::string>& reply) {
  std::string text;
  if (reply.ok()) {
    text = "ok\n" + *reply;
  } else {
    text = "error " + reply.status().message() + "\n";
  }
  if (text.size() > kMaxReplyBytes) text.resize(kMaxReplyBytes);
  return text;
}

Result<std::string> ParseReply(std::string_view packet) {
  if (packet.starts_with("ok\n")) return std::string(packet.substr(3));
  if (!packet.starts_with("error ")) return DataLoss("not a reply of haustrad");
  packet.remove_prefix(6);
  if (packet.ends_with('\n')) packet.remove_suffix(1);
  return FailedPrecondition(std::string(packet));
}

}  // namespace haustra
