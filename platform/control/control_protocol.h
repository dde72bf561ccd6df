// What is said on the control socket (Unix domain, SOCK_SEQPACKET): a request is one packet of printable ASCII, a word
// and its arguments, and each is answered by one packet, "ok\n" and a text, or "error WHAT\n".
//
//   status             the daemon and its procedure: "key value" lines
//   metrics            counters and times in the text format of Prometheus
//   begin [LABEL]      a new procedure with empty maps; LABEL is the tower's name for it
//   resume             goes on with the procedure that a crash or power cut interrupted
//   end [keep|wipe]    ends the procedure; what becomes of its data, if not what the configuration says
//   save NAME          all maps into NAME.atlas in the folder for saved maps
//   mark X Y LABEL [FRAME [PROCEDURE]]
//                      marks the place on the wall that this pixel of this frame shows (default: the newest); both as
//                      the pose ring counts them, after source.every_nth and source.halve
//   marks              lists the marks, a line each
//   unmark LABEL [PROCEDURE]
//                      removes one
//
// PROCEDURE is the number of the procedure that is meant, as the pose ring has it: when another one is open by then the
// request is refused. No other procedure has that number, nor after a restart of the service. Without it that is the
// one that was open when the request came.
//
// Labels and names: 1 to 64 letters, digits, '.', '_' or '-', the first a letter or digit, so that a name can never
// be a path; those of marks 1 to 31. reentrant.
#pragma once

#include <cstddef>
#include <cstdint>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "hal/core/status.h"

namespace haustra {

inline constexpr std::size_t kMaxRequestBytes = 128;
inline constexpr std::size_t kMaxReplyBytes = std::size_t{1} << 16;
inline constexpr std::size_t kMaxNameBytes = 64;
inline constexpr std::size_t kMaxMarkNameBytes = 31;
inline constexpr double kMaxMarkPixel = 1e6;

// Files of the two sockets in the runtime folder: who may use the first may begin and end procedures, who may use the
// second may look (status, metrics).
inline constexpr std::string_view kControlSocket = "control";
inline constexpr std::string_view kStatusSocket = "status";

enum class ControlCommand { kStatus, kMetrics, kBegin, kResume, kEnd, kSave, kMark, kMarks, kUnmark };

struct ControlRequest {
  ControlCommand command = ControlCommand::kStatus;
  std::string name;          // kBegin: the label, may be empty; kSave, kMark, kUnmark: never empty
  std::optional<bool> keep;  // kEnd
  // kMark: of magnitude kMaxMarkPixel at most.
  double x_px = 0.0;
  double y_px = 0.0;
  std::optional<std::uint32_t> frame_index = std::nullopt;
  std::optional<std::uint64_t> procedure = std::nullopt;  // kMark, kUnmark: that it is meant for
};

// Status and metrics: they change nothing.
constexpr bool OnlyLooks(ControlCommand command) {
  return command == ControlCommand::kStatus || command == ControlCommand::kMetrics;
}

constexpr bool IsAboutMarks(ControlCommand command) {
  return command == ControlCommand::kMark || command == ControlCommand::kMarks || command == ControlCommand::kUnmark;
}

bool IsControlName(std::string_view name);

// What a request may begin with, and how each is written: "begin", "begin [LABEL]".
std::vector<std::string> ControlWords();
std::string ControlForms();

// kInvalidArgument: says what is wrong with it, in printable characters whatever came.
Result<ControlRequest> ParseControlRequest(std::string_view packet);
// ParseControlRequest gives the same request back.
std::string ToText(const ControlRequest& request);

// "ok\n" and the text, cut to kMaxReplyBytes; "error ...\n".
std::string ReplyText(const Result<std::string>& reply);
// The other way round. kFailedPrecondition: the daemon refused, with its reason; kDataLoss: not a reply.
Result<std::string> ParseReply(std::string_view packet);

}  // namespace haustra
