#include "tests/fuzz/atlas_reader_fuzz.h"

#include <string>
#include <vector>

#include "engine/atlas/invariants.h"
#include "engine/io/atlas_reader.h"
#include "engine/io/atlas_writer.h"
#include "hal/fakes/scripted_vision_device.h"
#include "tests/engine/io/sealed_file.h"
#include "tests/fuzz/fuzz_entries.h"

namespace haustra::test {
namespace {

// Small pools, so that what does not fit is met too.
constexpr Atlas::Capacity kCapacity{12, 48, 6, 48, 12, 3};

struct Home {
  Home() : device(Plan(), {}), atlas(kCapacity) {}
  static VisionPlan Plan() {
    VisionPlan plan;
    plan.max_features = kCapacity.max_features;
    plan.max_feature_sets = kCapacity.max_keyframes;
    return plan;
  }
  std::string Save(const SavedAtlas& saved) {
    StringSink sink;
    HAUSTRA_CHECK(WriteAtlas(atlas, saved.camera, saved.root_sift, device, sink).ok());
    return sink.bytes();
  }

  ScriptedVisionDevice device;
  Atlas atlas;
};

// Loaded from `file`; false when that is refused, and then nothing has changed.
bool Load(std::span<const std::uint8_t> file, Home* home, std::string* saved_again) {
  const Result<SavedAtlas> saved = ReadAtlas(file);
  if (!saved.ok()) {
    HAUSTRA_CHECK(!saved.status().message().empty());
    return false;
  }
  SavedAtlas renumbered = *saved;
  RenumberKeyframes(&renumbered);
  HAUSTRA_CHECK(CheckSavedAtlas(renumbered).ok());
  const Result<CameraModel> camera = CameraModel::Create(saved->camera);
  HAUSTRA_CHECK(camera.ok());
  const Status status = RestoreAtlas(*saved, *camera, saved->root_sift, home->device, &home->atlas, nullptr);
  if (!status.ok()) {
    HAUSTRA_CHECK(home->atlas.keyframes().size() == 0 && home->atlas.counters().next_map_id == 0);
    HAUSTRA_CHECK(home->device.num_free_feature_sets() == kCapacity.max_keyframes);
    return false;
  }
  HAUSTRA_CHECK(CheckInvariants(home->atlas).ok());
  *saved_again = home->Save(*saved);
  return true;
}

}  // namespace

bool TryAtlasFile(std::span<const std::uint8_t> file) {
  Home home;
  std::string saved;
  if (!Load(file, &home, &saved)) return false;
  // What was taken is sound, so it can be saved, loaded, and is the same then.
  Home other;
  std::string saved_again;
  HAUSTRA_CHECK(Load({reinterpret_cast<const std::uint8_t*>(saved.data()), saved.size()}, &other, &saved_again));
  HAUSTRA_CHECK(saved == saved_again);
  return true;
}

void FuzzAtlasReader(std::span<const std::uint8_t> bytes) {
  TryAtlasFile(bytes);
  // Nearly nothing gets past the checksums; what lies behind them must hold on its own.
  TryAtlasFile(Sealed(bytes));
}

}  // namespace haustra::test
