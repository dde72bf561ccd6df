#include "tools/surface/run_surface.h"

#include <algorithm>
#include <cstdio>
#include <filesystem>
#include <set>
#include <system_error>
#include <thread>
#include <utility>

#include "capture/codec/image_codec.h"
#include "engine/io/ply_writer.h"
#include "tools/export/glb_writer.h"
#include "tools/run/map_name.h"
#include "tools/surface/coverage_picture.h"
#include "tools/surface/coverage_text.h"
#include "tools/surface/found_depths.h"
#include "tools/surface/keyframe_pictures.h"
#include "tools/surface/surface_content.h"

namespace haustra::surface {
namespace {

// Of each map: from the sequence where one is given, else as the run kept them. mask: 255 where pictures show the
// scene; stays empty when there is none.
Result<std::vector<FoundDepths>> FindDepths(const SurfaceRequest& request, const evaluate::RunOutput& run,
                                            const std::vector<SurfaceMap>& maps, int num_threads, Image* mask) {
  std::vector<FoundDepths> found;
  if (request.sequence.empty()) {
    if (!HasKeptDepths(run, maps)) {
      return FailedPrecondition(
          run.folder + ": the run kept no depth (--set depth.enabled=true); name its sequence with --sequence");
    }
    HAUSTRA_ASSIGN(*mask, ReadMaskOfRun(run, maps.front().camera));
    for (const SurfaceMap& map : maps) {
      Result<FoundDepths> kept = ReadKeptDepths(run, map);
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
    for (const SurfaceKeyframe& keyframe : map.keyframes) names.insert(keyframe.image_name);
  }
  HAUSTRA_ASSIGN(KeyframePictures pictures,
                 ReadKeyframePictures(run, names, maps.front().camera, request.sequence, request.deinterlace));
  for (const SurfaceMap& map : maps) {
    HAUSTRA_ASSIGN(FoundDepths depths, SearchDepths(map, pictures, request.depth, request.device, num_threads));
    found.push_back(std::move(depths));
  }
  *mask = std::move(pictures.mask);
  return found;
}

std::string WhatIsMissing(const SurfaceMap& map, const MapSurface& surface) {
  if (map.depth_mu <= 0.0) return "it has no points";
  if (!surface.depths.empty()) {
    return "its " + std::to_string(surface.depths.size()) + " keyframes with depth agree on no wall";
  }
  return "none of its " + std::to_string(map.keyframes.size()) +
         " keyframes has a depth: " + std::to_string(surface.num_without_picture) + " without a picture, " +
         std::to_string(surface.num_without_depth) + " with too few points that another one sees";
}

Status WriteMap(const SurfaceOutput& output, int map_id, const MapSurface& made, const MapCoverage& coverage) {
  const std::string stem = output.folder + "/" + MapName(map_id);
  StringSink ply;
  HAUSTRA_TRY(WriteMeshPly(ply, made.mesh, map_id));
  HAUSTRA_TRY(WriteFile(stem + ".ply", ply.bytes()));
  HAUSTRA_TRY(WriteFile(stem + ".glb", exporting::MeshGlbBytes(made.mesh, map_id)));
  if (coverage.wall) {
    HAUSTRA_TRY(WriteFile(stem + "_wall.csv", CellsCsv(*coverage.wall)));
    const Image picture = UnrolledPicture(*coverage.wall);
    if (!picture.is_empty()) HAUSTRA_TRY(WritePng(stem + "_wall.png", picture.view()));
  }
  if (!output.with_depth_maps) return Status::Ok();
  std::error_code error;
  std::filesystem::create_directories(stem, error);
  if (error) return Unavailable(stem + ": cannot be made: " + error.message());
  for (const KeyframeDepth& each : made.depths) {
    char name[32];
    std::snprintf(name, sizeof(name), "/%06lld.pgm", static_cast<long long>(each.frame_idx));
    HAUSTRA_TRY(WriteFile(stem + name, DepthPgm(each.depth)));
  }
  return Status::Ok();
}

// surface.json comes last: a surface that has it is whole.
Status WriteFiles(const SurfaceOutput& output, const RunSurface& made, const SurfaceScore& score) {
  for (std::size_t i = 0; i < made.maps.size(); ++i) {
    HAUSTRA_TRY(WriteMap(output, made.maps[i].map_id, made.surfaces[i], made.coverages[i]));
  }
  return WriteFile(output.folder + "/surface.json", ToJson(made.maps, made.surfaces, made.coverages, score));
}

}  // namespace

Result<RunSurface> MakeRunSurface(const evaluate::RunOutput& run, const SurfaceRequest& request) {
  SurfaceOptions options = request.surface;
  if (options.num_threads == 0) options.num_threads = static_cast<int>(std::thread::hardware_concurrency());
  RunSurface made;
  HAUSTRA_ASSIGN(made.maps, ReadSurfaceMaps(run));
  Image mask;
  HAUSTRA_ASSIGN(const std::vector<FoundDepths> found, FindDepths(request, run, made.maps, options.num_threads, &mask));
  for (std::size_t i = 0; i < made.maps.size(); ++i) {
    HAUSTRA_ASSIGN(MapSurface surface, MakeMapSurface(made.maps[i], found[i], options));
    HAUSTRA_ASSIGN(MapCoverage coverage, MakeMapCoverage(made.maps[i], surface, FramesOf(run, made.maps[i].map_id),
                                                         mask.view(), options.stop, request.coverage));
    made.surfaces.push_back(std::move(surface));
    made.coverages.push_back(std::move(coverage));
  }
  return made;
}

std::string WhatIsMissing(const RunSurface& made) {
  std::string text;
  for (std::size_t i = 0; i < made.maps.size(); ++i) {
    if (!made.surfaces[i].mesh.triangles.empty()) return {};
    text += (i > 0 ? "; map " : "map ") + std::to_string(made.maps[i].map_id) + ": " +
            WhatIsMissing(made.maps[i], made.surfaces[i]);
  }
  return text;
}

Status WriteRunSurface(const SurfaceOutput& output, const RunSurface& made, const SurfaceScore& score) {
  HAUSTRA_ASSIGN(OutputFolder folder, OutputFolder::Create(output.folder, kSurfaceContent, output.overwrite));
  const Status written = WriteFiles(output, made, score);
  if (written.ok()) {
    folder.Commit();
  } else {
    folder.Discard();
  }
  return written;
}

}  // namespace haustra::surface
