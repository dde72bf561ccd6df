// A finished run as a site: the page, and all that it shows. thread-bound(caller).
#pragma once

#include <string>

#include "hal/core/status.h"
#include "tools/view/view_server.h"

namespace haustra::view {

struct RunSiteRequest {
  std::string run;      // output folder of `haustra run`
  std::string surface;  // output folder of `haustra surface`; empty: RUN/surface where it is there
};

// Everything is read here and kept in memory. Errors of evaluate::ReadRunOutput and report::ReadMapModel, with the
// file; kNotFound: no such folder of a surface, or no map_NNNN.ply of a map of the run in it; kInvalidArgument: one of
// these is no PLY file.
Result<ViewSite> MakeRunSite(const RunSiteRequest& request);

}  // namespace haustra::view
