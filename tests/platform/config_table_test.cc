#include "platform/config/config_table.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cstdint>
#include <filesystem>
#include <fstream>
#include <string>
#include <vector>

#include "engine/geometry/rng.h"

namespace haustra {
namespace {

using ::testing::HasSubstr;

struct Pump {
  double flow_ml_s = 1.5;
  int strokes = 3;
  bool is_on = false;
};
struct Lamp {
  std::int64_t level = 40;
  std::string colour = "white";
  std::string label;
};
struct Tower {
  std::uint64_t seed = 7;
  Pump pump;
  Lamp lamp;
};

std::vector<ConfigField> TowerFields() {
  constexpr ConfigReload kLive = ConfigReload::kLive;
  return {
      BindField<&Tower::seed>("seed", {0, 1000}, "", "of all", ConfigReload::kRestart),
      BindField<&Tower::pump, &Pump::flow_ml_s>("pump.flow_ml_s", {0.5, 20}, "ml/s", "of the jet", kLive),
      BindField<&Tower::pump, &Pump::strokes>("pump.strokes", {1, 10}, "strokes", "a second", kLive),
      BindField<&Tower::pump, &Pump::is_on>("pump.is_on", {}, "", "at the start", kLive),
      BindField<&Tower::lamp, &Lamp::level>("lamp.level", {-5, 100}, "%", "of full power", kLive),
      BindChoice<&Tower::lamp, &Lamp::colour>("lamp.colour", {"white", "nbi", "red"}, "of the light", kLive),
      BindText<&Tower::lamp, &Lamp::label>("lamp.label", "on the housing", kLive),
  };
}

ConfigStore<Tower> MakeStore() { return ConfigStore<Tower>(TowerFields()); }

// A folder of the test's own, removed with it.
class ConfigFolder {
 public:
  ConfigFolder() {
    std::string pattern = (std::filesystem::temp_directory_path() / "haustra_config_XXXXXX").string();
    path_ = mkdtemp(pattern.data());
  }
  ~ConfigFolder() { std::filesystem::remove_all(path_); }
  std::string Write(const std::string& name, const std::string& text) const {
    std::filesystem::create_directories((path_ / name).parent_path());
    std::ofstream(path_ / name) << text;
    return (path_ / name).string();
  }
  std::string Path(const std::string& name) const { return (path_ / name).string(); }

 private:
  std::filesystem::path path_;
};

TEST(ConfigTable, FileSetsWhatItNamesAndLeavesTheRest) {
  ConfigStore<Tower> store = MakeStore();
  const Status status = store.ApplyText(
      "# a comment\n"
      "pump:\n"
      "  flow_ml_s: 2   # an integer is a number too\n"
      "  is_on: true\n"
      "lamp: {level: -5, colour: nbi}\n"
      "seed: 11\n",
      "tower.yaml");
  ASSERT_TRUE(status.ok()) << status.ToString();
  EXPECT_EQ(store.config().pump.flow_ml_s, 2.0);
  EXPECT_EQ(store.config().pump.strokes, 3);
  EXPECT_TRUE(store.config().pump.is_on);
  EXPECT_EQ(store.config().lamp.level, -5);
  EXPECT_EQ(store.config().lamp.colour, "nbi");
  EXPECT_EQ(store.config().seed, 11u);
}

TEST(ConfigTable, EmptyFileGivesTheDefaults) {
  for (const char* text : {"", "# nothing\n", "\n\n"}) {
    ConfigStore<Tower> store = MakeStore();
    ASSERT_TRUE(store.ApplyText(text, "empty.yaml").ok());
    EXPECT_EQ(store.config().pump.strokes, 3);
    EXPECT_EQ(store.origin("pump.strokes").kind, ConfigOrigin::Kind::kDefault);
  }
}

struct BadText {
  const char* text;
  const char* position;
  const char* message;
};

class ConfigTableRefuses : public ::testing::TestWithParam<BadText> {};

TEST_P(ConfigTableRefuses, NamingFileLineColumnAndWhatIsAllowed) {
  ConfigStore<Tower> store = MakeStore();
  const Status status = store.ApplyText(GetParam().text, "bad.yaml");
  ASSERT_FALSE(status.ok());
  EXPECT_EQ(status.code(), StatusCode::kFailedPrecondition);
  EXPECT_THAT(status.message(), HasSubstr(std::string("bad.yaml:") + GetParam().position + ":"));
  EXPECT_THAT(status.message(), HasSubstr(GetParam().message));
  // All or nothing.
  EXPECT_EQ(store.config().seed, 7u);
  EXPECT_EQ(store.config().pump.flow_ml_s, 1.5);
  EXPECT_EQ(store.origin("seed").kind, ConfigOrigin::Kind::kDefault);
}

INSTANTIATE_TEST_SUITE_P(
    Texts, ConfigTableRefuses,
    ::testing::Values(BadText{"seed: 8\npump:\n  flow_ml_ss: 2\n", "3:3", "unknown key; did you mean pump.flow_ml_s?"},
                      BadText{"seed: 8\npump:\n  level: 2\n", "3:3", "did you mean lamp.level?"},
                      BadText{"lmap:\n  brightness: 2\n", "2:3", "lmap.brightness: unknown key"},
                      BadText{"pump: 5\n", "1:1", "pump: is a section, not a value"},
                      BadText{"seed: 8\npump:\n  strokes: 11\n", "3:12",
                              "pump.strokes: '11' is out of range; allowed: an integer from 1 to 10"},
                      BadText{"seed: 8\npump:\n  strokes: 2.5\n", "3:12",
                              "'2.5' is not an integer; allowed: an integer from 1 to 10"},
                      BadText{"pump:\n  strokes: many\n", "2:12", "'many' is not a number"},
                      BadText{"pump:\n  strokes: \"3\"\n", "2:12", "\"3\" is a string"},
                      BadText{"pump:\n  flow_ml_s: nan\n", "2:14", "is not finite; allowed: a number from 0.5 to 20"},
                      BadText{"pump:\n  flow_ml_s: 0.4999\n", "2:14", "out of range"},
                      BadText{"pump:\n  flow_ml_s: 1e400\n", "2:14", "is not a number"},
                      BadText{"pump:\n  is_on: yes\n", "2:10", "is neither true nor false"},
                      BadText{"lamp:\n  colour: blue\n", "2:11", "'blue' is not known; allowed: white, nbi or red"},
                      BadText{"seed: -1\n", "1:7", "out of range; allowed: an integer from 0 to 1000"},
                      BadText{"seed: 8\npump:\n  strokes: 2\nseed: 9\n", "4:1", "seed: duplicate key, first on line 1"},
                      BadText{"pump:\n  strokes: 2\nlamp:\n  level: 1\npump:\n  is_on: true\n", "5:1",
                              "pump: duplicate key, first on line 1"},
                      BadText{"pump:\n  strokes:\n", "2:3", "pump.strokes: has no value"},
                      BadText{"pump:\n  strokes: [1, 2]\n", "2:12", "lists are not allowed"},
                      BadText{"- 1\n- 2\n", "1:1", "lists are not allowed"},
                      BadText{"pump: &a\n  strokes: 2\n", "1:7", "anchors"}, BadText{"seed: &a 8\n", "1:7", "anchors"},
                      BadText{"seed: !!int 8\n", "1:7", "tags"},
                      BadText{"? [a, b]\n: 1\n", "1:3", "lists are not allowed"},
                      BadText{"? {a: 1}\n: 1\n", "1:3", "a map cannot be a key"},
                      BadText{"pump.strokes: 2\n", "1:1", "write sections as nested maps"},
                      BadText{"just text\n", "1:1", "expected 'section:' or 'key: value'"},
                      BadText{"seed: 8\n---\nseed: 9\n", "2:1", "one file holds one configuration"},
                      BadText{"pump:\n  strokes: 2\n bad indent: 3\n", "3:2", "not valid YAML"},
                      BadText{"pump: {strokes: 2\n", "2:1", "not valid YAML"}));

TEST(ConfigTable, AllProblemsOfAFileAreReportedAtOnce) {
  ConfigStore<Tower> store = MakeStore();
  const Status status = store.ApplyText("seed: x\npump:\n  strokes: 99\n  foo: 1\n", "bad.yaml");
  EXPECT_THAT(status.message(), HasSubstr("bad.yaml:1:7: seed"));
  EXPECT_THAT(status.message(), HasSubstr("bad.yaml:3:12: pump.strokes"));
  EXPECT_THAT(status.message(), HasSubstr("bad.yaml:4:3: pump.foo"));
}

TEST(ConfigTable, FarFetchedKeyGetsNoSuggestion) {
  EXPECT_EQ(MakeStore().table().NearestKey("completely.unrelated"), "");
  EXPECT_EQ(MakeStore().table().NearestKey("lamp.colr"), "lamp.colour");
}

TEST(ConfigTable, OriginsFollowTheLastWriter) {
  ConfigStore<Tower> store = MakeStore();
  ASSERT_TRUE(store.ApplyText("pump:\n  strokes: 5\n  is_on: true\n", "a.yaml").ok());
  ASSERT_TRUE(store.ApplyAssignment("pump.strokes=6").ok());
  EXPECT_EQ(store.origin("pump.strokes").ToString(), "command line: pump.strokes=6");
  EXPECT_EQ(store.origin("pump.is_on").ToString(), "a.yaml:3");
  EXPECT_EQ(store.origin("lamp.level").ToString(), "default");
  EXPECT_EQ(store.config().pump.strokes, 6);
}

TEST(ConfigTable, BadAssignmentsAreRefused) {
  for (const char* assignment :
       {"pump.strokes", "=3", "pump.strokes=", "pump.strokes=11", "pump.stroke=3", "pump=3", "preset=other.yaml"}) {
    ConfigStore<Tower> store = MakeStore();
    const Status status = store.ApplyAssignment(assignment);
    EXPECT_EQ(status.code(), StatusCode::kFailedPrecondition) << assignment;
    EXPECT_THAT(status.message(), HasSubstr("command line: "));
    EXPECT_EQ(store.config().pump.strokes, 3);
  }
}

TEST(ConfigTable, PrintedConfigurationIsAFileThatGivesTheSame) {
  ConfigStore<Tower> store = MakeStore();
  ASSERT_TRUE(
      store.ApplyText("pump:\n  flow_ml_s: 0.6180339887498949\nlamp: {colour: red, level: -3}\n", "a.yaml").ok());
  ASSERT_TRUE(store.ApplyAssignment("pump.is_on=true").ok());
  const std::string printed = store.Print();
  EXPECT_THAT(printed, HasSubstr("  flow_ml_s: 0.6180339887498949  # a.yaml:2\n"));

  ConfigStore<Tower> again = MakeStore();
  const Status status = again.ApplyText(printed, "printed.yaml");
  ASSERT_TRUE(status.ok()) << status.ToString() << '\n' << printed;
  EXPECT_EQ(again.config().pump.flow_ml_s, store.config().pump.flow_ml_s);
  EXPECT_EQ(again.config().lamp.colour, "red");
  EXPECT_EQ(again.config().lamp.level, -3);
  EXPECT_TRUE(again.config().pump.is_on);
  for (const ConfigField& field : again.table().fields()) {
    EXPECT_EQ(again.origin(field.key).kind, ConfigOrigin::Kind::kFile) << field.key;
  }
}

TEST(ConfigTable, TextIsTakenAsItStandsAndPrintedInQuotes) {
  for (const std::string text : {"", "a file's name.bin", "12", "true", "# : 'x' \\\"", "\xc3\xa4"}) {
    ConfigStore<Tower> store = MakeStore();
    ASSERT_TRUE(store.ApplyAssignment("lamp.label=" + text).ok());
    EXPECT_EQ(store.config().lamp.label, text);
    ConfigStore<Tower> again = MakeStore();
    const Status status = again.ApplyText(store.Print(), "printed.yaml");
    ASSERT_TRUE(status.ok()) << status.ToString();
    EXPECT_EQ(again.config().lamp.label, text);
  }
  ConfigStore<Tower> store = MakeStore();
  EXPECT_THAT(store.ApplyAssignment("lamp.label=a\nb").message(), HasSubstr("control character"));
  EXPECT_THAT(store.Reference(), HasSubstr("| `lamp.label` | '' | any text on one line |"));
}

TEST(ConfigTable, PresetAppliesFirstAndKeepsItsOrigin) {
  const ConfigFolder folder;
  const std::string preset = folder.Write("presets/base.yaml", "pump:\n  strokes: 9\n  is_on: true\n");
  const std::string path = folder.Write("site.yaml", "pump:\n  strokes: 4\npreset: presets/base.yaml\n");
  ConfigStore<Tower> store = MakeStore();
  const Status status = store.ApplyFile(path);
  ASSERT_TRUE(status.ok()) << status.ToString();
  EXPECT_EQ(store.config().pump.strokes, 4);
  EXPECT_TRUE(store.config().pump.is_on);
  EXPECT_EQ(store.origin("pump.strokes").ToString(), path + ":2");
  EXPECT_EQ(store.origin("pump.is_on").ToString(), preset + ":3");
}

TEST(ConfigTable, BrokenOrCircularPresetIsRefusedNamingBothFiles) {
  const ConfigFolder folder;
  folder.Write("base.yaml", "pump:\n  strokes: 90\n");
  const std::string path = folder.Write("site.yaml", "seed: 8\npreset: base.yaml\n");
  ConfigStore<Tower> store = MakeStore();
  Status status = store.ApplyFile(path);
  EXPECT_EQ(status.code(), StatusCode::kFailedPrecondition);
  EXPECT_THAT(status.message(), HasSubstr("site.yaml:2:9: preset:\n"));
  EXPECT_THAT(status.message(), HasSubstr("base.yaml:2:12: pump.strokes"));
  EXPECT_EQ(store.config().seed, 7u);

  status = store.ApplyFile(folder.Write("circle.yaml", "preset: circle.yaml\n"));
  EXPECT_EQ(status.code(), StatusCode::kFailedPrecondition);
  EXPECT_THAT(status.message(), HasSubstr("circle"));

  status = store.ApplyFile(folder.Write("orphan.yaml", "preset: nowhere.yaml\n"));
  EXPECT_EQ(status.code(), StatusCode::kNotFound);
  EXPECT_THAT(status.message(), HasSubstr("nowhere.yaml"));
}

TEST(ConfigTable, MissingFileAndFolderAreToldApart) {
  const ConfigFolder folder;
  ConfigStore<Tower> store = MakeStore();
  const Status missing = store.ApplyFile(folder.Path("none.yaml"));
  EXPECT_EQ(missing.code(), StatusCode::kNotFound);
  EXPECT_EQ(missing.message(), folder.Path("none.yaml") + ": no such file");
  const Status is_folder = store.ApplyFile(folder.Path(""));
  EXPECT_EQ(is_folder.code(), StatusCode::kDataLoss);
  EXPECT_EQ(is_folder.message(), folder.Path("") + ": is a folder, not a file");
}

TEST(ConfigTable, ReferenceNamesEveryKeyWithItsDefault) {
  const std::string page = MakeStore().Reference();
  EXPECT_THAT(page, HasSubstr("| `pump.flow_ml_s` | 1.5 | a number from 0.5 to 20 | ml/s | live | of the jet |"));
  EXPECT_THAT(page, HasSubstr("| `seed` | 7 | an integer from 0 to 1000 |  | restart | of all |"));
  EXPECT_THAT(page, HasSubstr("| `lamp.colour` | white | white, nbi or red |"));
}

// Whatever the bytes, the answer is ok or a message, and never another configuration than a valid one.
TEST(ConfigTable, DamagedTextsAreRefusedOrValid) {
  const std::string good = "seed: 8\npump:\n  flow_ml_s: 2.5\n  strokes: 4 # x\nlamp: {level: 3, colour: 'nbi'}\n";
  const std::string alphabet = "\n\t :#-{}[]&*!|>'\"%@`,?~\\.0a\xff\xc3";
  Rng rng(20);
  int num_refused = 0;
  for (int round = 0; round < 3000; ++round) {
    std::string text = good;
    for (int edits = 1 + static_cast<int>(rng.UniformInt(4)); edits > 0; --edits) {
      const std::size_t at = rng.UniformInt(static_cast<std::uint32_t>(text.size()));
      const char c = alphabet[rng.UniformInt(static_cast<std::uint32_t>(alphabet.size()))];
      switch (rng.UniformInt(3)) {
        case 0: text[at] = c; break;
        case 1: text.insert(at, 1, c); break;
        default: text.erase(at, 1); break;
      }
    }
    ConfigStore<Tower> store = MakeStore();
    const Status status = store.ApplyText(text, "damaged.yaml");
    num_refused += !status.ok();
    if (!status.ok()) {
      EXPECT_THAT(status.message(), HasSubstr("damaged.yaml")) << text;
    }
    EXPECT_GE(store.config().pump.strokes, 1);
    EXPECT_LE(store.config().pump.strokes, 10);
  }
  EXPECT_GT(num_refused, 1000);
}

TEST(ConfigTable, DeepOrHugeTextsAreRefused) {
  ConfigStore<Tower> store = MakeStore();
  std::string deep;
  for (int i = 0; i < 5000; ++i) deep += "{a: ";
  EXPECT_EQ(store.ApplyText(deep, "deep.yaml").code(), StatusCode::kFailedPrecondition);
  EXPECT_EQ(store.ApplyText(std::string(2 << 20, '#'), "huge.yaml").code(), StatusCode::kFailedPrecondition);
}

}  // namespace
}  // namespace haustra
