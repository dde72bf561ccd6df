// Marks that a viewer of a running haustrad sets and removes, passed on to its control socket. reentrant.
#pragma once

#include <string>
#include <string_view>

#include "hal/core/status.h"

namespace haustra::view {

// request: "mark X Y LABEL FRAME PROCEDURE" or "unmark LABEL PROCEDURE" of control_protocol.h; nothing else is passed
// on. folder: where haustrad keeps its files. The answer of haustrad, a text for people. kInvalidArgument: another
// request, or one without its frame or its procedure: by now there may be another one. Errors of ControlClient.
Result<std::string> PassMarkOrder(const std::string& folder, std::string_view request);

}  // namespace haustra::view
