// The exit codes of the daemon are those of the tools.
#pragma once

#include "platform/exit_codes.h"
