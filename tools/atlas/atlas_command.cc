#include "tools/atlas/atlas_command.h"

#include <cstdio>
#include <memory>
#include <string>

#include <CLI/App.hpp>

#include "engine/io/atlas_reader.h"
#include "platform/atlas_file.h"
#include "tools/atlas/atlas_text.h"
#include "tools/exit_codes.h"

namespace haustra {
namespace {

int Info(const std::string& path) {
  const Result<std::vector<std::uint8_t>> bytes = ReadAtlasFileBytes(path);
  if (!bytes.ok()) {
    std::fprintf(stderr, "haustra atlas: %s\n", bytes.status().ToString().c_str());
    return bytes.code() == StatusCode::kUnavailable ? kExitIo : ExitCodeFor(bytes.code());
  }
  const Result<SavedAtlas> atlas = ReadAtlas(*bytes);
  if (!atlas.ok()) {
    std::fprintf(stderr, "haustra atlas: %s: %s\n", path.c_str(), atlas.status().ToString().c_str());
    return ExitCodeFor(atlas.code());
  }
  std::printf("%s\n%s", path.c_str(), AtlasText(*atlas, bytes->size()).c_str());
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
