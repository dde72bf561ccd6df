#include "tools/view/live_stream.h"

#include <cmath>
#include <nlohmann/json.hpp>
#include <vector>

#include "capture/codec/jpeg_codec.h"
#include "platform/publish/ring_error.h"
#include "tools/report/base64.h"
#include "tools/view/column.h"
#include "tools/view/live_marks.h"
#include "tools/view/seconds.h"

namespace haustra::view {
namespace {

using Json = nlohmann::ordered_json;

constexpr std::int64_t kMaxSilence_ns = 1'000'000'000;
constexpr std::int64_t kMapInterval_ns = 1'000'000'000;
constexpr std::int64_t kMaxAnswer_ns = 500'000'000;
constexpr int kJpegQuality = 80;

std::string Dump(const Json& data) { return data.dump(-1, ' ', false, Json::error_handler_t::replace); }

void Say(const char* event, const std::string& data, std::string* news) {
  *news += std::string("event: ") + event + "\ndata: " + data + "\n\n";
}
void Say(const char* event, const Json& data, std::string* news) { Say(event, Dump(data), news); }

// 2^32 - 1 stands for none.
std::int64_t MapId(std::uint32_t id) { return id == HAUSTRA_NO_MAP ? -1 : static_cast<std::int64_t>(id); }

Json PoseJson(const haustra_pose& pose) {
  Json json = {{"frame", pose.frame_index},
               {"t_s", Seconds(pose.captured_ns)},
               {"published_ms", std::round(static_cast<double>(pose.published_ns - pose.captured_ns) * 1e-4) * 1e-2},
               {"state", haustra_state_name(pose.state)},
               {"reason", haustra_reason_name(pose.reason)},
               {"is_predicted", (pose.flags & HAUSTRA_POSE_PREDICTED) != 0},
               {"map", MapId(pose.map_id)},
               {"epoch", pose.map_epoch},
               {"features", pose.num_features},
               {"inliers", pose.num_inliers}};
  if ((pose.flags & HAUSTRA_POSE_VALID) != 0) {
    json["position"] = pose.position_mu;
    json["orientation"] = pose.orientation_xyzw;
  }
  if (pose.num_marks > 0) json["marks"] = SightingsJson(pose);
  return json;
}

std::string PointsColumn(const haustra_point* points, std::uint32_t count) {
  std::vector<float> positions;
  for (std::uint32_t i = 0; i < count; ++i) {
    positions.insert(positions.end(), points[i].position_mu, points[i].position_mu + 3);
  }
  return Column(positions);
}

const char* ServiceText(std::uint32_t service) {
  switch (service) {
    case HAUSTRA_SERVICE_STARTING: return "The engine is starting.";
    case HAUSTRA_SERVICE_IDLE: return "The engine waits for a procedure to begin.";
    case HAUSTRA_SERVICE_RUNNING: return "A procedure is running.";
    case HAUSTRA_SERVICE_NO_SIGNAL: return "A procedure is open, but the camera gives no pictures.";
    case HAUSTRA_SERVICE_SOURCE_OVER: return "A procedure is open; its recording is over.";
    case HAUSTRA_SERVICE_CLOSED: return "No engine is running: it was stopped.";
    default: return "The engine is in a state that this program does not know.";
  }
}

bool IsBusy(std::uint32_t service) {
  return service == HAUSTRA_SERVICE_RUNNING || service == HAUSTRA_SERVICE_NO_SIGNAL ||
         service == HAUSTRA_SERVICE_SOURCE_OVER;
}

}  // namespace

LiveStream::LiveStream(const std::string& folder, std::shared_ptr<const LiveWall> wall)
    : path_(folder + "/poses"),
      view_path_(folder + "/view"),
      wall_(std::move(wall)),
      snapshot_(std::make_unique<haustra_snapshot>()),
      picture_(std::make_unique<haustra_picture>()),
      matches_(std::make_unique<haustra_matches>()) {}

LiveStream::~LiveStream() {
  haustra_ring_close(&ring_);
  haustra_view_close(&view_);
}

std::string LiveStream::Next() {
  std::string news;
  if (ring_.file == nullptr || haustra_ring_is_replaced(&ring_, path_.c_str()) != 0) Reopen(&news);
  TellService(&news);
  if (ring_.file == nullptr) return news;
  TellPoses(&news);
  TellEvents(&news);
  TellMap(&news);
  TellPicture(&news);
  TellWall(&news);
  return news;
}

void LiveStream::Forget(std::string* news) {
  Say("fresh", Json::object(), news);
  told_snapshot_ = 0;
  has_picture_ = false;
  *snapshot_ = haustra_snapshot{};
  *picture_ = haustra_picture{};
}

void LiveStream::Reopen(std::string* news) {
  const bool was_open = ring_.file != nullptr;
  haustra_ring_close(&ring_);
  const int result = haustra_ring_open(&ring_, path_.c_str());
  open_error_ = RingOpenError(path_, result);
  if (result != HAUSTRA_OK && !was_open) return;
  Forget(news);
  pose_cursor_ = event_cursor_ = procedure_ = 0;
  was_busy_ = false;
}

void LiveStream::TellService(std::string* news) {
  Json json;
  bool is_busy = false;
  if (ring_.file == nullptr) {
    json = {{"state", "none"}, {"text", open_error_.empty() ? "No engine is running." : open_error_}};
  } else {
    const std::uint32_t service = haustra_ring_service(&ring_);
    is_busy = IsBusy(service);
    if (service != HAUSTRA_SERVICE_CLOSED && haustra_ring_is_alive(&ring_, kMaxSilence_ns) == 0) {
      json = {{"state", "silent"}, {"text", "The engine gives no sign of life."}};
      is_busy = was_busy_;
    } else {
      json = {{"state", haustra_service_name(service)}, {"text", ServiceText(service)}};
    }
  }
  json["has_engine"] = is_busy;
  // What it showed was one patient's.
  const std::uint64_t procedure =
      ring_.file == nullptr ? 0 : __atomic_load_n(&ring_.file->header.procedure, __ATOMIC_ACQUIRE);
  if ((was_busy_ && !is_busy) || (procedure_ != 0 && procedure != procedure_)) Forget(news);
  was_busy_ = is_busy;
  procedure_ = procedure;
  std::string text = Dump(json);
  if (text == told_service_) return;
  Say("service", json, news);
  told_service_ = std::move(text);
}

// The files may still have what an earlier procedure left, and that was a patient's: a service that has gone wipes
// nothing, and wiping may fail.
bool LiveStream::IsShown(std::uint64_t procedure) const { return was_busy_ && procedure == procedure_; }

void LiveStream::TellPoses(std::string* news) {
  Json poses = Json::array();
  haustra_pose pose;
  std::uint64_t num_missed = 0;
  while (haustra_ring_next_pose(&ring_, &pose_cursor_, &pose, &num_missed) == HAUSTRA_OK) {
    if (IsShown(pose.procedure)) poses.push_back(PoseJson(pose));
  }
  if (!poses.empty()) Say("poses", poses, news);
}

void LiveStream::TellEvents(std::string* news) {
  Json events = Json::array();
  haustra_event event;
  std::uint64_t num_missed = 0;
  while (haustra_ring_next_event(&ring_, &event_cursor_, &event, &num_missed) == HAUSTRA_OK) {
    if (event.kind == HAUSTRA_EVENT_FRAME_NOT_FOUND || event.kind == HAUSTRA_EVENT_MERGE_REJECTED) continue;
    events.push_back({{"frame", event.frame_index},
                      {"t_s", Seconds(event.published_ns)},
                      {"event", haustra_event_name(event.kind)},
                      {"map", MapId(event.map_id)},
                      {"other_map", event.kind == HAUSTRA_EVENT_MERGED ? MapId(event.other_map_id) : -1},
                      {"keyframes", event.num_keyframes},
                      {"points", event.num_points}});
  }
  if (!events.empty()) Say("events", events, news);
}

void LiveStream::TellMap(std::string* news) {
  const std::int64_t now_ns = haustra_now_ns();
  if (!was_busy_ || now_ns < next_map_ns_ || haustra_ring_newest_snapshot(&ring_) == told_snapshot_) return;
  if (haustra_ring_latest_snapshot(&ring_, snapshot_.get()) != HAUSTRA_OK) return;
  told_snapshot_ = snapshot_->sequence;
  if (!IsShown(snapshot_->procedure)) return;
  next_map_ns_ = now_ns + kMapInterval_ns;
  Say("map",
      {{"map", MapId(snapshot_->map_id)},
       {"procedure", snapshot_->procedure},
       {"epoch", snapshot_->map_epoch},
       {"num_points", snapshot_->num_map_points},
       {"num_keyframes", snapshot_->num_map_keyframes},
       {"num_maps", snapshot_->num_maps},
       {"marks", MarksJson(*snapshot_)},
       {"points", PointsColumn(snapshot_->points, snapshot_->num_points)},
       {"keyframes", PointsColumn(snapshot_->keyframes, snapshot_->num_keyframes)}},
      news);
}

void LiveStream::TellPicture(std::string* news) {
  if (view_.file != nullptr && haustra_view_is_replaced(&view_, view_path_.c_str()) != 0) haustra_view_close(&view_);
  if (view_.file == nullptr) {
    has_picture_ = false;
    told_picture_ = 0;
    if (haustra_view_open(&view_, view_path_.c_str()) != HAUSTRA_OK) return;
  }
  if (!has_picture_) {
    if (haustra_view_latest_picture(&view_, picture_.get()) != HAUSTRA_OK || picture_->sequence == told_picture_)
      return;
    told_picture_ = picture_->sequence;
    if (!IsShown(picture_->procedure)) return;
    has_picture_ = true;
  }
  const int answer = haustra_view_matches_of(&view_, picture_->frame_index, picture_->procedure, matches_.get());
  // A frame that was dropped is shown without matches, when it is certain that none will come.
  if (answer == HAUSTRA_NOT_YET && haustra_now_ns() - picture_->published_ns < kMaxAnswer_ns) return;
  has_picture_ = false;
  const int width = static_cast<int>(picture_->width), height = static_cast<int>(picture_->height);
  const int channels = static_cast<int>(picture_->num_channels);
  std::vector<std::uint8_t> jpeg;
  const ImageView image{picture_->pixels, width, height, width * channels,
                        channels == 1 ? PixelFormat::kGrey8 : PixelFormat::kBgr8};
  if (!capture::internal::EncodeJpeg(image, kJpegQuality, &jpeg).ok()) return;
  Json json = {
      {"frame", picture_->frame_index}, {"procedure", picture_->procedure}, {"width", width}, {"height", height},
      {"step", picture_->step},         {"jpeg", report::ToBase64(jpeg)}};
  json["num_matched"] = answer == HAUSTRA_OK ? matches_->num_matched : 0;
  json["points"] = Json::array();
  for (std::uint32_t i = 0; answer == HAUSTRA_OK && i < matches_->num_points; ++i) {
    const haustra_match& point = matches_->points[i];
    for (const float px : {point.x_px, point.y_px})
      json["points"].push_back(std::round(10.0F * px / picture_->step) / 10.0F);
  }
  // Its pose is published before its matches.
  haustra_pose pose;
  const bool has_pose = FindPose(ring_, picture_->frame_index, picture_->procedure, &pose);
  json["marks"] = has_pose ? DrawnMarksJson(pose, picture_->step) : Json::array();
  Say("picture", json, news);
}

void LiveStream::TellWall(std::string* news) {
  if (wall_ == nullptr) return;
  const std::shared_ptr<const WallNews> wall = wall_->newest();
  if (wall->version == told_wall_) return;
  told_wall_ = wall->version;
  Say("wall", wall->json, news);
}

}  // namespace haustra::view
