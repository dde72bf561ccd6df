#include "tools/view/mark_orders.h"

#include <chrono>

#include "platform/control/control_client.h"

namespace haustra::view {
namespace {

// haustrad answers between two steps of the mapping.
constexpr std::chrono::seconds kLimit{5};

}  // namespace

Result<std::string> PassMarkOrder(const std::string& folder, std::string_view request) {
  HAUSTRA_ASSIGN(const ControlRequest parsed, ParseControlRequest(request));
  const bool sets = parsed.command == ControlCommand::kMark;
  if (!sets && parsed.command != ControlCommand::kUnmark) {
    return InvalidArgument("only marks can be set and removed here");
  }
  if (sets && !parsed.frame_index) return InvalidArgument("a mark needs the number of its frame");
  if (!parsed.procedure) return InvalidArgument("the number of the procedure is missing");
  HAUSTRA_ASSIGN(ControlClient client, ControlClient::Connect(folder + "/" + std::string(kControlSocket)));
  return client.Ask(parsed, kLimit);
}

}  // namespace haustra::view
