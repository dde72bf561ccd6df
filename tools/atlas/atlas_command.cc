#include "tools/atlas/atlas_command.h"

#include <memory>
#include <string>

#include <CLI/App.hpp>

#include "capture/files/whole_file.h"
#include "engine/io/atlas_reader.h"
#include "tools/atlas/atlas_text.h"
#include "tools/command/console.h"
#include "tools/exit_codes.h"

namespace haustra {
namespace {

constexpr const char* kAtlasCommand = "atlas";

int Info(const std::string& path) {
  const Result<std::vector<std::uint8_t>> bytes = ReadWholeFile(path);
  if (!bytes.ok()) return console::Fail(kAtlasCommand, bytes.status());
  const Result<SavedAtlas> atlas = ReadAtlas(*bytes);
  if (!atlas.ok()) {
    return console::Fail(kAtlasCommand, Status(atlas.code(), path + ": " + atlas.status().message()));
  }
  console::Print("%s\n%s", path.c_str(), AtlasText(*atlas, bytes->size()).c_str());
  return kExitOk;
}

}  // namespace

void AddAtlasCommand(CLI::App& app, std::function<int()>& action) {
  CLI::App* command = app.add_subcommand("atlas", "Look into atlas files (haustra run --save-atlas)");
  command->require_subcommand(1);
  const auto path = std::make_shared<std::string>();
  CLI::App* info = command->add_subcommand("info", "Verify a file and print what it holds");
  info->add_option("file", *path, "Atlas file")->required();
  info->callback([path, &action] { action = [path] { return Info(*path); }; });
}

}  // namespace haustra
