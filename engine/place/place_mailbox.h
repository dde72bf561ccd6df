// Between the mapper, which asks about places, and the recogniser.
#pragma once

#include "engine/place/place_task.h"
#include "hal/core/task_mailbox.h"

namespace haustra {

using PlaceMailbox = TaskMailbox<PlaceTask>;

}  // namespace haustra
