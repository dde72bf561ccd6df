// What must hold in an atlas at any time between two calls of its methods: both directions of every connection agree,
// counts are right, nothing refers to what is gone. For tests and for a look after a crash; walks everything.
#pragma once

#include "engine/atlas/atlas.h"
#include "hal/core/status.h"

namespace haustra {

// kInternal names the first entity that breaks a rule.
Status CheckInvariants(const Atlas& atlas);

}  // namespace haustra
