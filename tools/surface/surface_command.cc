#include "tools/surface/surface_command.h"

#include <CLI/CLI.hpp>
#include <algorithm>
#include <filesystem>
#include <memory>
#include <optional>
#include <set>
#include <string>
#include <thread>
#include <vector>

#include "capture/codec/image_codec.h"
#include "engine/io/ply_writer.h"
#include "tools/command/common_options.h"
#include "tools/command/configuration_options.h"
#include "tools/command/console.h"
#include "tools/command/number_checks.h"
#include "tools/command/output_folder.h"
#include "tools/evaluate/evaluate_run.h"
#include "tools/exit_codes.h"
#include "tools/export/glb_writer.h"
#include "tools/report/map_model.h"
#include "tools/surface/coverage_picture.h"
#include "tools/surface/coverage_text.h"
#include "tools/surface/coverage_truth.h"
#include "tools/surface/depth_truth.h"
#include "tools/surface/found_depths.h"
#include "tools/surface/map_coverage.h"
#include "tools/surface/map_surface.h"
#include "tools/surface/surface_input.h"
#include "tools/surface/surface_text.h"

namespace haustra {
namespace {

using surface::FoundDepths;
using surface::MapCoverage;
using surface::MapSurface;
using surface::SurfaceMap;

constexpr const char* kSurfaceCommand = "surface";
constexpr FolderContent kSurfaceContent{"a surface",
                                        R"(map_\d{4,}(\.(ply|glb)|_wall\.(png|csv)|(/\d{6,}\.pgm)?)|surface\.json)"};

struct SurfaceArguments {
  std::string run;
  std::string sequence;
  std::string out;
  std::string groundtruth;
  SequenceOptions options;
  DepthOptions depth;
  std::string device = "auto";  // where depth is searched
  surface::SurfaceOptions surface;
  CoverageOptions coverage;
  bool with_depth_maps = false;
  bool overwrite = false;
};

Status WriteMap(const SurfaceArguments& arguments, int map_id, const MapSurface& made, const MapCoverage& coverage) {
  const std::string stem = arguments.out + "/" + report::MapFolderName(map_id);
  StringSink ply;
  HAUSTRA_TRY(WriteMeshPly(ply, made.mesh, map_id));
  HAUSTRA_TRY(WriteFile(stem + ".ply", ply.bytes()));
  HAUSTRA_TRY(WriteFile(stem + ".glb", exporting::MeshGlbBytes(made.mesh, map_id)));
  if (coverage.wall) {
    HAUSTRA_TRY(WriteFile(stem + "_wall.csv", surface::CellsCsv(*coverage.wall)));
    const Image picture = surface::UnrolledPicture(*coverage.wall);
    if (!picture.is_empty()) HAUSTRA_TRY(WritePng(stem + "_wall.png", picture.view()));
  }
  if (!arguments.with_depth_maps) return Status::Ok();
  std::error_code error;
  std::filesystem::create_directories(stem, error);
  if (error) return Unavailable(stem + ": cannot be made: " + error.message());
  for (const surface::KeyframeDepth& each : made.depths) {
    char name[32];
    std::snprintf(name, sizeof(name), "/%06lld.pgm", static_cast<long long>(each.frame_idx));
    HAUSTRA_TRY(WriteFile(stem + name, surface::DepthPgm(each.depth)));
  }
  return Status::Ok();
}

// Whether the truth of the coverage is by the same definitions.
bool IsJudged(const CoverageOptions& options) {
  const CoverageOptions usual;
  return options.max_range_radii == usual.max_range_radii && options.max_slant_deg == usual.max_slant_deg;
}

// Nothing without a ground truth, or of what it does not know for this run.
Result<surface::SurfaceScore> Judge(const SurfaceArguments& arguments, const evaluate::RunOutput& run,
                                    const std::vector<SurfaceMap>& maps, const std::vector<MapSurface>& surfaces,
                                    const std::vector<MapCoverage>& coverages) {
  surface::SurfaceScore score;
  if (arguments.groundtruth.empty()) return score;
  HAUSTRA_ASSIGN(const evaluate::Reference reference, evaluate::ReadReference(arguments.groundtruth, ""));
  const evaluate::Evaluation evaluation = evaluate::EvaluateRun(run, reference, {});
  const std::filesystem::path folder = std::filesystem::path(arguments.groundtruth).parent_path();
  const std::string depth = (folder / "depth").string(), wall = (folder / "seen_wall.csv").string();
  const bool has_wall = std::filesystem::exists(wall);
  // Without either the depth that is missing is named.
  if (!has_wall || std::filesystem::exists(depth)) {
    HAUSTRA_ASSIGN(score.depth, surface::JudgeDepths(maps, surfaces, run, evaluation, reference, depth));
  }
  if (has_wall && !IsJudged(arguments.coverage)) {
    console::Warn(kSurfaceCommand, "coverage is not judged: --max-range and --max-slant are not those of the truth");
  } else if (has_wall) {
    HAUSTRA_ASSIGN(const surface::TrueWall truth, surface::ReadTrueWall(wall));
    score.coverage = surface::JudgeCoverage(maps, coverages, evaluation, truth);
  }
  return score;
}

// Of each map: from the sequence where one is given, else as the run kept them. mask: 255 where pictures show the
// scene; stays empty when there is none.
Result<std::vector<FoundDepths>> FindDepths(const SurfaceArguments& arguments, const evaluate::RunOutput& run,
                                            const std::vector<SurfaceMap>& maps, Image* mask) {
  std::vector<FoundDepths> found;
  if (arguments.sequence.empty()) {
    if (!surface::HasKeptDepths(run, maps)) {
      return FailedPrecondition(
          run.folder + ": the run kept no depth (--set depth.enabled=true); name its sequence with --sequence");
    }
    const std::string mask_path = run.folder + "/mask.png";
    if (std::filesystem::exists(mask_path)) {
      HAUSTRA_ASSIGN(*mask, ReadImage(mask_path, ChannelChoice::kGrey));
      if (mask->width() != maps.front().camera.width_px || mask->height() != maps.front().camera.height_px) {
        return InvalidArgument(mask_path + ": not of the size of this run's frames");
      }
    }
    for (const SurfaceMap& map : maps) {
      Result<FoundDepths> kept = surface::ReadKeptDepths(run, map, arguments.options.first_frame,
                                                         static_cast<int>(arguments.options.every_nth));
      // A map that this run has not seen, but loaded, has none.
      if (kept.code() == StatusCode::kNotFound) {
        kept = FoundDepths{};
        kept->num_without_picture = static_cast<int>(map.keyframes.size());
      }
      HAUSTRA_TRY(kept.status());
      found.push_back(std::move(*kept));
    }
    return found;
  }
  std::set<std::string> names;
  for (const SurfaceMap& map : maps) {
    for (const surface::SurfaceKeyframe& keyframe : map.keyframes) names.insert(keyframe.image_name);
  }
  HAUSTRA_ASSIGN(surface::KeyframePictures pictures,
                 surface::ReadKeyframePictures(run, names, maps.front().camera, arguments.sequence, arguments.options));
  for (const SurfaceMap& map : maps) {
    HAUSTRA_ASSIGN(FoundDepths depths, surface::SearchDepths(map, pictures, arguments.depth, arguments.device,
                                                             arguments.surface.num_threads));
    found.push_back(std::move(depths));
  }
  *mask = std::move(pictures.mask);
  return found;
}

int RunSurface(SurfaceArguments arguments) {
  if (arguments.surface.num_threads == 0) {
    arguments.surface.num_threads = std::max(1, static_cast<int>(std::thread::hardware_concurrency()));
  }
  if (const Status status = OutputFolder::Check(arguments.out, kSurfaceContent, arguments.overwrite); !status.ok()) {
    return console::FailWriting(kSurfaceCommand, status);
  }
  const Result<evaluate::RunOutput> run = evaluate::ReadRunOutput(arguments.run);
  if (!run.ok()) return console::Fail(kSurfaceCommand, run.status());
  const Result<std::vector<SurfaceMap>> maps = surface::ReadSurfaceMaps(*run);
  if (!maps.ok()) return console::Fail(kSurfaceCommand, maps.status());
  Image mask;
  const Result<std::vector<FoundDepths>> found = FindDepths(arguments, *run, *maps, &mask);
  if (!found.ok()) return console::Fail(kSurfaceCommand, found.status());
  std::vector<MapSurface> surfaces;
  std::vector<MapCoverage> coverages;
  for (std::size_t i = 0; i < maps->size(); ++i) {
    Result<MapSurface> made = surface::MakeMapSurface((*maps)[i], (*found)[i], arguments.surface);
    if (!made.ok()) return console::Fail(kSurfaceCommand, made.status());
    surfaces.push_back(std::move(*made));
    Result<MapCoverage> coverage =
        surface::MakeMapCoverage((*maps)[i], surfaces.back(), surface::FramesOf(*run, (*maps)[i].map_id), mask.view(),
                                 arguments.surface.num_threads, arguments.coverage);
    if (!coverage.ok()) return console::Fail(kSurfaceCommand, coverage.status());
    coverages.push_back(std::move(*coverage));
  }
  const Result<surface::SurfaceScore> score = Judge(arguments, *run, *maps, surfaces, coverages);
  if (!score.ok()) return console::Fail(kSurfaceCommand, score.status());

  Result<OutputFolder> output = OutputFolder::Create(arguments.out, kSurfaceContent, arguments.overwrite);
  if (!output.ok()) return console::FailWriting(kSurfaceCommand, output.status());
  for (std::size_t i = 0; i < maps->size(); ++i) {
    const int map_id = (*maps)[i].map_id;
    if (const Status status = WriteMap(arguments, map_id, surfaces[i], coverages[i]); !status.ok()) {
      return console::FailWriting(kSurfaceCommand, status);
    }
    console::Print("%s", surface::ToText(map_id, surfaces[i]).c_str());
    console::Print("%s", surface::ToText(map_id, coverages[i]).c_str());
  }
  const Status status = WriteFile(arguments.out + "/surface.json", surface::ToJson(*maps, surfaces, coverages, *score));
  if (!status.ok()) return console::FailWriting(kSurfaceCommand, status);
  output->Commit();
  if (score->depth) console::Print("%s", surface::ToText(*score->depth).c_str());
  if (score->coverage) console::Print("%s", surface::ToText(*score->coverage).c_str());
  if (!arguments.groundtruth.empty() && !score->depth && !score->coverage) {
    console::Warn(kSurfaceCommand, "no map could be aligned to %s: nothing is judged", arguments.groundtruth.c_str());
  }
  console::Print("%s: a mesh for each map, as .ply and .glb; maps have frames and scales of their own\n",
                 arguments.out.c_str());
  return kExitOk;
}

}  // namespace

void AddSurfaceCommand(CLI::App& app, std::function<int()>& action) {
  const auto arguments = std::make_shared<SurfaceArguments>();
  CLI::App* command = app.add_subcommand("surface", "Make the surface of the wall from a run");
  command->add_option("run", arguments->run, "Output folder of haustra run")->required();
  command->add_option(
      "--sequence", arguments->sequence,
      "The sequence of the run, folder or video: depth is searched in it. Without one the depth that the "
      "run kept is taken (depth.enabled)");
  command->add_option("--out", arguments->out, "Folder for the meshes: map_NNNN.ply and map_NNNN.glb for each map")
      ->required();
  command->add_option("--first-frame", arguments->options.first_frame, "As in the run")
      ->check(WholeNumber<std::uint32_t>());
  command->add_option("--every-nth", arguments->options.every_nth, "As in the run: it used only every n-th frame")
      ->check(CLI::Range(1u, 1000u))
      ->capture_default_str();
  AddDeinterlaceOption(*command, arguments->options.deinterlace);
  command->add_option("--groundtruth", arguments->groundtruth,
                      "True poses of a rendered sequence. Says how good the depth is, where depth/ lies beside them "
                      "(haustra render --depth), and the coverage, where seen_wall.csv does (--seen-wall)");
  command->add_flag("--depth-maps", arguments->with_depth_maps,
                    "Write the depth of each keyframe, too: map_NNNN/NNNNNN.pgm, 16-bit inverse range");
  command
      ->add_option("--voxel", arguments->surface.voxel_share,
                   "Side of a voxel, share of the median depth of the map, 0.002 to 0.2")
      ->check(CLI::Range(0.002, 0.2))
      ->capture_default_str();
  command
      ->add_option("--max-blocks", arguments->surface.max_blocks,
                   "Blocks of 8x8x8 voxels of a map, 3 kB each. When they are used up, what comes later is left out")
      ->check(CLI::Range(1, 1 << 20))
      ->capture_default_str();
  command
      ->add_option("--max-range", arguments->coverage.max_range_radii,
                   "From farther away the wall is not seen well, mean radii of the lumen, 0.5 to 6")
      ->check(CLI::Range(0.5, 6.0))
      ->capture_default_str();
  command
      ->add_option("--max-slant", arguments->coverage.max_slant_deg,
                   "Nor at more of a slant, degrees from the wall's normal, 10 to 89")
      ->check(CLI::Range(10.0, 89.0))
      ->capture_default_str();
  command
      ->add_option("--segment", arguments->coverage.segment_radii,
                   "Length of the segments that coverage is given for, radii, 0.5 to 100")
      ->check(CLI::Range(0.5, 100.0))
      ->capture_default_str();
  command
      ->add_option("--threads", arguments->surface.num_threads,
                   "Threads; 0: all cores. The result does not depend on it")
      ->check(CLI::Range(0, 256))
      ->default_val(0);
  AddDeviceOption(*command, arguments->device);
  AddOverwriteFlag(*command, arguments->overwrite);
  command->callback([arguments, &action] { action = [arguments] { return RunSurface(*arguments); }; });
}

}  // namespace haustra
