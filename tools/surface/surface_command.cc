#include "tools/surface/surface_command.h"

#include <CLI/CLI.hpp>
#include <filesystem>
#include <memory>
#include <string>

#include "tools/command/common_options.h"
#include "tools/command/configuration_options.h"
#include "tools/command/console.h"
#include "tools/command/number_checks.h"
#include "tools/command/output_folder.h"
#include "tools/evaluate/evaluate_run.h"
#include "tools/exit_codes.h"
#include "tools/surface/coverage_text.h"
#include "tools/surface/coverage_truth.h"
#include "tools/surface/depth_truth.h"
#include "tools/surface/run_surface.h"
#include "tools/surface/surface_content.h"
#include "tools/surface/surface_text.h"

namespace haustra {
namespace {

using surface::RunSurface;

constexpr const char* kSurfaceCommand = "surface";

struct SurfaceArguments {
  std::string run;
  std::string groundtruth;
  surface::SurfaceRequest request;
  surface::SurfaceOutput output;
};

// Whether the truth of the coverage is by the same definitions.
bool IsJudged(const CoverageOptions& options) {
  const CoverageOptions usual;
  return options.max_range_radii == usual.max_range_radii && options.max_slant_deg == usual.max_slant_deg;
}

// Before the surface is made, which may take minutes.
Status CheckTruth(const std::string& groundtruth) {
  if (groundtruth.empty()) return Status::Ok();
  const std::filesystem::path folder = std::filesystem::path(groundtruth).parent_path();
  if (!std::filesystem::exists(groundtruth)) return NotFound(groundtruth + ": no such file");
  if (std::filesystem::is_directory(groundtruth)) return DataLoss(groundtruth + ": is a folder, not a file");
  if (std::filesystem::exists(folder / "depth") || std::filesystem::exists(folder / "seen_wall.csv"))
    return Status::Ok();
  return NotFound(groundtruth +
                  ": neither depth/ nor seen_wall.csv lies beside it (haustra render --depth, --seen-wall)");
}

// Nothing without a ground truth, or of what it does not know for this run.
Result<surface::SurfaceScore> Judge(const SurfaceArguments& arguments, const evaluate::RunOutput& run,
                                    const RunSurface& made) {
  surface::SurfaceScore score;
  if (arguments.groundtruth.empty()) return score;
  HAUSTRA_ASSIGN(const evaluate::Reference reference, evaluate::ReadReference(arguments.groundtruth, ""));
  const evaluate::Evaluation evaluation = evaluate::EvaluateRun(run, reference, {});
  const std::filesystem::path folder = std::filesystem::path(arguments.groundtruth).parent_path();
  const std::string depth = (folder / "depth").string(), wall = (folder / "seen_wall.csv").string();
  const bool has_wall = std::filesystem::exists(wall);
  if (std::filesystem::exists(depth)) {
    HAUSTRA_ASSIGN(score.depth, surface::JudgeDepths(made.maps, made.surfaces, run, evaluation, reference, depth));
  }
  if (has_wall && !IsJudged(arguments.request.coverage)) {
    console::Warn(kSurfaceCommand, "coverage is not judged: --max-range and --max-slant are not those of the truth");
  } else if (has_wall) {
    HAUSTRA_ASSIGN(const surface::TrueWall truth, surface::ReadTrueWall(wall));
    score.coverage = surface::JudgeCoverage(made.maps, made.coverages, evaluation, truth);
  }
  return score;
}

int Surface(const SurfaceArguments& arguments) {
  const surface::SurfaceOutput& output = arguments.output;
  if (const Status status = OutputFolder::Check(output.folder, surface::kSurfaceContent, output.overwrite);
      !status.ok()) {
    return console::FailWriting(kSurfaceCommand, status);
  }
  const Result<evaluate::RunOutput> run = evaluate::ReadRunOutput(arguments.run);
  if (!run.ok()) return console::Fail(kSurfaceCommand, run.status());
  if (const Status status = CheckTruth(arguments.groundtruth); !status.ok()) {
    return console::Fail(kSurfaceCommand, status);
  }
  const Result<RunSurface> made = surface::MakeRunSurface(*run, arguments.request);
  if (!made.ok()) return console::Fail(kSurfaceCommand, made.status());
  if (const std::string missing = surface::WhatIsMissing(*made); !missing.empty()) {
    return console::Fail(kSurfaceCommand, FailedPrecondition(arguments.run + ": there is no surface: " + missing));
  }
  const Result<surface::SurfaceScore> score = Judge(arguments, *run, *made);
  if (!score.ok()) return console::Fail(kSurfaceCommand, score.status());
  if (const Status status = surface::WriteRunSurface(output, *made, *score); !status.ok()) {
    return console::FailWriting(kSurfaceCommand, status);
  }
  for (std::size_t i = 0; i < made->maps.size(); ++i) {
    const int map_id = made->maps[i].map_id;
    console::Print("%s", surface::ToText(map_id, made->surfaces[i]).c_str());
    console::Print("%s", surface::ToText(map_id, made->coverages[i]).c_str());
  }
  if (score->depth) console::Print("%s", surface::ToText(*score->depth).c_str());
  if (score->coverage) console::Print("%s", surface::ToText(*score->coverage).c_str());
  if (!arguments.groundtruth.empty() && !score->depth && !score->coverage) {
    console::Warn(kSurfaceCommand, "nothing is judged by %s: no map lies along it that has depth or a lumen to judge",
                  arguments.groundtruth.c_str());
  }
  console::Tell("%s: a mesh for each map, as .ply and .glb; maps have frames and scales of their own\n",
                output.folder.c_str());
  return kExitOk;
}

}  // namespace

void AddSurfaceCommand(CLI::App& app, std::function<int()>& action) {
  const auto arguments = std::make_shared<SurfaceArguments>();
  surface::SurfaceRequest& request = arguments->request;
  surface::SurfaceOutput& output = arguments->output;
  request.device = "auto";
  CLI::App* command = app.add_subcommand("surface", "Make the surface of the wall from a run");
  command->add_option("run", arguments->run, "Output folder of haustra run")->required();
  CLI::Option* sequence = command->add_option(
      "--sequence", request.sequence,
      "The sequence of the run, folder or video: depth is searched in it. Without one the depth that the "
      "run kept is taken (depth.enabled)");
  command->add_option("--out", output.folder, "Folder for the meshes: map_NNNN.ply and map_NNNN.glb for each map")
      ->required();
  AddDeinterlaceOption(*command, request.deinterlace);
  command->add_option("--groundtruth", arguments->groundtruth,
                      "True poses of a rendered sequence. Says how good the depth is, where depth/ lies beside them "
                      "(haustra render --depth), and the coverage, where seen_wall.csv does (--seen-wall)");
  command->add_flag("--depth-maps", output.with_depth_maps,
                    "Write the depth of each keyframe, too: map_NNNN/NNNNNN.pgm, 16-bit inverse range");
  command
      ->add_option("--voxel", request.surface.voxel_share,
                   "Side of a voxel, share of the median depth of the map, 0.002 to 0.2")
      ->check(NumberBetween(0.002, 0.2))
      ->capture_default_str();
  command
      ->add_option("--max-blocks", request.surface.max_blocks,
                   "Blocks of 8x8x8 voxels of a map, 4 kB each. When they are used up, what comes later is left out")
      ->transform(WholeNumberBetween(1, 1 << 20))
      ->capture_default_str();
  command
      ->add_option("--max-range", request.coverage.max_range_radii,
                   "From farther away the wall is not seen well, mean radii of the lumen, 0.5 to 6")
      ->check(NumberBetween(0.5, 6.0))
      ->capture_default_str();
  command
      ->add_option("--max-slant", request.coverage.max_slant_deg,
                   "Nor at more of a slant, degrees from the wall's normal, 10 to 89")
      ->check(NumberBetween(10.0, 89.0))
      ->capture_default_str();
  command
      ->add_option("--segment", request.coverage.segment_radii,
                   "Length of the segments that coverage is given for, radii, 0.5 to 100")
      ->check(NumberBetween(0.5, 100.0))
      ->capture_default_str();
  command
      ->add_option("--threads", request.surface.num_threads, "Threads; 0: all cores. The result does not depend on it")
      ->transform(WholeNumberBetween(0, 256))
      ->default_val(0);
  AddDeviceOption(*command, request.device);
  // Without one no picture is read and nothing is searched.
  for (const char* option : {"--deinterlace", "--device"}) command->get_option(option)->needs(sequence);
  AddOverwriteFlag(*command, output.overwrite);
  command->callback([arguments, &action] { action = [arguments] { return Surface(*arguments); }; });
}

}  // namespace haustra
