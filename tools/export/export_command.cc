#include "tools/export/export_command.h"

#include <CLI/CLI.hpp>
#include <atomic>
#include <filesystem>
#include <memory>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

#include "capture/files/whole_file.h"
#include "engine/io/ply_writer.h"
#include "tools/command/common_options.h"
#include "tools/command/console.h"
#include "tools/command/output_folder.h"
#include "tools/command/stop_signal.h"
#include "tools/exit_codes.h"
#include "tools/export/exported_map.h"
#include "tools/export/glb_writer.h"
#include "tools/export/trajectory_formats.h"
#include "tools/run/map_name.h"

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

struct ExportedFile {
  std::string ending;  // of the map's name
  std::string bytes;
};

// Whether a file of the run has the points of its map, all of them: it is given on as it is.
Status CheckPly(const std::string& path, const std::string& bytes, std::size_t num_points) {
  constexpr std::string_view kHeaderEnd = "\nend_header\n";
  const std::size_t end = bytes.find(kHeaderEnd);
  if (!bytes.starts_with("ply\n") || end == std::string::npos) return DataLoss(path + ": not a PLY file, or cut");
  const std::string vertices = "\nelement vertex " + std::to_string(num_points) + "\n";
  if (bytes.find(vertices) > end) {
    return DataLoss(path + ": does not say that it has the " + std::to_string(num_points) + " points of points3D.txt");
  }
  const std::size_t held = bytes.size() - end - kHeaderEnd.size(), wanted = num_points * kPlyPointBytes;
  if (held == wanted) return Status::Ok();
  return DataLoss(path + ": " + std::to_string(held) + " bytes of points, " + std::to_string(num_points) +
                  " points are " + std::to_string(wanted));
}

// What becomes of a map. Errors are of files of the run.
Result<std::vector<ExportedFile>> FilesOf(const ExportArguments& arguments, const ExportedMap& map) {
  const std::string& format = arguments.format;
  if (format == "tum") return std::vector<ExportedFile>{{".tum", TumText(map)}};
  if (format == "csv") return std::vector<ExportedFile>{{".csv", CsvText(map)}};
  if (format == "glb") return std::vector<ExportedFile>{{".glb", GlbBytes(map)}};
  if (format == "kitti")
    return std::vector<ExportedFile>{{".txt", KittiText(map)}, {"_times.txt", KittiTimesText(map)}};
  const std::string exported = arguments.run + "/maps/" + MapName(map.map_id);
  const std::vector<const char*> endings =
      format == "ply" ? std::vector{".ply"} : std::vector{"/cameras.txt", "/images.txt", "/points3D.txt"};
  std::vector<ExportedFile> files;
  for (const char* ending : endings) {
    HAUSTRA_ASSIGN(std::string bytes, ReadWholeText(exported + ending));
    if (format == "ply") HAUSTRA_TRY(CheckPly(exported + ending, bytes, map.points.size()));
    files.push_back({ending, std::move(bytes)});
  }
  return files;
}

// `stem`: path of the map's files without their ending.
Status WriteFiles(const std::vector<ExportedFile>& files, const std::string& stem) {
  for (const ExportedFile& file : files) {
    const std::string path = stem + file.ending;
    std::error_code error;
    fs::create_directories(fs::path(path).parent_path(), error);
    if (error) return Unavailable(path + ": its folder cannot be made: " + error.message());
    HAUSTRA_TRY(WriteFile(path, file.bytes));
  }
  return Status::Ok();
}

int Export(const ExportArguments& arguments) {
  if (const Status status = OutputFolder::Check(arguments.out, kExportContent, arguments.overwrite); !status.ok()) {
    return console::FailWriting(kExportCommand, status);
  }
  const Result<exporting::ExportedMaps> exported = exporting::ReadExportedMaps(arguments.run);
  if (!exported.ok()) return console::Fail(kExportCommand, exported.status());
  for (const std::string& warning : exported->warnings) console::Warn(kExportCommand, "%s", warning.c_str());
  Result<OutputFolder> output = OutputFolder::Create(arguments.out, kExportContent, arguments.overwrite);
  if (!output.ok()) return console::FailWriting(kExportCommand, output.status());
  const std::atomic<bool>& stop_requested = CatchStopSignals();
  for (const ExportedMap& map : exported->maps) {
    const Result<std::vector<ExportedFile>> files =
        stop_requested ? Status(StatusCode::kCancelled, "stopped") : FilesOf(arguments, map);
    const Status written = files.ok() ? WriteFiles(*files, arguments.out + "/" + MapName(map.map_id)) : Status::Ok();
    if (!files.ok() || !written.ok()) {
      output->Discard();
      return files.ok() ? console::FailWriting(kExportCommand, written) : console::Fail(kExportCommand, files.status());
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
