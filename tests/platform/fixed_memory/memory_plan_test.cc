// The memory plan against what construction really takes.
#include "platform/memory_plan.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <atomic>
#include <filesystem>
#include <fstream>
#include <string>
#include <vector>

#include "engine/engine.h"
#include "hal/fakes/scripted_vision_device.h"
#include "kernels/cpu/cpu_vision_device.h"
#include "platform/assemble.h"
#include "platform/clock/system_clock.h"
#include "platform/config/engine_config_table.h"
#include "platform/config/memory_profiles.h"
#include "platform/session/session.h"
#include "tests/geometry/synthetic.h"
#include "tests/platform/fixed_memory/heap_bytes.h"
#include "tests/tools/run/recording_observer.h"
#include "tests/tools/run/scripted_colon.h"

namespace haustra {
namespace {

using test::BytesTaken;
using testing::HasSubstr;

std::vector<EngineConfig> Configurations() {
  EngineConfig small = test::SmallEngineConfig();
  EngineConfig odd = small;
  odd.features.max = 333;
  odd.memory.max_keyframes = 17;
  odd.memory.max_map_points = 1001;
  odd.memory.max_maps = 5;
  odd.memory.max_keyframe_ids = 101;
  odd.memory.max_local_points = 777;
  odd.memory.max_proposals = 5;
  odd.memory.max_map_events = 33;
  odd.memory.max_late_poses = 65;
  odd.initialisation.kept_views = 7;
  EngineConfig deep = odd;
  deep.depth.enabled = true;
  deep.depth.step_px = 5;
  deep.depth.kept_pictures = 7;
  return {small, odd, deep, EngineConfig{}};
}

TEST(MemoryPlanOfTheEngine, ArenaHoldsExactlyThePools) {
  const CameraModel camera = CameraModel::Create(test::ColonCalibration()).value();
  for (const EngineConfig& config : Configurations()) {
    const MemoryPlan plan = Engine::PlanMemory(config, camera.width_px(), camera.height_px());
    ScriptedVisionDevice device(Engine::PlanFor(config, camera.calibration()), {});
    const DepthSearch depth = CreateDepthSearch("cpu", config, camera, {}).value();
    const std::size_t before = BytesTaken();
    const Engine engine(config, camera, device, Engine::Mode::kSequential, nullptr, ImageView{}, nullptr,
                        depth.matcher.get());
    const std::size_t taken = BytesTaken() - before;
    EXPECT_EQ(engine.arena().size_bytes(), plan.bytes(MemoryPlace::kHostArena));
    EXPECT_EQ(engine.arena().used_bytes(), engine.arena().size_bytes());
    // Workspaces of mapping grow towards their bound; what tracking has is there from the start.
    std::uint64_t tracking = 0;
    for (const MemoryLine& line : plan.lines) tracking += line.pool == "tracking workspace" ? line.bytes : 0;
    EXPECT_GE(taken, plan.bytes(MemoryPlace::kHostArena) + tracking);
    EXPECT_LE(taken, plan.host_bytes());
  }
}

TEST(MemoryPlanOfTheEngine, PoolsGrowWithTheirKeyAlone) {
  const EngineConfig base = test::SmallEngineConfig();
  EngineConfig more = base;
  more.memory.max_map_points *= 2;
  const MemoryPlan a = Engine::PlanMemory(base, 640, 480), b = Engine::PlanMemory(more, 640, 480);
  ASSERT_EQ(a.lines.size(), b.lines.size());
  for (std::size_t i = 0; i < a.lines.size(); ++i) {
    const bool is_sized = a.lines[i].sized_by.find("max_map_points") != std::string::npos;
    EXPECT_EQ(a.lines[i].bytes != b.lines[i].bytes, is_sized) << a.lines[i].pool;
  }
}

TEST(MemoryPlanOfTheCpuDevice, IsWhatConstructionTakes) {
  for (const int num_threads : {1, 3}) {
    VisionPlan vision;
    vision.max_width_px = 323;
    vision.max_height_px = 241;
    vision.max_features = 500;
    vision.max_feature_sets = 40;
    vision.max_match_list = 900;
    ExtractOptions options;
    options.num_features = 500;
    const MemoryPlan plan = PlanCpuVisionDevice(vision, options, num_threads);
    const std::size_t before = BytesTaken();
    const auto device = CreateCpuVisionDevice(vision, options, num_threads);
    ASSERT_TRUE(device.ok());
    const auto taken = static_cast<double>(BytesTaken() - before);
    // Beside the pools there are the object itself, its threads and its name.
    EXPECT_NEAR(taken, static_cast<double>(plan.host_bytes()), 16'384.0) << num_threads << " threads";
  }
}

TEST(MemoryPlanOfTheSession, IsWhatARealTimeSessionTakes) {
  test::ScriptedColon colon;
  colon.Occlude(3);
  const auto engine = colon.MakeEngine(Engine::Mode::kRealTime, colon.device());
  test::RecordingObserver observer;
  const SystemClock clock;
  const std::atomic<bool> stopped{true};
  const std::size_t before = BytesTaken();
  ASSERT_TRUE(RunRealTime(colon.source(), *engine, clock, 1.0, observer, stopped).ok());
  const auto taken = static_cast<double>(BytesTaken() - before);
  // Beside them there are the threads with what they ask the system, and the mailbox's prototype of a frame.
  const double frame = 3.0 * colon.source().calibration().width_px * colon.source().calibration().height_px;
  EXPECT_NEAR(taken, static_cast<double>(PlanRealTimeSession(colon.source().calibration()).host_bytes()) + frame,
              65'536.0);
}

// What helps tracking in real time would keep mapping from all processors.
TEST(VisionThreads, LeaveAProcessorToMappingInRealTime) {
  EngineConfig config;
  config.rt.enabled = true;
  constexpr auto kRealTime = Engine::Mode::kRealTime, kSequential = Engine::Mode::kSequential;
  EXPECT_EQ(NumVisionThreads(0, config, kRealTime, 8), 7);
  EXPECT_EQ(NumVisionThreads(0, config, kRealTime, 2), 1);
  EXPECT_EQ(NumVisionThreads(0, config, kRealTime, 1), 1);
  EXPECT_EQ(NumVisionThreads(8, config, kRealTime, 8), 8) << "as it is told";
  EXPECT_EQ(NumVisionThreads(0, config, kSequential, 8), 8) << "tracking and mapping take turns";
  config.rt.enabled = false;
  EXPECT_EQ(NumVisionThreads(0, config, kRealTime, 8), 8);
}

// A machine with more processors than the device takes threads is no reason not to start.
TEST(VisionThreads, AreNoMoreThanTheDeviceTakes) {
  EngineConfig config;
  for (const auto mode : {Engine::Mode::kRealTime, Engine::Mode::kSequential}) {
    EXPECT_EQ(NumVisionThreads(0, config, mode, 128), 64);
    EXPECT_EQ(NumVisionThreads(100, config, mode, 128), 64);
  }
}

TEST(MemoryPlan, CoversEngineDeviceAndSession) {
  const EngineConfig config;
  const CameraCalibration camera = test::ColonCalibration();
  const Result<MemoryPlan> plan = PlanMemory(config, camera, "cpu", 2);
  ASSERT_TRUE(plan.ok());
  const std::uint64_t engine = Engine::PlanMemory(config, camera.width_px, camera.height_px).host_bytes();
  const std::uint64_t device =
      PlanCpuVisionDevice(Engine::PlanFor(config, camera), Engine::ExtractOptionsFor(config), 2).host_bytes();
  EXPECT_EQ(plan->host_bytes(), engine + device + PlanRealTimeSession(camera).host_bytes());
  EXPECT_EQ(plan->device_bytes(), 0u);
  EXPECT_FALSE(PlanMemory(config, camera, "abacus", 2).ok());
}

TEST(MemoryPlan, OfDepthIsWhatItsMatcherTakes) {
  EngineConfig config = test::SmallEngineConfig();
  const CameraCalibration calibration = test::ColonCalibration();
  const CameraModel camera = CameraModel::Create(calibration).value();
  const std::uint64_t without = PlanMemory(config, calibration, "cpu", 2)->host_bytes();
  config.depth.enabled = true;
  const std::uint64_t with = PlanMemory(config, calibration, "cpu", 2)->host_bytes();
  const std::uint64_t keeper =
      DepthKeeper::PlanMemory(config, calibration.width_px, calibration.height_px).host_bytes();
  const std::size_t before = BytesTaken();
  const DepthSearch depth = CreateDepthSearch("cpu", config, camera, {}).value();
  const std::size_t taken = BytesTaken() - before;
  EXPECT_LE(taken, with - without - keeper);
  EXPECT_GT(taken, (with - without - keeper) * 9 / 10);
}

TEST(MemoryPlan, OfCudaNeedsNoGpuAndNamesWhatTheDeviceLacks) {
  EngineConfig config;
  const Result<MemoryPlan> plan = PlanMemory(config, test::ColonCalibration(), "cuda", 2);
  if (plan.code() == StatusCode::kUnavailable) GTEST_SKIP() << plan.status().message();
  ASSERT_TRUE(plan.ok());
  EXPECT_GT(plan->device_bytes(), 1612ull * 2000 * (128 + 24 + 4));
  EXPECT_GT(plan->bytes(MemoryPlace::kHostPinned), 0u);
  EXPECT_TRUE(CheckMemory(*plan, config, {}).ok());
  config.memory.max_keyframes = 4000;
  const Result<MemoryPlan> more = PlanMemory(config, test::ColonCalibration(), "cuda", 2);
  ASSERT_TRUE(more.ok());
  config.memory.max_host_mb = 0.0;
  const Status status = CheckMemory(*more, config, {});
  EXPECT_EQ(status.code(), StatusCode::kCapacityExceeded);
  EXPECT_THAT(status.message(), HasSubstr("device memory: 'feature sets (cuda)'"));
  EXPECT_THAT(status.message(), HasSubstr("memory.max_device_mb allows 1000.0 MB"));
}

TEST(MemoryPlan, EveryProfileFitsItsOwnLimitAtTheSizeOfAnEndoscope) {
  CameraCalibration camera = test::ColonCalibration();
  camera.width_px = 1920;
  camera.height_px = 1080;
  for (const std::string& profile : MemoryProfileNames()) {
    const auto config = LoadEngineConfig("", {"memory.profile=" + profile});
    ASSERT_TRUE(config.ok()) << config.status().ToString();
    for (const char* device : {"cpu", "cuda"}) {
      const Result<MemoryPlan> plan = PlanMemory(config->config(), camera, device, 4);
      if (plan.code() == StatusCode::kUnavailable) continue;
      ASSERT_TRUE(plan.ok());
      const Status status = CheckMemory(*plan, config->config(), {});
      EXPECT_TRUE(status.ok()) << profile << ": " << status.ToString();
    }
  }
}

TEST(MemoryPlan, WhatDoesNotFitIsNamed) {
  EngineConfig config;
  config.memory.max_map_points = 4'000'000;
  const Result<MemoryPlan> plan = PlanMemory(config, test::ColonCalibration(), "cpu", 2);
  ASSERT_TRUE(plan.ok());
  const Status over_limit = CheckMemory(*plan, config, {});
  EXPECT_EQ(over_limit.code(), StatusCode::kCapacityExceeded);
  EXPECT_THAT(over_limit.message(), HasSubstr("'map points'"));
  EXPECT_THAT(over_limit.message(), HasSubstr("memory.max_map_points"));
  EXPECT_THAT(over_limit.message(), HasSubstr("memory.max_host_mb allows 1800.0 MB"));
  config.memory.max_host_mb = 0;
  EXPECT_TRUE(CheckMemory(*plan, config, {}).ok());
  EXPECT_GT(AvailableHostMemory().bytes, 10'000'000u);
}

// Others may give memory back, and a limit that somebody set stays.
TEST(MemoryPlan, WhatTheMachineLacksNowIsNotAWrongConfiguration) {
  RecordProperty("req", "DMN-001");
  const EngineConfig config;
  const Result<MemoryPlan> plan = PlanMemory(config, test::ColonCalibration(), "cpu", 2);
  ASSERT_TRUE(plan.ok());
  const Status now = CheckMemory(*plan, config, {500'000'000, "this machine's available memory"});
  EXPECT_EQ(now.code(), StatusCode::kUnavailable);
  EXPECT_THAT(now.message(), HasSubstr("this machine's available memory allows 500.0 MB"));
  const Status always = CheckMemory(*plan, config, {500'000'000, "the memory limit of the control group", true});
  EXPECT_EQ(always.code(), StatusCode::kCapacityExceeded);
}

// A limit that kills is known before anything is taken: of the group itself, or of one above it.
TEST(MemoryPlan, LimitOfTheControlGroupIsFoundInBothVersions) {
  namespace fs = std::filesystem;
  const std::string mount = testing::TempDir() + "control_groups";
  fs::remove_all(mount);
  const auto write = [&](const std::string& group, const std::string& name, const std::string& text) {
    fs::create_directories(mount + group);
    std::ofstream(mount + group + name) << text << "\n";
  };
  write("/system.slice/haustrad.service", "/memory.max", "3221225472");
  write("/system.slice", "/memory.max", "max");
  write("/memory/jobs/one", "/memory.limit_in_bytes", "9223372036854771712");
  write("/memory/jobs", "/memory.limit_in_bytes", "500000000");
  EXPECT_EQ(MemoryLimitOfGroups("0::/system.slice/haustrad.service\n", mount), 3221225472u);
  EXPECT_EQ(MemoryLimitOfGroups("0::/system.slice\n", mount), 0u);
  EXPECT_EQ(MemoryLimitOfGroups("7:blkio:/\n4:memory:/jobs/one\n0::/\n", mount), 500000000u) << "of the one above";
  EXPECT_EQ(MemoryLimitOfGroups("0::/not/seen/from/here\n", mount), 0u);
  EXPECT_EQ(MemoryLimitOfGroups("nonsense\n0:\n", mount), 0u);
  fs::remove_all(mount);
}

// The unit as it is shipped has room for the default pools at the largest picture, and for the file of a procedure that
// goes on, which is read as a whole.
TEST(MemoryPlan, UnitOfTheServiceHasRoomForTheDefaultPools) {
  std::ifstream unit(HAUSTRA_CONFIG_FOLDER "/service/haustrad.service");
  double limit_bytes = 0.0;
  for (std::string line; std::getline(unit, line);) {
    if (!line.starts_with("MemoryMax=")) continue;
    ASSERT_TRUE(line.ends_with("G")) << line;
    limit_bytes = std::stod(line.substr(line.find('=') + 1)) * 1024 * 1024 * 1024;
  }
  ASSERT_GT(limit_bytes, 0.0) << "no MemoryMax= in the unit";
  CameraCalibration camera = test::ColonCalibration();
  camera.width_px = 1920;
  camera.height_px = 1080;
  const EngineConfig config;
  const double file_bytes =
      1.0 * (kDescriptorBytes + sizeof(Keypoint)) * config.features.max * config.memory.max_keyframes;
  for (const char* device : {"cpu", "cuda"}) {
    const Result<MemoryPlan> plan = PlanMemory(config, camera, device, 16);
    if (plan.code() == StatusCode::kUnavailable) continue;
    ASSERT_TRUE(plan.ok());
    EXPECT_LE(static_cast<double>(plan->host_bytes()) + file_bytes, limit_bytes) << device;
  }
}

TEST(MemoryProfiles, MediumIsTheDefault) {
  const auto defaults = LoadEngineConfig("", {});
  const auto medium = LoadEngineConfig("", {"memory.profile=medium"});
  ASSERT_TRUE(medium.ok()) << medium.status().ToString();
  for (const ConfigField& field : EngineConfigFields()) {
    EXPECT_EQ(field.read(&defaults->config()), field.read(&medium->config())) << field.key;
  }
}

TEST(MemoryProfiles, ProfileSetsEveryKeyAndSingleKeysOverrideIt) {
  for (const std::string profile : {"small", "large"}) {
    const auto store = LoadEngineConfig("", {"memory.max_maps=77", "memory.profile=" + profile});
    ASSERT_TRUE(store.ok()) << store.status().ToString();
    EXPECT_EQ(store->config().memory.max_maps, 77);
    EXPECT_NE(store->config().memory.max_keyframes, EngineConfig{}.memory.max_keyframes);
    for (const ConfigField& field : EngineConfigFields()) {
      if (!field.key.starts_with("memory.")) continue;
      const ConfigOrigin& origin = store->origin(field.key);
      EXPECT_NE(origin.kind, ConfigOrigin::Kind::kDefault) << field.key;
      const bool is_given = field.key == "memory.max_maps" || field.key == "memory.profile";
      EXPECT_EQ(origin.where.find("memory profile " + profile) != std::string::npos, !is_given) << field.key;
    }
  }
  EXPECT_THAT(LoadEngineConfig("", {"memory.profile=huge"}).status().message(), HasSubstr("small"));
}

}  // namespace
}  // namespace haustra
