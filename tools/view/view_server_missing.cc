// Where cpp-httplib was not found when the build was configured.
#include "tools/view/view_server.h"

namespace haustra::view {

Result<std::unique_ptr<ViewServer>> ViewServer::Start(ViewSite, const ViewServerOptions&) {
  return FailedPrecondition("this program was built without cpp-httplib (libcpp-httplib-dev), and cannot serve a page");
}

}  // namespace haustra::view
