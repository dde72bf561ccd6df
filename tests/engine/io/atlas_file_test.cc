// Atlas files: saved and loaded again nothing is lost, and nothing that is not whole, consistent and fitting gets in.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <functional>
#include <limits>

#include "engine/atlas/invariants.h"
#include "engine/io/atlas_format.h"
#include "tests/engine/io/sealed_file.h"
#include "tests/engine/io/small_atlas.h"

namespace haustra::test {
namespace {

using ::testing::AllOf;
using ::testing::HasSubstr;

constexpr double kNan = std::numeric_limits<double>::quiet_NaN();

std::string SmallFile() {
  AtlasHome home;
  home.FillSmall();
  return home.Save();
}

// Refused, and the atlas and the device as they were.
Status RefusalOf(std::span<const std::uint8_t> file) {
  static AtlasHome home;
  const Status status = home.Load(file);
  EXPECT_FALSE(status.ok());
  EXPECT_EQ(home.atlas.counters().next_map_id, 0u);
  EXPECT_EQ(home.atlas.keyframes().size(), 0u);
  EXPECT_EQ(home.device.num_free_feature_sets(), home.device.plan().max_feature_sets);
  return status;
}

const Keyframe& ById(const Atlas& atlas, KeyframeId id) { return atlas.keyframe(atlas.FindById(id)); }

TEST(AtlasFile, SavedLoadedAndSavedAgainIsTheSameToTheByte) {
  const std::string file = SmallFile();
  AtlasHome home;
  const Status status = home.Load(BytesOf(file));
  ASSERT_TRUE(status.ok()) << status.ToString();
  EXPECT_EQ(CheckInvariants(home.atlas).ToString(), "ok");
  EXPECT_EQ(home.Save(), file);
}

TEST(AtlasFile, EmptyAtlasIsSavedAndLoaded) {
  AtlasHome home, other;
  const std::string file = home.Save();
  ASSERT_TRUE(other.Load(BytesOf(file)).ok());
  EXPECT_EQ(other.Save(), file);
}

TEST(AtlasFile, LoadedAtlasHasAllThatWasSaved) {
  AtlasHome home, other;
  home.FillSmall();
  std::vector<KeyframeHandle> handles;
  ASSERT_TRUE(other.Load(BytesOf(home.Save()), &handles).ok());

  // The dropped map and the merged one are gone; the others are stored, loaded and have their keyframes.
  std::vector<MapId> ids;
  other.atlas.maps().ForEach([&](MapHandle, const Map& map) {
    ids.push_back(map.id);
    EXPECT_EQ(map.status, MapStatus::kStored);
    EXPECT_TRUE(map.is_loaded);
  });
  EXPECT_EQ(ids, (std::vector<MapId>{0, 3}));
  EXPECT_EQ(other.atlas.keyframes().size(), home.atlas.keyframes().size());
  EXPECT_EQ(other.atlas.points().size(), home.atlas.points().size());
  ASSERT_EQ(handles.size(), 5u);
  EXPECT_TRUE(std::is_sorted(handles.begin(), handles.end(), [&](KeyframeHandle a, KeyframeHandle b) {
    return other.atlas.keyframe(a).id < other.atlas.keyframe(b).id;
  }));

  home.atlas.keyframes().ForEach([&](KeyframeHandle handle, const Keyframe& a) {
    const Keyframe& b = ById(other.atlas, a.id);
    EXPECT_EQ(a.id, b.id);
    EXPECT_EQ(a.frame_index, b.frame_index);
    EXPECT_EQ(a.timestamp, b.timestamp);
    EXPECT_EQ(a.cam_from_map.rotation.coeffs(), b.cam_from_map.rotation.coeffs());
    EXPECT_EQ(a.cam_from_map.translation, b.cam_from_map.translation);
    EXPECT_EQ(home.atlas.KeyframeScale(handle), other.atlas.ScaleOfKeyframe(a.id));
    ASSERT_EQ(a.features.num, b.features.num);
    EXPECT_EQ(a.num_points, b.num_points);
    std::vector<std::uint8_t> bytes_a(static_cast<std::size_t>(a.features.num) * kDescriptorBytes), bytes_b(bytes_a);
    ASSERT_TRUE(home.device.ReadDescriptors(a.features.set, bytes_a).ok());
    ASSERT_TRUE(other.device.ReadDescriptors(b.features.set, bytes_b).ok());
    EXPECT_EQ(bytes_a, bytes_b);
    for (int i = 0; i < a.features.num; ++i) {
      EXPECT_EQ(a.features.pixel(i), b.features.pixel(i));
      EXPECT_EQ(a.features.keypoints[i].octave, b.features.keypoints[i].octave);
      EXPECT_EQ(a.features.bearings[i], b.features.bearings[i]);
      ASSERT_EQ(a.points[i].is_valid(), b.points[i].is_valid());
      if (!a.points[i]) continue;
      const MapPoint& p = home.atlas.point(a.points[i]);
      const MapPoint& q = other.atlas.point(b.points[i]);
      EXPECT_EQ(p.id, q.id);
      EXPECT_EQ(p.position, q.position);
      EXPECT_EQ(p.normal, q.normal);
      EXPECT_EQ(p.scale_times_distance, q.scale_times_distance);
      EXPECT_EQ(p.first_keyframe_id, q.first_keyframe_id);
      EXPECT_EQ(p.descriptor.feature_idx, q.descriptor.feature_idx);
      ASSERT_EQ(p.observations.size(), q.observations.size());
      for (std::size_t k = 0; k < p.observations.size(); ++k) {
        EXPECT_EQ(home.atlas.keyframe(p.observations[k].keyframe).id,
                  other.atlas.keyframe(q.observations[k].keyframe).id);
        EXPECT_EQ(p.observations[k].feature_idx, q.observations[k].feature_idx);
      }
    }
  });
  // Covisibility follows from the observations.
  for (const KeyframeId id : {0u, 1u}) {
    std::vector<Covisible> a, b;
    home.atlas.FindCovisible(home.atlas.FindById(id), 1, &a);
    other.atlas.FindCovisible(other.atlas.FindById(id), 1, &b);
    ASSERT_EQ(a.size(), b.size());
    for (std::size_t i = 0; i < a.size(); ++i) EXPECT_EQ(a[i].num_shared, b[i].num_shared);
  }
}

// Frames tracked against a keyframe that was culled keep their final poses.
TEST(AtlasFile, TrajectoriesOfEarlierRunsResolveAsBefore) {
  AtlasHome home, other;
  home.FillSmall();
  ASSERT_TRUE(other.Load(BytesOf(home.Save())).ok());
  const SE3 cam_from_reference(ExpSO3({0.1, 0.0, 0.2}), Eigen::Vector3d(0.1, 0.2, 0.3));
  for (KeyframeId id = 0; id < home.atlas.num_keyframe_ids(); ++id) {
    ResolvedPose a, b;
    const bool resolves = home.atlas.Resolve(id, cam_from_reference, 1.25, &a);
    ASSERT_EQ(resolves, other.atlas.Resolve(id, cam_from_reference, 1.25, &b)) << id;
    EXPECT_EQ(resolves, id != 4) << "the map of keyframe 4 was dropped";
    if (!resolves) continue;
    EXPECT_EQ(a.map_id, b.map_id);
    EXPECT_EQ(a.cam_from_map.translation, b.cam_from_map.translation);
    EXPECT_EQ(a.cam_from_map.rotation.coeffs(), b.cam_from_map.rotation.coeffs());
  }
}

TEST(AtlasFile, NewKeyframesAreOfANewSessionAndShareNoIds) {
  AtlasHome home, other;
  home.FillSmall();
  ASSERT_TRUE(other.Load(BytesOf(home.Save())).ok());
  EXPECT_EQ(other.atlas.session(), 1u);
  const MapHandle map = other.atlas.CreateMap();
  EXPECT_EQ(other.atlas.map(map).id, 4u);
  EXPECT_FALSE(other.atlas.map(map).is_loaded);
  // The very frame numbers and times of the first run.
  const KeyframeHandle a = other.AddKeyframe(map, 3, SE3{});
  const KeyframeHandle b = other.AddKeyframe(map, 7, SE3{});
  other.AddPoint(map, {0.0, 0.0, 3.0}, {{a, 0}, {b, 0}});
  EXPECT_EQ(other.atlas.keyframe(a).id, home.atlas.num_keyframe_ids());
  EXPECT_TRUE(other.atlas.IsOfThisSession(other.atlas.keyframe(a).id));
  for (KeyframeId id = 0; id < home.atlas.num_keyframe_ids(); ++id) EXPECT_FALSE(other.atlas.IsOfThisSession(id));

  AtlasHome third;
  const std::string file = other.Save();
  ASSERT_TRUE(third.Load(BytesOf(file)).ok());
  EXPECT_EQ(third.atlas.session(), 2u);
  EXPECT_EQ(ById(third.atlas, 0).session, 0u);
  EXPECT_EQ(ById(third.atlas, home.atlas.num_keyframe_ids()).session, 1u);
  EXPECT_EQ(third.Save(), file);
}

// The only keyframes of the second session were culled; their frames still count as its own.
TEST(AtlasFile, SessionOfWhichOnlyCulledKeyframesAreLeftIsCounted) {
  AtlasHome home, other, third;
  home.FillSmall();
  ASSERT_TRUE(other.Load(BytesOf(home.Save())).ok());
  const KeyframeHandle stand_in = other.atlas.FindById(0);
  const KeyframeHandle culled = other.AddKeyframe(other.atlas.keyframe(stand_in).map, 50, SE3{});
  const KeyframeId id = other.atlas.keyframe(culled).id;
  other.Cull(culled, stand_in);
  const std::string file = other.Save();
  const Status status = third.Load(BytesOf(file));
  ASSERT_TRUE(status.ok()) << status.ToString();
  EXPECT_EQ(third.atlas.session(), 2u);
  EXPECT_EQ(third.atlas.TraceOfKeyframe(id).session, 1u);
  EXPECT_EQ(third.atlas.FrameOfKeyframe(id), 50u);
  EXPECT_EQ(third.Save(), file);
}

// Long random histories of everything that the mapper does to an atlas.
TEST(AtlasFile, AnyAtlasSurvivesTheRoundTrip) {
  constexpr Atlas::Capacity kCapacity{60, 400, 40, 400, AtlasHome::kFeatures};
  for (std::uint64_t seed = 1; seed <= 20; ++seed) {
    AtlasHome home(kCapacity, 64);
    Rng rng(seed);
    const auto pick = [&](std::size_t size) {
      return static_cast<std::size_t>(rng.Uniform() * static_cast<double>(size));
    };
    std::vector<MapHandle> maps = {home.atlas.CreateMap()};
    for (int step = 0; step < 300; ++step) {
      const MapHandle map = maps[pick(maps.size())];
      const auto keyframes = home.atlas.map(map).keyframes;
      const double choice = rng.Uniform();
      if (choice < 0.3 && home.atlas.keyframes().size() < 50) {
        home.AddKeyframe(map, static_cast<std::uint32_t>(step), RandomPose(rng, 1.0, 2.0));
      } else if (choice < 0.75 && keyframes.size() >= 3) {
        const MapPointHandle point =
            home.atlas.AddPoint(map, GaussianVector(rng, 3.0), home.atlas.keyframe(keyframes[0]).id);
        if (!point) continue;
        for (std::size_t k = 0; k < 4; ++k) {
          home.atlas.AddObservation(point, keyframes[pick(keyframes.size())],
                                    static_cast<int>(pick(AtlasHome::kFeatures)));
        }
        if (home.atlas.point(point).observations.size() < 2) {
          home.atlas.RemovePoint(point);
        } else {
          home.atlas.UpdatePoint(point);
        }
      } else if (choice < 0.85 && keyframes.size() >= 3) {
        home.Cull(keyframes[pick(keyframes.size() - 1)], keyframes.back());
      } else if (choice < 0.9) {
        home.atlas.TransformMap(map, Sim3(rng.Uniform(0.5, 2.0), RandomRotation(rng, 2.0), GaussianVector(rng, 1.0)));
      } else if (choice < 0.94) {
        maps.push_back(home.atlas.CreateMap());
      } else if (choice < 0.97 && maps.size() >= 2) {
        const MapHandle into = maps[pick(maps.size())];
        if (into == map) continue;
        home.atlas.AbsorbMap(into, map);
        std::erase(maps, map);
      } else if (choice > 0.985 && maps.size() >= 2) {
        std::vector<FeatureSetHandle> released;
        home.atlas.DropMap(map, &released);
        for (const FeatureSetHandle set : released) home.device.ReleaseFeatureSet(set);
        std::erase(maps, map);
      }
    }
    ASSERT_EQ(CheckInvariants(home.atlas).ToString(), "ok");
    const std::string file = home.Save();
    AtlasHome other(kCapacity, 64);
    const Status status = other.Load(BytesOf(file));
    ASSERT_TRUE(status.ok()) << "seed " << seed << ": " << status.ToString();
    ASSERT_EQ(CheckInvariants(other.atlas).ToString(), "ok");
    EXPECT_EQ(other.Save(), file) << "seed " << seed;
    for (KeyframeId id = 0; id < home.atlas.num_keyframe_ids(); ++id) {
      ResolvedPose a, b;
      ASSERT_EQ(home.atlas.Resolve(id, SE3{}, 1.0, &a), other.atlas.Resolve(id, SE3{}, 1.0, &b));
      EXPECT_EQ(a.cam_from_map.translation, b.cam_from_map.translation);
    }
  }
}

TEST(AtlasFile, EveryDamagedByteIsFound) {
  RecordProperty("req", "DMN-005");
  std::vector<std::uint8_t> file = BytesOf(SmallFile());
  for (std::size_t i = 0; i < file.size(); ++i) {
    for (const int pattern : {0x01, 0x80, 0xff}) {
      file[i] ^= static_cast<std::uint8_t>(pattern);
      ASSERT_FALSE(ReadAtlas(file).ok()) << "byte " << i << " changed by " << pattern;
      file[i] ^= static_cast<std::uint8_t>(pattern);
    }
  }
  EXPECT_TRUE(ReadAtlas(file).ok());
}

TEST(AtlasFile, DamageIsDataLossAndNamesSectionAndOffset) {
  std::vector<std::uint8_t> file = BytesOf(SmallFile());
  const std::string text(file.begin(), file.end());
  const std::size_t section = text.find("KEYF");
  file[section + 40] ^= 4;
  const Status status = RefusalOf(file);
  EXPECT_EQ(status.code(), StatusCode::kDataLoss);
  EXPECT_THAT(status.message(),
              AllOf(HasSubstr("'KEYF'"), HasSubstr("at byte " + std::to_string(section)), HasSubstr("checksum")));
}

TEST(AtlasFile, FileCutAnywhereIsRefused) {
  const std::vector<std::uint8_t> file = BytesOf(SmallFile());
  for (std::size_t size = 0; size < file.size(); ++size) {
    ASSERT_FALSE(ReadAtlas(std::span(file).first(size)).ok()) << size << " bytes";
  }
  EXPECT_EQ(RefusalOf(std::span(file).first(file.size() - 1)).code(), StatusCode::kDataLoss);
}

TEST(AtlasFile, BytesAfterTheEndAreRefused) {
  std::vector<std::uint8_t> file = BytesOf(SmallFile());
  file.push_back(0);
  EXPECT_THAT(RefusalOf(file).message(), HasSubstr("1 bytes follow"));
}

TEST(AtlasFile, OtherFilesAreNotTakenForOne) {
  for (const std::string text : {"", "x", "\x89PNG\r\n\x1a\n and so on", "# a configuration\n"}) {
    EXPECT_EQ(RefusalOf(BytesOf(text)).code(), StatusCode::kInvalidArgument);
  }
}

TEST(AtlasFile, OtherVersionIsRefusedByNumber) {
  std::vector<std::uint8_t> file = BytesOf(SmallFile());
  file[8] = 2;
  SealFile(file);
  const Status status = RefusalOf(file);
  EXPECT_EQ(status.code(), StatusCode::kFailedPrecondition);
  EXPECT_THAT(status.message(), AllOf(HasSubstr("version 2"), HasSubstr("version 1")));
}

// Each section is whole here: what is wrong is which sections there are.
TEST(AtlasFile, SectionsMissingDoubledMovedOrOfAnotherFileAreFound) {
  const std::string file = SmallFile();
  const std::vector<std::string> sections = SplitSections(file);
  const auto join = [](const std::vector<std::string>& parts) {
    std::string text;
    for (const std::string& part : parts) text += part;
    return BytesOf(text);
  };
  ASSERT_EQ(join(sections), BytesOf(file));
  AtlasHome other;
  other.FillSmall();
  other.atlas.keyframe(other.atlas.FindById(1)).cam_from_map.translation.x() += 1.0;
  const std::vector<std::string> others = SplitSections(other.Save());
  ASSERT_EQ(others.size(), sections.size());
  int num_other = 0;
  for (std::size_t i = 1; i < sections.size(); ++i) {
    std::vector<std::string> changed = sections;
    changed.erase(changed.begin() + static_cast<std::ptrdiff_t>(i));
    EXPECT_FALSE(RefusalOf(join(changed)).ok());
    changed = sections;
    changed.insert(changed.begin() + static_cast<std::ptrdiff_t>(i), sections[i]);
    EXPECT_FALSE(RefusalOf(join(changed)).ok());
    // The checksums of all sections made right again: doubling and removing are found by what the sections say, too.
    std::vector<std::uint8_t> sealed = join(changed);
    SealFile(sealed);
    EXPECT_FALSE(RefusalOf(sealed).ok());
    if (i + 1 < sections.size()) {
      changed = sections;
      std::swap(changed[i], changed[i + 1]);
      EXPECT_FALSE(RefusalOf(join(changed)).ok());
    }
    if (others[i] != sections[i]) {
      ++num_other;
      changed = sections;
      changed[i] = others[i];
      EXPECT_FALSE(RefusalOf(join(changed)).ok());
    }
  }
  EXPECT_EQ(num_other, 2);  // the keyframe that differs, and the end that counts the checksums
}

TEST(AtlasFile, OtherCameraIsRefusedByWhatDiffers) {
  const std::vector<std::uint8_t> file = BytesOf(SmallFile());
  const SavedAtlas saved = ReadAtlas(file).value();
  const auto load_with = [&](const std::function<void(CameraCalibration&)>& change) {
    AtlasHome home;
    CameraCalibration calibration = home.camera.calibration();
    change(calibration);
    const Status status =
        RestoreAtlas(saved, CameraModel::Create(calibration).value(), false, home.device, &home.atlas, nullptr);
    EXPECT_EQ(home.atlas.keyframes().size() > 0, status.ok());
    return status;
  };
  EXPECT_THAT(load_with([](CameraCalibration& c) { c.fx += 0.5; }).message(), HasSubstr("fx"));
  EXPECT_THAT(load_with([](CameraCalibration& c) { c.coefficients[1] += 1e-3; }).message(), HasSubstr("coefficient 2"));
  EXPECT_THAT(load_with([](CameraCalibration& c) { c.width_px += 8; }).message(), HasSubstr("720x540"));
  EXPECT_THAT(load_with([](CameraCalibration& c) {
                c.kind = CameraModelKind::kPinhole;
                c.coefficients = {};
              }).message(),
              HasSubstr("Kannala-Brandt"));
  EXPECT_EQ(load_with([](CameraCalibration& c) { c.cy -= 1.0; }).code(), StatusCode::kFailedPrecondition);
  // The frame rate has no part in the geometry.
  EXPECT_TRUE(load_with([](CameraCalibration& c) { c.rate_hz = 50.0; }).ok());
}

TEST(AtlasFile, OtherDescriptorsAreRefused) {
  const std::vector<std::uint8_t> file = BytesOf(SmallFile());
  AtlasHome home;
  const Status status = RestoreAtlas(ReadAtlas(file).value(), home.camera, true, home.device, &home.atlas, nullptr);
  EXPECT_EQ(status.code(), StatusCode::kFailedPrecondition);
  EXPECT_THAT(status.message(), HasSubstr("features.root_sift"));
}

TEST(AtlasFile, PoolThatIsTooSmallIsNamedWithItsSize) {
  const std::vector<std::uint8_t> file = BytesOf(SmallFile());
  struct Case {
    Atlas::Capacity capacity;
    int num_sets;
    const char* message;
  };
  constexpr int kF = AtlasHome::kFeatures;
  for (const Case& c : {Case{{4, 64, 8, 64, kF}, 16, "5 keyframes (memory.max_keyframes) needed, room for 4"},
                        Case{{16, 4, 8, 64, kF}, 16, "5 map points (memory.max_map_points) needed, room for 4"},
                        Case{{16, 64, 1, 64, kF}, 16, "2 maps (memory.max_maps) needed, room for 1"},
                        Case{{16, 64, 8, 7, kF}, 16, "8 keyframe ids (memory.max_keyframe_ids) needed, room for 7"},
                        Case{{16, 64, 8, 64, 5}, 16, "6 features of a keyframe (features.max) needed, room for 5"},
                        Case{{16, 64, 8, 64, kF}, 4, "5 feature sets of the vision device needed, room for 4"}}) {
    AtlasHome home(c.capacity, c.num_sets);
    const Status status = home.Load(file);
    EXPECT_EQ(status.code(), StatusCode::kCapacityExceeded);
    EXPECT_THAT(status.message(), HasSubstr(c.message));
    EXPECT_EQ(home.atlas.counters().next_map_id, 0u);
    EXPECT_EQ(home.device.num_free_feature_sets(), c.num_sets);
  }
  AtlasHome just_enough({5, 5, 2, 8, kF}, 5);
  EXPECT_TRUE(just_enough.Load(file).ok());
}

TEST(AtlasFile, AtlasThatHeldSomethingTakesNoFile) {
  const std::vector<std::uint8_t> file = BytesOf(SmallFile());
  AtlasHome home;
  home.atlas.CreateMap();
  EXPECT_EQ(home.Load(file).code(), StatusCode::kFailedPrecondition);
  EXPECT_EQ(home.atlas.keyframes().size(), 0u);
}

TEST(AtlasFile, DeviceThatRefusesLeavesNothingBehind) {
  const std::vector<std::uint8_t> file = BytesOf(SmallFile());
  SavedAtlas saved = ReadAtlas(file).value();
  saved.keyframes[3].descriptors = saved.keyframes[3].descriptors.first(kDescriptorBytes);
  AtlasHome home;
  EXPECT_FALSE(RestoreAtlas(saved, home.camera, false, home.device, &home.atlas, nullptr).ok());
  EXPECT_EQ(home.atlas.keyframes().size(), 0u);
  EXPECT_EQ(home.device.num_free_feature_sets(), 16);
}

std::string MarkedFile() {
  AtlasHome home;
  home.FillMarked();
  return home.Save();
}

TEST(AtlasFile, NewRunBeginsWithIdsWithoutGaps) {
  const std::vector<std::uint8_t> file = BytesOf(SmallFile());
  SavedAtlas saved = ReadAtlas(file).value();
  const SavedAtlas before = saved;
  RenumberKeyframes(&saved);
  EXPECT_EQ(CheckSavedAtlas(saved).ToString(), "ok");
  ASSERT_EQ(saved.keyframes.size(), before.keyframes.size());
  EXPECT_EQ(saved.counters.next_keyframe_id, saved.keyframes.size());
  EXPECT_LT(saved.counters.next_keyframe_id, before.counters.next_keyframe_id);
  EXPECT_TRUE(saved.traces.empty());
  EXPECT_EQ(saved.counters.session, before.counters.session);
  for (std::size_t i = 0; i < saved.keyframes.size(); ++i) {
    EXPECT_EQ(saved.keyframes[i].id, i);
    EXPECT_EQ(saved.keyframes[i].frame_index, before.keyframes[i].frame_index);
  }
  // Who was made by a keyframe that is there still is; the others in the order that they had.
  for (std::size_t i = 0; i < saved.points.size(); ++i) {
    const KeyframeId now = saved.points[i].first_keyframe_id, then = before.points[i].first_keyframe_id;
    ASSERT_LT(now, saved.keyframes.size());
    EXPECT_GE(before.keyframes[now].id, std::min(then, before.keyframes.back().id));
    if (now > 0) {
      EXPECT_LT(before.keyframes[now - 1].id, then);
    }
  }
  AtlasHome home({16, 64, 8, 5, AtlasHome::kFeatures, 4});
  EXPECT_EQ(RestoreAtlas(saved, home.camera, false, home.device, &home.atlas, nullptr).ToString(), "ok");
  EXPECT_EQ(CheckInvariants(home.atlas).ToString(), "ok");
}

TEST(AtlasFile, MarksAreSavedAndLoaded) {
  AtlasHome home, other;
  home.FillMarked();
  const std::string file = home.Save();
  const Status status = other.Load(BytesOf(file));
  ASSERT_TRUE(status.ok()) << status.ToString();
  EXPECT_EQ(CheckInvariants(other.atlas).ToString(), "ok");
  EXPECT_EQ(other.Save(), file);
  EXPECT_EQ(other.atlas.marks().size(), 2u);
  for (const char* label : {"polyp-1", "a"}) {
    const Mark& before = home.atlas.marks().At(home.atlas.FindMark(label));
    const Mark& after = other.atlas.marks().At(other.atlas.FindMark(label));
    EXPECT_EQ(after.id, before.id);
    EXPECT_EQ(after.session, 0u);
    EXPECT_EQ(after.frame_index, 8u);
    EXPECT_EQ(after.timestamp, before.timestamp);
    EXPECT_EQ(other.atlas.PlaceOf(after).position, home.atlas.PlaceOf(before).position);
    EXPECT_EQ(other.atlas.PlaceOf(after).normal, home.atlas.PlaceOf(before).normal);
    EXPECT_EQ(other.atlas.PlaceOf(after).radius, home.atlas.PlaceOf(before).radius);
  }
  // The id of the one that was removed is not given again.
  const MarkHandle next = other.AddMark("next", other.atlas.FindById(0), {0.0, 0.0, 3.0});
  EXPECT_EQ(other.atlas.marks().At(next).id, 3u);
}

TEST(AtlasFile, AtlasWithoutMarksHasNoSectionForThem) {
  EXPECT_EQ(SmallFile().find(kMarksTag), std::string::npos);
  EXPECT_NE(MarkedFile().find(kMarksTag), std::string::npos);
}

TEST(AtlasFile, EveryDamagedByteOfMarksIsFound) {
  std::vector<std::uint8_t> file = BytesOf(MarkedFile());
  const std::string text(file.begin(), file.end());
  for (std::size_t i = text.find(kMarksTag); i < file.size(); ++i) {
    for (const int pattern : {0x01, 0x80, 0xff}) {
      file[i] ^= static_cast<std::uint8_t>(pattern);
      ASSERT_FALSE(ReadAtlas(file).ok()) << "byte " << i << " changed by " << pattern;
      file[i] ^= static_cast<std::uint8_t>(pattern);
    }
  }
  EXPECT_TRUE(ReadAtlas(file).ok());
}

TEST(AtlasFile, MarksThatFindNoRoomAreRefusedWithTheFile) {
  AtlasHome home({16, 64, 8, 64, AtlasHome::kFeatures, 1});
  const Status status = home.Load(BytesOf(MarkedFile()));
  EXPECT_EQ(status.code(), StatusCode::kCapacityExceeded);
  EXPECT_THAT(status.message(), HasSubstr("2 marks (memory.max_marks) needed, room for 1"));
  EXPECT_EQ(home.atlas.keyframes().size(), 0u);
}

TEST(AtlasFile, MarksThatAreNoneAreRefused) {
  const std::vector<std::uint8_t> file = BytesOf(MarkedFile());
  const SavedAtlas sound = ReadAtlas(file).value();
  ASSERT_EQ(sound.marks.size(), 2u);
  const auto refusal = [&](const std::function<void(SavedAtlas&)>& change) {
    SavedAtlas changed = sound;
    change(changed);
    const Status status = CheckSavedAtlas(changed);
    EXPECT_EQ(status.code(), StatusCode::kDataLoss);
    EXPECT_THAT(status.message(), HasSubstr("'MARK'"));
    return status.message();
  };
  EXPECT_THAT(refusal([](SavedAtlas& s) { s.marks.resize(33, s.marks[0]); }), HasSubstr("33 marks, at most 32"));
  EXPECT_THAT(refusal([](SavedAtlas& s) { s.marks[1].id = 3; }), HasSubstr("ids end at 3"));
  EXPECT_THAT(refusal([](SavedAtlas& s) { s.marks[1].id = s.marks[0].id; }), HasSubstr("doubled"));
  EXPECT_THAT(refusal([](SavedAtlas& s) { s.marks[0].label = MarkLabel(); }), HasSubstr("its label is none"));
  EXPECT_THAT(refusal([](SavedAtlas& s) { s.marks[1].label = s.marks[0].label; }), HasSubstr("has its label"));
  EXPECT_THAT(refusal([](SavedAtlas& s) { s.marks[0].session = 1; }), HasSubstr("session 1 of 1"));
  EXPECT_THAT(refusal([](SavedAtlas& s) { s.marks[0].keyframe_idx = 5; }), HasSubstr("keyframe 5 of 5"));
  EXPECT_THAT(refusal([](SavedAtlas& s) { s.marks[0].point_in_anchor.y() = kNan; }), HasSubstr("not finite"));
  EXPECT_THAT(refusal([](SavedAtlas& s) { s.marks[0].normal_in_anchor.x() += 0.5; }), HasSubstr("unit vector"));
  EXPECT_THAT(refusal([](SavedAtlas& s) { s.marks[0].radius = 0.0; }), HasSubstr("not positive"));
  EXPECT_THAT(refusal([](SavedAtlas& s) { s.marks[0].scale = kNan; }), HasSubstr("not positive"));
}

// One number of the contents changed at a time; what the checksums say is not asked here.
TEST(AtlasFile, ContentsThatMakeNoAtlasAreRefused) {
  struct Case {
    const char* message;
    std::function<void(SavedAtlas&)> change;
  };
  const Case cases[] = {
      {"pose is not finite", [](SavedAtlas& a) { a.keyframes[1].cam_from_map.translation.y() = kNan; }},
      {"unit quaternion", [](SavedAtlas& a) { a.keyframes[1].cam_from_map.rotation.coeffs() *= 1.01; }},
      {"scale", [](SavedAtlas& a) { a.keyframes[1].scale = 0.0; }},
      {"map 2 of 2", [](SavedAtlas& a) { a.keyframes[1].map_idx = 2; }},
      {"session 1 of 1", [](SavedAtlas& a) { a.keyframes[1].session = 1; }},
      {"doubled or out of order", [](SavedAtlas& a) { a.keyframes[1].id = a.keyframes[0].id; }},
      {"ids end at 8", [](SavedAtlas& a) { a.keyframes[4].id = 8; }},
      {"keypoint 2", [](SavedAtlas& a) { a.keypoints[1][2].x_px = static_cast<float>(kNan); }},
      {"keypoint 0", [](SavedAtlas& a) { a.keypoints[1][0].y_px = 541.0f; }},
      {"keypoint 5", [](SavedAtlas& a) { a.keypoints[1][5].scale_px = 0.0f; }},
      {"as many descriptors",
       [](SavedAtlas& a) { a.keyframes[0].descriptors = a.keyframes[0].descriptors.first(128); }},
      {"has no keyframes", [](SavedAtlas& a) { a.keyframes[3].map_idx = a.keyframes[4].map_idx = 0; }},
      {"doubled or out of order", [](SavedAtlas& a) { a.maps[1].id = a.maps[0].id; }},
      {"position is not finite", [](SavedAtlas& a) { a.points[2].position.x() = INFINITY; }},
      {"normal", [](SavedAtlas& a) { a.points[0].normal.x() = kNan; }},
      {"normal", [](SavedAtlas& a) { a.points[0].normal *= 2.0; }},
      {"size", [](SavedAtlas& a) { a.points[0].scale_times_distance = -1.0; }},
      {"which never was", [](SavedAtlas& a) { a.points[0].first_keyframe_id = 8; }},
      {"its descriptor", [](SavedAtlas& a) { a.points[0].descriptor.feature_idx = 6; }},
      {"its descriptor", [](SavedAtlas& a) { a.points[0].descriptor.keyframe_idx = 5; }},
      {"descriptor is that of no observer",
       [](SavedAtlas& a) {
         a.points[0].descriptor = {2, 5};
       }},
      {"fewer than two", [](SavedAtlas& a) { a.points[0].observations.SwapErase(1); }},
      {"is that of no feature", [](SavedAtlas& a) { a.points[0].observations[1].feature_idx = -1; }},
      {"is that of no feature", [](SavedAtlas& a) { a.points[0].observations[1].keyframe_idx = 99; }},
      {"from another map",
       [](SavedAtlas& a) {
         a.points[0].observations[1] = {4, 1};
       }},
      {"seen before",
       [](SavedAtlas& a) {
         a.points[0].observations[1] = {0, 2};
       }},
      {"shows another point", [](SavedAtlas& a) { a.points[1].observations[1].feature_idx = 1; }},
      {"doubled or out of order", [](SavedAtlas& a) { std::swap(a.points[0].id, a.points[1].id); }},
      {"ids end at", [](SavedAtlas& a) { a.counters.next_point_id = 2; }},
      {"the keyframe is there", [](SavedAtlas& a) { a.traces[0].id = 1; }},
      {"neither keyframe nor trace", [](SavedAtlas& a) { a.traces[0].stand_in = 4; }},
      {"in a circle", [](SavedAtlas& a) { a.traces[0].stand_in = 3; }},
      {"pose is not finite", [](SavedAtlas& a) { a.traces[1].cam_from_stand_in.rotation.x() = kNan; }},
      {"scale is not positive", [](SavedAtlas& a) { a.traces[1].stand_in_scale = kNan; }},
      {"fx must be positive", [](SavedAtlas& a) { a.camera.fx = -1.0; }},
      {"frame rate", [](SavedAtlas& a) { a.camera.rate_hz = kNan; }},
  };
  const std::vector<std::uint8_t> file = BytesOf(SmallFile());
  for (const Case& c : cases) {
    SavedAtlas atlas = ReadAtlas(file).value();
    ASSERT_TRUE(CheckSavedAtlas(atlas).ok());
    c.change(atlas);
    const Status status = CheckSavedAtlas(atlas);
    EXPECT_EQ(status.code(), StatusCode::kDataLoss) << c.message;
    EXPECT_THAT(status.message(), AllOf(HasSubstr(c.message), HasSubstr("section '")));
  }
}

TEST(AtlasFile, BrokenAtlasIsNotSaved) {
  AtlasHome home;
  home.FillSmall();
  home.atlas.point(*home.atlas.keyframe(home.atlas.FindById(0)).points.begin()).position.z() = kNan;
  StringSink sink;
  const Status status = WriteAtlas(home.atlas, home.camera.calibration(), false, home.device, sink);
  EXPECT_EQ(status.code(), StatusCode::kInternal);
  EXPECT_THAT(status.message(), HasSubstr("position is not finite"));
  EXPECT_TRUE(sink.bytes().empty());
}

class FailingSink final : public ByteSink {
 public:
  explicit FailingSink(std::size_t num_bytes) : num_left_(num_bytes) {}
  Status Write(std::string_view bytes) override {
    if (bytes.size() > num_left_) return Unavailable("disk full");
    num_left_ -= bytes.size();
    return Status::Ok();
  }

 private:
  std::size_t num_left_;
};

TEST(AtlasFile, FullDiskIsReportedWhereverItHappens) {
  AtlasHome home;
  home.FillSmall();
  const std::size_t size = home.Save().size();
  for (std::size_t room = 0; room < size; room += 97) {
    FailingSink sink(room);
    ASSERT_EQ(WriteAtlas(home.atlas, home.camera.calibration(), false, home.device, sink).code(),
              StatusCode::kUnavailable)
        << room;
  }
  FailingSink sink(size);
  EXPECT_TRUE(WriteAtlas(home.atlas, home.camera.calibration(), false, home.device, sink).ok());
}

}  // namespace
}  // namespace haustra::test
