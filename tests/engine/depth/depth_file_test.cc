#include "engine/depth/depth_file.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <string>
#include <vector>

#include "engine/geometry/rng.h"
#include "tests/engine/io/sealed_file.h"

namespace haustra {
namespace {

using ::testing::HasSubstr;

constexpr DepthGrid kGrid{4, 7, 5};

SavedDepth MadeDepth(KeyframeId id) {
  SavedDepth saved;
  saved.keyframe_id = id;
  saved.frame_index = 10 * id;
  saved.depth = DepthMap(kGrid.width, kGrid.height);
  saved.depth.Clear(0.25);
  for (int i = 0; i < saved.depth.num_cells(); i += 2) saved.depth.Set(i, 1.0 / (0.5 + 0.1 * i), 100 + i);
  for (int i = 0; i < 3 * saved.depth.num_cells(); ++i) saved.bgr.push_back(static_cast<std::uint8_t>(7 * i + id));
  return saved;
}

std::vector<std::uint8_t> Written(const std::vector<KeyframeId>& ids, const DepthGrid& grid = kGrid) {
  StringSink sink;
  DepthFileWriter writer(sink);
  EXPECT_TRUE(writer.Begin(grid, static_cast<int>(ids.size())).ok());
  for (const KeyframeId id : ids) {
    const SavedDepth saved = MadeDepth(id);
    EXPECT_TRUE(writer.Add(id, saved.frame_index, saved.depth, saved.bgr).ok());
  }
  EXPECT_TRUE(writer.End().ok());
  return {sink.bytes().begin(), sink.bytes().end()};
}

TEST(DepthFile, ComesBackAsItWas) {
  const Result<DepthFile> file = ReadDepthFile(Written({3, 8}));
  ASSERT_TRUE(file.ok()) << file.status().ToString();
  EXPECT_EQ(file->grid.step_px, 4);
  ASSERT_EQ(file->keyframes.size(), 2u);
  for (const SavedDepth& saved : file->keyframes) {
    const SavedDepth expected = MadeDepth(saved.keyframe_id);
    EXPECT_EQ(saved.frame_index, expected.frame_index);
    EXPECT_EQ(saved.bgr, expected.bgr);
    for (int i = 0; i < expected.depth.num_cells(); ++i) {
      EXPECT_EQ(saved.depth.inverse_range(i), expected.depth.inverse_range(i));
      EXPECT_EQ(saved.depth.confidence(i), expected.depth.confidence(i));
    }
  }
  EXPECT_TRUE(ReadDepthFile(Written({}))->keyframes.empty());
}

TEST(DepthFile, WhatDoesNotFitIsNamed) {
  EXPECT_THAT(ReadDepthFile(Written({8, 3})).status().message(), HasSubstr("keyframe 3 does not follow"));
  EXPECT_THAT(ReadDepthFile(Written({3, 3})).status().message(), HasSubstr("keyframe 3 does not follow"));
  EXPECT_THAT(ReadDepthFile(Written({}, {9, 7, 5})).status().message(), HasSubstr("7x5 cells of 9 pixels"));
  EXPECT_THAT(ReadDepthFile(Written({}, {4, 0, 5})).status().message(), HasSubstr("0x5 cells"));
  EXPECT_THAT(ReadDepthFile(Written({1}, {4, 7, 6})).status().message(), HasSubstr("do not hold 42 cells"));
  const std::string other = "P5\n7 5\n255\n and then some more bytes";
  EXPECT_EQ(ReadDepthFile({reinterpret_cast<const std::uint8_t*>(other.data()), other.size()}).code(),
            StatusCode::kInvalidArgument);
}

TEST(DepthFile, ACutFileIsDamagedAtEveryLength) {
  const std::vector<std::uint8_t> whole = Written({3, 8});
  for (std::size_t size = 0; size < whole.size(); ++size) {
    EXPECT_FALSE(ReadDepthFile(std::span(whole).first(size)).ok()) << size;
  }
}

// Behind the checksums, too: what is read is sound, or refused with a message.
TEST(DepthFile, DamagedBytesAreRefusedOrHarmless) {
  Rng rng(4);
  const std::vector<std::uint8_t> whole = Written({3, 8});
  for (int trial = 0; trial < 3000; ++trial) {
    std::vector<std::uint8_t> bytes = whole;
    for (int k = 0; k < 1 + trial % 3; ++k) {
      bytes[static_cast<std::size_t>(rng.Uniform() * static_cast<double>(bytes.size()))] =
          static_cast<std::uint8_t>(rng.Uniform() * 256.0);
    }
    if (trial % 2 == 0) test::SealFile(bytes);
    const Result<DepthFile> file = ReadDepthFile(bytes);
    if (!file.ok()) {
      EXPECT_FALSE(file.status().message().empty());
      continue;
    }
    for (const SavedDepth& saved : file->keyframes) {
      for (int i = 0; i < saved.depth.num_cells(); ++i) {
        if (saved.depth.has_depth(i)) {
          EXPECT_GT(saved.depth.inverse_range(i), 0.0);
        }
      }
    }
  }
}

}  // namespace
}  // namespace haustra
