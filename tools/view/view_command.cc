#include "tools/view/view_command.h"
#include "tools/command/number_checks.h"

#include <unistd.h>

#include <CLI/CLI.hpp>
#include <cstdio>
#include <memory>
#include <string>
#include <utility>

#include "tools/command/console.h"
#include "tools/service/runtime_folder.h"
#include "tools/view/live_stream.h"
#include "tools/view/live_wall.h"
#include "tools/view/mark_orders.h"
#include "tools/view/page_site.h"
#include "tools/view/request_gate.h"
#include "tools/view/run_site.h"
#include "tools/view/view_server.h"

namespace haustra {
namespace {

constexpr const char* kViewCommand = "view";

struct ViewArguments {
  view::RunSiteRequest request;  // without a run: a running haustrad
  std::string folder = kRuntimeFolder;
  int port = 0;
  std::string token_file;
  bool may_mark = false;
};

view::ViewSite MakeLiveSite(const std::string& folder, bool may_mark) {
  view::ViewSite site = view::MakePageSite(may_mark ? view::PageKind::kLiveWithMarking : view::PageKind::kLive);
  if (may_mark) {
    site.change = [folder](std::string_view request) { return view::PassMarkOrder(folder, request); };
  }
  const auto wall = std::make_shared<const view::LiveWall>(folder);
  site.open_stream = [folder, wall] { return std::make_unique<view::LiveStream>(folder, wall); };
  site.find = [wall](std::string_view name) {
    return name == "wall.ply" ? wall->newest()->mesh : std::shared_ptr<const view::ViewResource>();
  };
  return site;
}

int View(const ViewArguments& arguments) {
  view::ViewServerOptions options;
  options.port = arguments.port;
  Result<std::string> token = arguments.token_file.empty() ? view::MakeToken() : view::ReadToken(arguments.token_file);
  if (!token.ok()) return console::Fail(kViewCommand, token.status());
  options.token = std::move(*token);
  const bool is_live = arguments.request.run.empty();
  Result<view::ViewSite> site =
      is_live ? MakeLiveSite(arguments.folder, arguments.may_mark) : view::MakeRunSite(arguments.request);
  if (!site.ok()) return console::Fail(kViewCommand, site.status());
  const Result<std::unique_ptr<view::ViewServer>> server = view::ViewServer::Start(std::move(*site), options);
  if (!server.ok()) return console::Fail(kViewCommand, server.status());
  console::Print("%s\n", (*server)->address().c_str());
  std::fflush(stdout);
  console::Note(kViewCommand, "open this address in a browser of this machine; Ctrl-C ends it");
  // Nothing is written: a stop may end it here and now (stop_signal.h).
  while (true) ::pause();
}

}  // namespace

void AddViewCommand(CLI::App& app, std::function<int()>& action) {
  const auto arguments = std::make_shared<ViewArguments>();
  CLI::App* command =
      app.add_subcommand("view", "Show a running haustrad or a finished run in a browser of this machine");
  CLI::Option* run = command->add_option("out", arguments->request.run,
                                         "Output folder of haustra run (default: a running haustrad is shown)");
  command->add_option("--folder", arguments->folder, "Runtime folder of the daemon")
      ->excludes(run)
      ->capture_default_str();
  command
      ->add_option("--surface", arguments->request.surface,
                   "Output folder of haustra surface for this run (default: OUT/surface, where it is there)")
      ->needs(run);
  command->add_option("--port", arguments->port, "Port on 127.0.0.1; 0: a free one")
      ->transform(WholeNumberBetween(0, 65535))
      ->capture_default_str();
  command->add_option("--token-file", arguments->token_file,
                      "Secret part of the address: 32 to 128 letters and digits in a file that only its owner may read "
                      "(default: 128 new random bits)");
  command
      ->add_flag(
          "--marking", arguments->may_mark,
          "Marks can be set and removed on the page. Whoever has the address can do so, with this user's right to "
          "control haustrad")
      ->excludes(run);
  command->callback([arguments, &action] { action = [arguments] { return View(*arguments); }; });
}

}  // namespace haustra
