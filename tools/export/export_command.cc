#include "tools/export/export_command.h"

#include <CLI/CLI.hpp>
#include <atomic>
#include <filesystem>
#include <memory>
#include <string>
#include <vector>

#include "tools/command/common_options.h"
#include "tools/command/console.h"
#include "tools/command/output_folder.h"
#include "tools/command/stop_signal.h"
#include "tools/evaluate/text_input.h"
#include "tools/exit_codes.h"
#include "tools/export/exported_map.h"
#include "tools/export/glb_writer.h"
#include "tools/export/trajectory_formats.h"
#include "tools/report/map_model.h"

namespace haustra {
namespace {

namespace fs = std::filesystem;
using exporting::ExportedMap;

constexpr const char* kExportCommand = "export";
constexpr FolderContent kExportContent{
    "an export",
    R"(map_\d{4,}(\.(tum|txt|csv|ply|glb)|_times\.txt|(/(cameras|images|points3D)\.txt)?))",
    {},
    nullptr,
    "export.txt"};

struct ExportArguments {
  std::string run;
  std::string format;
  std::string out;
  bool overwrite = false;
};

Status Copy(const std::string& from, const std::string& to) {
  HAUSTRA_ASSIGN(const std::string bytes, evaluate::ReadText(from));
  return WriteFile(to, bytes);
}

// `stem`: path of the map's file without its ending.
Status WriteMap(const ExportArguments& arguments, const ExportedMap& map, const std::string& stem) {
  const std::string& format = arguments.format;
  const std::string exported = arguments.run + "/maps/" + report::MapFolderName(map.map_id);
  if (format == "tum") return WriteFile(stem + ".tum", TumText(map));
  if (format == "csv") return WriteFile(stem + ".csv", CsvText(map));
  if (format == "glb") return WriteFile(stem + ".glb", GlbBytes(map));
  if (format == "ply") return Copy(exported + ".ply", stem + ".ply");
  if (format == "kitti") {
    HAUSTRA_TRY(WriteFile(stem + ".txt", KittiText(map)));
    return WriteFile(stem + "_times.txt", KittiTimesText(map));
  }
  std::error_code error;
  fs::create_directories(stem, error);
  if (error) return Unavailable(stem + ": cannot be made: " + error.message());
  for (const char* name : {"/cameras.txt", "/images.txt", "/points3D.txt"}) {
    HAUSTRA_TRY(Copy(exported + name, stem + name));
  }
  return Status::Ok();
}

int Export(const ExportArguments& arguments) {
  if (const Status status = OutputFolder::Check(arguments.out, kExportContent, arguments.overwrite); !status.ok()) {
    return console::FailWriting(kExportCommand, status);
  }
  const Result<std::vector<ExportedMap>> maps = exporting::ReadExportedMaps(arguments.run);
  if (!maps.ok()) return console::Fail(kExportCommand, maps.status());
  Result<OutputFolder> output = OutputFolder::Create(arguments.out, kExportContent, arguments.overwrite);
  if (!output.ok()) return console::FailWriting(kExportCommand, output.status());
  const std::atomic<bool>& stop_requested = CatchStopSignals();
  for (const ExportedMap& map : *maps) {
    const Status status = stop_requested
                              ? Status(StatusCode::kCancelled, "stopped")
                              : WriteMap(arguments, map, arguments.out + "/" + report::MapFolderName(map.map_id));
    if (!status.ok()) {
      output->Discard();
      return console::FailWriting(kExportCommand, status);
    }
    console::Tell("map %d: %zu frames, %zu points\n", map.map_id, map.frames.size(), map.points.size());
  }
  output->Commit();
  console::Tell("%s: %s, a file for each map; maps have frames and scales of their own\n", arguments.out.c_str(),
                arguments.format.c_str());
  return kExitOk;
}

}  // namespace

void AddExportCommand(CLI::App& app, std::function<int()>& action) {
  const auto arguments = std::make_shared<ExportArguments>();
  CLI::App* command = app.add_subcommand("export", "Write the maps of a run for other programs");
  command->add_option("run", arguments->run, "Output folder of haustra run")->required();
  command
      ->add_option(
          "--format", arguments->format,
          "tum: trajectory with times; kitti: trajectory as matrices, times in a file beside it; csv: trajectory "
          "with frame numbers; ply: points; glb: points and camera path (glTF 2.0); colmap: text model, its "
          "pictures named as in the sequence, those of a recording frame_NNNNNN.png, counted from 0")
      ->check(CLI::IsMember({"tum", "kitti", "colmap", "ply", "glb", "csv"}))
      ->required();
  command->add_option("--out", arguments->out, "Folder for the files: map_NNNN.* for each map")->required();
  AddOverwriteFlag(*command, arguments->overwrite);
  command->callback([arguments, &action] { action = [arguments] { return Export(*arguments); }; });
}

}  // namespace haustra
