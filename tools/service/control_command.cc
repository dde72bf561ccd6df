#include "tools/service/control_command.h"

#include <memory>
#include <string>
#include <vector>

#include "platform/control/control_client.h"
#include "tools/command/console.h"
#include "tools/command/number_checks.h"
#include "tools/exit_codes.h"
#include "tools/service/runtime_folder.h"

namespace haustra {
namespace {

constexpr const char* kControlCommand = "control";

struct ControlArguments {
  std::string request;
  std::vector<std::string> words;  // that follow it
  std::string folder = kRuntimeFolder;
  double timeout_s = 30.0;
};

// As CLI11 describes a set, so that help, manual and completion have the words. Any request passes: it may be given as
// one word, and what is wrong with it ParseControlRequest says.
CLI::Validator RequestWords() {
  std::string words;
  for (const std::string& word : ControlWords()) words += (words.empty() ? "" : ",") + word;
  return CLI::Validator([](const std::string&) { return std::string(); }, "{" + words + "}");
}

int FailControl(const Status& status) {
  switch (status.code()) {
    case StatusCode::kInvalidArgument: return console::Fail(kControlCommand, status, kExitUsage);
    case StatusCode::kFailedPrecondition:
      return console::Fail(kControlCommand, status, kExitNotMet);  // the daemon said no
    default: return console::Fail(kControlCommand, status, kExitUnavailable);
  }
}

int Control(const ControlArguments& arguments) {
  std::string text = arguments.request;
  for (const std::string& word : arguments.words) text += " " + word;
  // Here rather than there: a typing error needs no daemon.
  const Result<ControlRequest> request = ParseControlRequest(text);
  if (!request.ok()) return FailControl(request.status());
  Result<ControlClient> client = ControlClient::Connect(
      arguments.folder + "/" + std::string(OnlyLooks(request->command) ? kStatusSocket : kControlSocket));
  if (!client.ok()) return FailControl(client.status());
  const Result<std::string> reply =
      client->Ask(*request, std::chrono::milliseconds(static_cast<std::int64_t>(1000 * arguments.timeout_s)));
  if (!reply.ok()) return FailControl(reply.status());
  console::Print("%s", reply->c_str());
  return kExitOk;
}

}  // namespace

void AddControlCommand(CLI::App& app, std::function<int()>& action) {
  const auto arguments = std::make_shared<ControlArguments>();
  CLI::App* command = app.add_subcommand("control", "One request to a running haustrad");
  command->add_option("request", arguments->request, ControlForms())->check(RequestWords())->required();
  command->add_option("arguments", arguments->words, "What the request takes")->type_name("WORD");
  command->add_option("--folder", arguments->folder, "Runtime folder of the daemon")->capture_default_str();
  command->add_option("--timeout", arguments->timeout_s, "Seconds to wait for the answer")
      ->check(NumberBetween(0.1, 3600.0))
      ->capture_default_str();
  command->callback([arguments, &action] { action = [arguments] { return Control(*arguments); }; });
}

}  // namespace haustra
