// Where haustrad puts poses and control socket when systemd starts it (RuntimeDirectory=haustra).
#pragma once

namespace haustra {

inline constexpr const char* kRuntimeFolder = "/run/haustra";

}  // namespace haustra
