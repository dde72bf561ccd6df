#include "platform/config/engine_config_table.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cstdint>
#include <filesystem>
#include <string>
#include <vector>

namespace haustra {
namespace {

using ::testing::HasSubstr;

// Converts to anything: counts the members of an aggregate by how many initialisers it takes.
struct Anything {
  template <typename T>
  operator T() const;
};
template <typename T, typename... Initialisers>
constexpr int NumMembers() {
  if constexpr (requires { T{Initialisers{}..., Anything{}}; }) {
    return NumMembers<T, Initialisers..., Anything>();
  } else {
    return static_cast<int>(sizeof...(Initialisers));
  }
}

TEST(EngineConfigTable, BindsEveryMember) {
  // A new section or a new member of a section makes one of these fail until it has its row.
  EXPECT_EQ(NumMembers<EngineConfig>(), 14);
  EXPECT_EQ(NumMembers<PlaceConfig>(), 4);
  const int expected = 1 + NumMembers<FeatureConfig>() + NumMembers<NoiseConfig>() + NumMembers<MatchingConfig>() +
                       NumMembers<InitialisationConfig>() + NumMembers<TrackingConfig>() +
                       NumMembers<KeyframeConfig>() + NumMembers<MappingConfig>() + NumMembers<DepthConfig>() +
                       NumMembers<MemoryConfig>() + NumMembers<RetrievalConfig>() + NumMembers<CommonAreaConfig>() +
                       NumMembers<RecognitionConfig>() + NumMembers<RelocalisationConfig>() +
                       NumMembers<MergingConfig>() + NumMembers<SchedulerConfig>() + NumMembers<RealTimeConfig>();
  EXPECT_EQ(static_cast<int>(EngineConfigFields().size()), expected);
}

TEST(EngineConfigTable, RowsReadAndWriteMembersOfTheirOwn) {
  // Each row moved to an end of its range, one after the other, changes its own value and no other.
  const std::vector<ConfigField> fields = EngineConfigFields();
  for (std::size_t i = 0; i < fields.size(); ++i) {
    EngineConfig config;
    const EngineConfig defaults;
    ConfigValue changed;
    switch (fields[i].type) {
      case ConfigType::kBool: changed = !std::get<bool>(fields[i].read(&config)); break;
      case ConfigType::kInteger: changed = static_cast<std::int64_t>(fields[i].range.max); break;
      case ConfigType::kNumber: changed = fields[i].range.max; break;
      case ConfigType::kChoice: changed = fields[i].choices.back(); break;
      case ConfigType::kText: changed = "a text that is no default"; break;
    }
    if (changed == fields[i].read(&defaults)) {
      changed = fields[i].type == ConfigType::kInteger ? ConfigValue(static_cast<std::int64_t>(fields[i].range.min))
                                                       : ConfigValue(fields[i].range.min);
    }
    fields[i].write(&config, changed);
    for (std::size_t j = 0; j < fields.size(); ++j) {
      EXPECT_EQ(fields[j].read(&config) != fields[j].read(&defaults), i == j) << fields[i].key << " " << fields[j].key;
    }
  }
}

TEST(EngineConfigTable, DefaultsAreAllowed) {
  const EngineConfig defaults;
  for (const ConfigField& field : EngineConfigFields()) {
    const Result<ConfigValue> value = field.Parse(ToText(field.read(&defaults)), false);
    EXPECT_TRUE(value.ok()) << field.key << ": " << value.status().ToString();
    EXPECT_FALSE(field.description.empty()) << field.key;
  }
  EXPECT_TRUE(CheckEngineConfig(defaults).ok());
}

TEST(EngineConfigTable, PrintedDefaultsAreAValidFile) {
  ConfigStore<EngineConfig> store(EngineConfigFields());
  const std::string printed = store.Print();
  const Status status = store.ApplyText(printed, "printed.yaml");
  EXPECT_TRUE(status.ok()) << status.ToString();
  EXPECT_EQ(store.origin("noise.k").kind, ConfigOrigin::Kind::kFile);
}

TEST(LoadEngineConfig, AssignmentsOverrideDefaults) {
  const auto store = LoadEngineConfig("", {"noise.k=2", "noise.sigma_0_px=5", "seed=42"});
  ASSERT_TRUE(store.ok()) << store.status().ToString();
  EXPECT_EQ(store->config().noise.k, 2.0);
  EXPECT_EQ(store->config().noise.sigma_0_px, 5.0);
  EXPECT_EQ(store->config().seed, 42u);
}

TEST(LoadEngineConfig, EveryPresetOfTheProjectLoads) {
  int num_presets = 0;
  for (const auto& entry : std::filesystem::directory_iterator(HAUSTRA_CONFIG_FOLDER)) {
    if (entry.path().extension() != ".yaml") continue;
    const auto store = LoadEngineConfig(entry.path().string(), {});
    EXPECT_TRUE(store.ok()) << store.status().ToString();
    ++num_presets;
  }
  EXPECT_GE(num_presets, 1);
}

TEST(LoadEngineConfig, ContradictionsAreRefused) {
  const struct {
    std::vector<std::string> assignments;
    const char* message;
  } cases[] = {
      {{"keyframes.min_spacing_ms=1200"}, "above keyframes.max_spacing_ms (1000)"},
      {{"initialisation.min_points=500", "features.max=400"}, "no map could ever start"},
      {{"noise.k=0", "noise.sigma_0_px=0"}, "must have some noise"},
      {{"retrieval.kind=vocabulary"}, "retrieval.vocabulary names no file"},
      {{"rt.tracking_cpus=2,x"}, "rt.tracking_cpus: '2,x': not a list of processors"},
      {{"rt.require=true", "rt.enabled=false"}, "rt.enabled is off"},
      {{"memory.max_keyframe_ids=1000"}, "below memory.max_keyframes (1500)"},
  };
  for (const auto& c : cases) {
    const auto store = LoadEngineConfig("", c.assignments);
    ASSERT_FALSE(store.ok());
    EXPECT_EQ(store.code(), StatusCode::kFailedPrecondition);
    EXPECT_THAT(store.status().message(), HasSubstr(c.message));
  }
}

}  // namespace
}  // namespace haustra
