// Requests of the control socket: whatever comes is refused in printable words or understood, and what was understood
// says the same when it is written out.
#include <string>
#include <string_view>

#include "hal/core/check.h"
#include "platform/control/control_protocol.h"
#include "tests/fuzz/fuzz_entries.h"

namespace haustra::test {

void FuzzControlProtocol(std::span<const std::uint8_t> bytes) {
  const std::string_view packet(reinterpret_cast<const char*>(bytes.data()), bytes.size());
  const Result<ControlRequest> request = ParseControlRequest(packet);
  if (request.ok()) {
    HAUSTRA_CHECK(request->name.empty() || IsControlName(request->name));
    const Result<ControlRequest> again = ParseControlRequest(ToText(*request));
    HAUSTRA_CHECK(again.ok() && again->command == request->command && again->name == request->name &&
                  again->keep == request->keep && again->x_px == request->x_px && again->y_px == request->y_px &&
                  again->frame_index == request->frame_index && again->procedure == request->procedure);
  } else {
    const std::string message = request.status().message();
    HAUSTRA_CHECK(!message.empty() && message.size() < 400);
    for (const char c : message) HAUSTRA_CHECK(c >= 0x20 && c < 0x7f);
  }
  const Result<std::string> reply = ParseReply(packet);
  if (reply.ok() && packet.size() <= kMaxReplyBytes) HAUSTRA_CHECK(ReplyText(reply) == packet);
}

}  // namespace haustra::test
