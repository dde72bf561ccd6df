#include "platform/control/control_protocol.h"

#include <algorithm>
#include <array>
#include <cctype>

namespace haustra {
namespace {

struct CommandName {
  std::string_view name;
  ControlCommand command;
};
constexpr std::array<CommandName, 6> kCommands{{{"status", ControlCommand::kStatus},
                                                {"metrics", ControlCommand::kMetrics},
                                                {"begin", ControlCommand::kBegin},
                                                {"resume", ControlCommand::kResume},
                                                {"end", ControlCommand::kEnd},
                                                {"save", ControlCommand::kSave}}};
constexpr std::string_view kKnown = "status, metrics, begin [LABEL], resume, end [keep|wipe], save NAME";

bool IsPrintable(char c) { return c >= 0x20 && c < 0x7f; }

// Never longer than a name: the message goes to logs and terminals.
std::string Quoted(std::string_view text) {
  std::string quoted = "'";
  for (const char c : text.substr(0, kMaxNameBytes)) quoted += IsPrintable(c) ? c : '?';
  return quoted + (text.size() > kMaxNameBytes ? "...'" : "'");
}

}  // namespace

bool IsControlName(std::string_view name) {
  const auto is_alphanumeric = [](char c) { return std::isalnum(static_cast<unsigned char>(c)) != 0; };
  return !name.empty() && name.size() <= kMaxNameBytes && is_alphanumeric(name.front()) &&
         std::all_of(name.begin(), name.end(),
                     [&](char c) { return is_alphanumeric(c) || c == '.' || c == '_' || c == '-'; });
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
  const std::string_view argument = space == std::string_view::npos ? std::string_view() : packet.substr(space + 1);
  const auto* found =
      std::find_if(kCommands.begin(), kCommands.end(), [&](const CommandName& c) { return c.name == word; });
  if (found == kCommands.end()) {
    return InvalidArgument("unknown request " + Quoted(word) + "; there are " + std::string(kKnown));
  }
  if (space != std::string_view::npos && argument.empty()) return InvalidArgument("request ends in a space");

  ControlRequest request;
  request.command = found->command;
  switch (request.command) {
    case ControlCommand::kBegin:
    case ControlCommand::kSave:
      if (argument.empty() && request.command == ControlCommand::kBegin) break;
      if (!IsControlName(argument)) {
        return InvalidArgument(std::string(word) + ": " + Quoted(argument) +
                               " is not a name (1 to 64 letters, digits, '.', '_', '-', the first a letter or digit)");
      }
      request.name = argument;
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
  if (!request.name.empty()) text += " " + request.name;
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
