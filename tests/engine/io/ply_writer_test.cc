#include "engine/io/ply_writer.h"

#include <gtest/gtest.h>

#include <bit>
#include <cstring>
#include <sstream>

#include "tests/engine/io/small_map.h"

namespace haustra {
namespace {

constexpr std::size_t kVertexBytes = 3 * 4 + 3 + 2 * 4;

struct Ply {
  std::string header;
  std::string body;
};

Ply Write(const MapExport& map) {
  StringSink sink;
  EXPECT_TRUE(WritePly(sink, map).ok());
  const std::string end = "end_header\n";
  const std::size_t split = sink.bytes().find(end) + end.size();
  return {sink.bytes().substr(0, split), sink.bytes().substr(split)};
}

// The bytes of the file put together by hand, so that the test does not depend on this machine's byte order.
std::uint32_t Word(const std::string& bytes, std::size_t offset) {
  std::uint32_t value = 0;
  for (int i = 3; i >= 0; --i) value = value << 8 | static_cast<std::uint8_t>(bytes[offset + i]);
  return value;
}

TEST(WritePly, HeaderNamesTheFormatAndTheProperties) {
  const Ply ply = Write(SmallMap());
  std::istringstream header(ply.header);
  std::string line;
  std::getline(header, line);
  EXPECT_EQ(line, "ply");
  std::getline(header, line);
  EXPECT_EQ(line, "format binary_little_endian 1.0");
  std::string properties;
  while (std::getline(header, line)) {
    if (line.starts_with("property")) properties += line.substr(9) + ";";
    if (line.starts_with("element")) {
      EXPECT_EQ(line, "element vertex 2");
    }
  }
  EXPECT_EQ(properties, "float x;float y;float z;uchar red;uchar green;uchar blue;int num_observations;int map_id;");
}

TEST(WritePly, VerticesAreWhatTheHeaderSays) {
  const Ply ply = Write(SmallMap());
  ASSERT_EQ(ply.body.size(), 2 * kVertexBytes);
  EXPECT_EQ(std::bit_cast<float>(Word(ply.body, 0)), 0.5f);
  EXPECT_EQ(std::bit_cast<float>(Word(ply.body, 4)), -1.25f);
  EXPECT_EQ(std::bit_cast<float>(Word(ply.body, 8)), 4.0f);
  EXPECT_EQ(static_cast<std::uint8_t>(ply.body[12]), 200);
  EXPECT_EQ(static_cast<std::uint8_t>(ply.body[13]), 100);
  EXPECT_EQ(static_cast<std::uint8_t>(ply.body[14]), 50);
  EXPECT_EQ(Word(ply.body, 15), 2u);
  EXPECT_EQ(Word(ply.body, 19), 7u);
  EXPECT_EQ(std::bit_cast<float>(Word(ply.body, kVertexBytes + 8)), 2.0f);
  EXPECT_EQ(Word(ply.body, kVertexBytes + 15), 1u);
}

TEST(WritePly, MapWithoutPointsIsAFileWithoutVertices) {
  const Ply ply = Write(MapExport{});
  EXPECT_NE(ply.header.find("element vertex 0\n"), std::string::npos);
  EXPECT_TRUE(ply.body.empty());
}

}  // namespace
}  // namespace haustra
