#include "tools/run/run_outputs.h"

#include <algorithm>
#include <filesystem>
#include <map>

#include "capture/codec/image_codec.h"
#include "capture/files/file_sink.h"
#include "engine/depth/depth_file.h"
#include "engine/io/colmap_writer.h"
#include "engine/io/ply_writer.h"
#include "engine/io/text_writer.h"
#include "engine/io/trajectory_writer.h"
#include "tools/run/map_name.h"

namespace haustra {
namespace {

namespace fs = std::filesystem;

// COLMAP ends a name at the first blank.
std::string ColmapName(std::string name) {
  std::replace_if(
      name.begin(), name.end(), [](unsigned char c) { return c <= ' ' || c == 0x7f; }, '_');
  return name;
}

// Opens, writes and finishes one file.
template <typename Writer>
Status WriteWith(const fs::path& path, Writer&& write) {
  HAUSTRA_ASSIGN(FileSink sink, FileSink::Create(path.string()));
  HAUSTRA_TRY(write(sink));
  return sink.Commit();
}

std::string_view StateName(const FrameOutcome& frame) {
  if (frame.is_dropped) return "dropped";
  return ToString(frame.result.state);
}

Status WriteFrames(ByteSink& sink, const RunRecord& record, const std::vector<FinalPose>& poses, bool with_times) {
  TextWriter text(sink);
  text.Text(
      "frame_idx,timestamp_ns,state,reason,live_map_id,map_id,keyframe_id,num_matches,num_inliers,num_expected,num_"
      "established,is_keyframe,frame_ms,rung,minor_faults,major_faults,voluntary_switches,involuntary_switches,"
      "search\n");
  for (std::size_t i = 0; i < poses.size(); ++i) {
    const FrameOutcome& frame = record.frames()[i];
    const FrameResult& result = frame.result;
    const bool is_live = result.state == TrackingState::kTracking;
    text.Integer(result.frame_index).Text(",").Integer(result.timestamp.time_since_epoch().count()).Text(",");
    text.Text(StateName(frame)).Text(",");
    text.Text(frame.is_dropped ? "newer_frame" : ToString(result.reason)).Text(",");
    text.Integer(is_live ? static_cast<std::int64_t>(result.map_id) : -1).Text(",");
    text.Integer(poses[i].is_localised ? static_cast<std::int64_t>(poses[i].pose.map_id) : -1).Text(",");
    text.Integer(poses[i].is_localised ? static_cast<std::int64_t>(poses[i].keyframe) : -1).Text(",");
    text.Integer(result.num_matches).Text(",").Integer(result.num_inliers).Text(",");
    text.Integer(result.num_expected).Text(",").Integer(result.num_established).Text(",");
    text.Integer(result.is_keyframe ? 1 : 0).Text(",");
    // Sequential runs repeat to the byte, so no time may stand in this file; summary.json has them.
    text.Number(with_times ? ToMilliseconds(frame.latency) : 0.0).Text(",");
    text.Text(ToString(result.rung)).Text(",");
    const ThreadUse use = with_times ? frame.use : ThreadUse{};
    text.Integer(use.minor_faults).Text(",").Integer(use.major_faults).Text(",");
    text.Integer(use.voluntary_switches).Text(",").Integer(use.involuntary_switches).Text(",");
    text.Text(ToString(result.search)).Text("\n");
  }
  return text.Finish();
}

struct MapRow {
  MapId id = 0;
  std::string_view status;
  std::int64_t merged_into = -1;
  std::size_t num_keyframes = 0;
  int num_points = 0;
  bool is_loaded = false;
  std::size_t num_frames = 0;  // of this run
  std::int64_t first_ns = -1;
  std::int64_t last_ns = -1;
};

std::string_view StatusName(MapStatus status) {
  switch (status) {
    case MapStatus::kActive: return "active";
    case MapStatus::kStored: return "stored";
    case MapStatus::kMerged: return "merged";
    case MapStatus::kDropped: return "dropped";
  }
  return "unknown";
}

Status WriteMaps(ByteSink& sink, const RunRecord& record, const std::vector<FinalPose>& poses, const Engine& engine) {
  std::map<MapId, MapRow> rows;
  engine.atlas().maps().ForEach([&](MapHandle, const Map& map) {
    rows[map.id] = {map.id,
                    StatusName(map.status),
                    map.merged_into == kNoId ? -1 : static_cast<std::int64_t>(map.merged_into),
                    map.keyframes.size(),
                    map.num_points,
                    map.is_loaded,
                    0,
                    -1,
                    -1};
  });
  for (std::size_t i = 0; i < poses.size(); ++i) {
    if (!poses[i].is_localised) continue;
    MapRow& row = rows[poses[i].pose.map_id];
    const std::int64_t stamp = record.frames()[i].result.timestamp.time_since_epoch().count();
    if (row.num_frames++ == 0) row.first_ns = stamp;
    row.last_ns = stamp;
  }
  TextWriter text(sink);
  text.Text(
      "map_id,status,merged_into,num_keyframes,num_points,num_frames,first_timestamp_ns,last_timestamp_ns,loaded\n");
  for (const auto& [id, row] : rows) {
    text.Integer(row.id).Text(",").Text(row.status).Text(",").Integer(row.merged_into).Text(",");
    text.Integer(static_cast<std::int64_t>(row.num_keyframes)).Text(",").Integer(row.num_points).Text(",");
    text.Integer(static_cast<std::int64_t>(row.num_frames)).Text(",").Integer(row.first_ns).Text(",");
    text.Integer(row.last_ns).Text(",").Integer(row.is_loaded ? 1 : 0).Text("\n");
  }
  return text.Finish();
}

// Commas and quotes have no place in a field of a simple table.
std::string Field(std::string text) {
  std::replace(text.begin(), text.end(), ',', ';');
  std::replace(text.begin(), text.end(), '\n', ' ');
  return text;
}

Status WriteEvents(ByteSink& sink, const RunRecord& record, const Engine& engine) {
  std::vector<RunEvent> events = record.events();
  std::stable_sort(events.begin(), events.end(),
                   [](const RunEvent& a, const RunEvent& b) { return a.frame_index < b.frame_index; });
  TextWriter text(sink);
  text.Text("frame_idx,timestamp_ns,event,map_id,other_map_id,details\n");
  for (const RunEvent& event : events) {
    text.Integer(event.frame_index).Text(",").Integer(event.timestamp.time_since_epoch().count()).Text(",");
    text.Text(event.event).Text(",").Integer(event.map_id).Text(",").Integer(event.other_map_id).Text(",");
    text.Text(Field(event.details));
    if (event.other_keyframe < engine.atlas().num_keyframe_ids()) {
      // A frame number of an earlier run says nothing about this one.
      if (engine.atlas().IsOfThisSession(event.other_keyframe)) {
        text.Text(" other_frame=").Integer(engine.atlas().FrameOfKeyframe(event.other_keyframe));
      } else {
        text.Text(" other_session=").Integer(engine.atlas().TraceOfKeyframe(event.other_keyframe).session);
      }
    }
    text.Text("\n");
  }
  return text.Finish();
}

// Every duration that was measured, a line each: the only table that differs from run to run.
Status WriteTimes(ByteSink& sink, const RunRecord& record) {
  TextWriter text(sink);
  text.Text("frame_idx,stage,ms\n");
  const auto write = [&](std::uint32_t frame_index, std::string_view stage, Duration duration) {
    if (duration.count() <= 0) return;
    text.Integer(frame_index).Text(",").Text(stage).Text(",").Number(ToMilliseconds(duration)).Text("\n");
  };
  for (const FrameOutcome& frame : record.frames()) {
    if (frame.is_dropped || frame.is_damaged) continue;
    write(frame.result.frame_index, "frame/total", frame.latency);
    write(frame.result.frame_index, "tracking/total", frame.tracking);
  }
  for (const MappingTimes& times : record.mapping_times()) {
    write(times.frame_index, "mapping/insert", times.insert);
    write(times.frame_index, "mapping/create", times.create);
    write(times.frame_index, "mapping/fuse", times.fuse);
    write(times.frame_index, "mapping/bundle", times.bundle);
    write(times.frame_index, "mapping/cull", times.cull);
    write(times.frame_index, "mapping/total", times.mapping());
    write(times.frame_index, "place/asking", times.asking);
    write(times.frame_index, "place/recognition", times.recognition);
    write(times.frame_index, "place/total", times.place);
    write(times.frame_index, "merging/total", times.merge);
    write(times.frame_index, "relocalisation/total", times.relocalisation);
  }
  return text.Finish();
}

// Where each mark of the map was in each frame that was tracked there.
Status WriteMarks(ByteSink& sink, const MarkLog& marks, const RunSummary& summary) {
  std::map<MarkId, std::string> labels;
  for (const MarkFigures& mark : summary.marks) labels[mark.id] = mark.label;
  TextWriter text(sink);
  text.Text("frame_idx,mark,u_px,v_px,state,distance_in_depths\n");
  for (const MarkLog::Row& row : marks.rows()) {
    const MarkSighting& sighting = row.sighting;
    const bool is_in_view = sighting.state != MarkState::kOutOfView;
    text.Integer(row.frame_index).Text(",").Text(labels[sighting.id]).Text(",");
    text.Number(is_in_view ? sighting.u_px : -1.0).Text(",").Number(is_in_view ? sighting.v_px : -1.0).Text(",");
    text.Text(ToString(sighting.state)).Text(",").Number(sighting.distance_in_depths).Text("\n");
  }
  return text.Finish();
}

Status WriteTrajectories(const fs::path& folder, const RunRecord& record, const std::vector<FinalPose>& poses) {
  std::vector<StampedPose> live;
  std::map<MapId, std::vector<StampedPose>> by_map;
  for (std::size_t i = 0; i < poses.size(); ++i) {
    const FrameResult& result = record.frames()[i].result;
    const std::int64_t stamp = result.timestamp.time_since_epoch().count();
    if (result.state == TrackingState::kTracking) live.push_back({stamp, result.cam_from_map});
    if (poses[i].is_localised) by_map[poses[i].pose.map_id].push_back({stamp, poses[i].pose.cam_from_map});
  }
  HAUSTRA_TRY(WriteWith(folder / "live.tum", [&](ByteSink& sink) {
    return WriteTum(
        sink, live,
        "poses as they were answered, each in the map that was active then (see frames.csv); world_from_cam");
  }));
  for (const auto& [id, trajectory] : by_map) {
    HAUSTRA_TRY(WriteWith(folder / (MapName(id) + ".tum"), [&, &trajectory = trajectory](ByteSink& sink) {
      return WriteTum(sink, trajectory, "final poses of all localised frames of this map; map units; world_from_cam");
    }));
  }
  return Status::Ok();
}

// Depth of the keyframes of a map, in its unit as it is now.
Status WriteDepths(ByteSink& sink, const Engine& engine, const Map& map) {
  const Atlas& atlas = engine.atlas();
  std::map<KeyframeId, KeyframeHandle> by_id;
  for (const KeyframeHandle handle : map.keyframes) {
    if (engine.depths()->DepthOf(handle) != nullptr) by_id[atlas.keyframe(handle).id] = handle;
  }
  const int step_px = engine.config().depth.step_px;
  DepthFileWriter writer(sink);
  HAUSTRA_TRY(writer.Begin({step_px, engine.camera().width_px() / step_px, engine.camera().height_px() / step_px},
                           static_cast<int>(by_id.size())));
  for (const auto& [id, handle] : by_id) {
    const KeptDepth& kept = *engine.depths()->DepthOf(handle);
    DepthMap depth = kept.depth;
    depth.ScaleRanges(atlas.KeyframeScale(handle) / kept.scale);
    HAUSTRA_TRY(writer.Add(id, atlas.keyframe(handle).frame_index, depth, kept.bgr));
  }
  return writer.End();
}

Status WriteMapExports(const fs::path& folder, const Engine& engine, const FrameSource& source,
                       const PointColour& colour) {
  const auto image_name = [&source](std::uint32_t frame_index) { return ColmapName(source.FrameName(frame_index)); };
  Status status;
  engine.atlas().maps().ForEach([&](MapHandle handle, const Map& map) {
    if (!status.ok() || map.keyframes.empty()) return;
    const MapExport data = ExportMap(engine, handle, image_name, colour);
    const fs::path colmap = folder / MapName(map.id);
    std::error_code error;
    fs::create_directories(colmap, error);
    const auto write_all = [&]() -> Status {
      HAUSTRA_TRY(WriteWith(folder / (MapName(map.id) + ".ply"), [&](ByteSink& s) { return WritePly(s, data); }));
      HAUSTRA_ASSIGN(const ColmapCamera camera, MakeColmapCamera(data.calibration));
      HAUSTRA_TRY(WriteWith(colmap / "cameras.txt", [&](ByteSink& s) { return WriteColmapCameras(s, camera); }));
      if (engine.depths() != nullptr) {
        HAUSTRA_TRY(WriteWith(colmap / "depth.bin", [&](ByteSink& s) { return WriteDepths(s, engine, map); }));
      }
      HAUSTRA_TRY(WriteWith(colmap / "images.txt", [&](ByteSink& s) { return WriteColmapImages(s, data); }));
      return WriteWith(colmap / "points3D.txt", [&](ByteSink& s) { return WriteColmapPoints3D(s, data); });
    };
    status = write_all();
  });
  return status;
}

}  // namespace

Status MakeResultFolders(const std::string& folder) {
  for (const char* name : {"trajectory", "maps"}) {
    std::error_code error;
    fs::create_directories(fs::path(folder) / name, error);
    if (error) return Unavailable(folder + "/" + name + ": cannot be made: " + error.message());
  }
  return Status::Ok();
}

Status WriteOutputs(const std::string& folder, const RunRecord& record, const std::vector<FinalPose>& poses,
                    const RunSummary& summary, const Engine& engine, const MarkLog& marks, const FrameSource& source,
                    bool has_own_mask, const PointColour& colour) {
  const fs::path root(folder);
  HAUSTRA_TRY(WriteTrajectories(root / "trajectory", record, poses));
  HAUSTRA_TRY(WriteWith(root / "frames.csv",
                        [&](ByteSink& sink) { return WriteFrames(sink, record, poses, summary.mode == "realtime"); }));
  HAUSTRA_TRY(WriteWith(root / "maps.csv", [&](ByteSink& sink) { return WriteMaps(sink, record, poses, engine); }));
  HAUSTRA_TRY(WriteWith(root / "events.csv", [&](ByteSink& sink) { return WriteEvents(sink, record, engine); }));
  HAUSTRA_TRY(WriteWith(root / "times.csv", [&](ByteSink& sink) { return WriteTimes(sink, record); }));
  // Without marks the folder is what it was before there were any.
  if (!summary.marks.empty() || !summary.refused_marks.empty()) {
    HAUSTRA_TRY(WriteWith(root / "marks.csv", [&](ByteSink& sink) { return WriteMarks(sink, marks, summary); }));
  }
  HAUSTRA_TRY(WriteMapExports(root / "maps", engine, source, colour));
  if ((engine.depths() != nullptr || has_own_mask) && !source.static_mask().is_empty()) {
    HAUSTRA_TRY(WritePng((root / "mask.png").string(), source.static_mask()));
  }
  return WriteSummary(folder, summary);
}

Status WriteSummary(const std::string& folder, const RunSummary& summary) {
  return WriteFile((fs::path(folder) / "summary.json").string(), ToJson(summary));
}

}  // namespace haustra
