#include "tools/view/live_wall.h"

#include <sys/resource.h>
#include <unistd.h>

#include <algorithm>
#include <chrono>
#include <future>
#include <utility>

#include "tools/view/live_atlas.h"

namespace haustra::view {
namespace {

using std::chrono::steady_clock;

constexpr std::chrono::milliseconds kStep{100};
constexpr std::chrono::seconds kMinInterval{2};
constexpr int kLowestPriority = 19;

}  // namespace

LiveWall::LiveWall(const std::string& folder) : thread_([this, folder] { Run(folder); }) {}

LiveWall::~LiveWall() {
  is_stopping_ = true;
  thread_.join();
}

std::shared_ptr<const WallNews> LiveWall::newest() const {
  const std::lock_guard lock(mutex_);
  return newest_;
}

void LiveWall::Publish(LiveSurface surface) {
  auto news = std::make_shared<WallNews>();
  news->json = std::move(surface.json);
  if (!surface.ply.empty()) {
    news->mesh = std::make_shared<const ViewResource>(ViewResource{"application/octet-stream", std::move(surface.ply)});
  }
  const std::lock_guard lock(mutex_);
  news->version = newest_->version + 1;
  newest_ = std::move(news);
}

void LiveWall::Run(const std::string& folder) {
  LiveAtlas atlas(folder);
  // Poses go on coming meanwhile, and are overwritten after seconds.
  std::future<Result<LiveSurface>> work;
  auto begin = steady_clock::now(), next = begin;
  std::uint64_t procedure = 0, worked_for = 0;
  std::uint32_t map_worked_for = HAUSTRA_NO_MAP, shown_map = HAUSTRA_NO_MAP;
  bool has_changed = false;
  for (; !is_stopping_; std::this_thread::sleep_for(kStep)) {
    has_changed = atlas.Update() || has_changed;
    const LiveMaps& maps = atlas.maps();
    const std::uint64_t now_procedure = maps.camera ? maps.camera->procedure : 0;
    // What was shown is of another patient.
    if (now_procedure != procedure) {
      Publish({});
      shown_map = HAUSTRA_NO_MAP;
    }
    if (work.valid() && work.wait_for(std::chrono::seconds(0)) == std::future_status::ready) {
      Result<LiveSurface> made = work.get();
      next = steady_clock::now() + std::max<steady_clock::duration>(kMinInterval, 2 * (steady_clock::now() - begin));
      // A map that has no wall yet must not be shown with that of the one before.
      const bool is_outdated = !made.ok() && shown_map != HAUSTRA_NO_MAP && shown_map != map_worked_for;
      if ((made.ok() || is_outdated) && worked_for == now_procedure) {
        shown_map = made.ok() ? map_worked_for : HAUSTRA_NO_MAP;
        Publish(made.ok() ? std::move(*made) : LiveSurface());
      }
    }
    procedure = now_procedure;
    if (!maps.camera || !has_changed || work.valid() || steady_clock::now() < next) continue;
    has_changed = false;
    begin = steady_clock::now();
    worked_for = procedure;
    map_worked_for = maps.map_id;
    work = std::async(std::launch::async, [copy = maps, this] {
      ::setpriority(PRIO_PROCESS, static_cast<id_t>(::gettid()), kLowestPriority);
      surface::SurfaceOptions options;
      options.stop = &is_stopping_;
      return MakeLiveSurface(copy, options);
    });
  }
}

}  // namespace haustra::view
