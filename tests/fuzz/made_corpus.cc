#include "tests/fuzz/made_corpus.h"

#include "engine/depth/depth_file.h"
#include "engine/place/vocabulary_file.h"
#include "tests/engine/io/small_atlas.h"
#include "tests/engine/place/synthetic_words.h"

namespace haustra::test {
namespace {

std::string MadeDepth() {
  constexpr DepthGrid kGrid{4, 5, 3};
  DepthMap depth(kGrid.width, kGrid.height);
  depth.Clear(0.25);
  for (int i = 0; i < depth.num_cells(); i += 2) depth.Set(i, 1.0 / (0.5 + 0.1 * i), 100 + i);
  const std::vector<std::uint8_t> bgr(3 * static_cast<std::size_t>(depth.num_cells()), 90);
  StringSink sink;
  DepthFileWriter writer(sink);
  HAUSTRA_CHECK(writer.Begin(kGrid, 2).ok() && writer.Add(3, 30, depth, bgr).ok() &&
                writer.Add(8, 80, depth, bgr).ok() && writer.End().ok());
  return sink.bytes();
}

std::string MadeVocabulary() {
  VocabularyOptions options;
  options.branching = 2;
  options.depth = 2;
  StringSink sink;
  HAUSTRA_CHECK(WriteVocabulary(Vocabulary::Train(ClusteredSample(1, 4, 3, 4), options).value(), sink).ok());
  return sink.bytes();
}

}  // namespace

std::map<std::string, std::string> MadeCorpus() {
  AtlasHome empty, small, marked;
  small.FillSmall();
  marked.FillMarked();
  return {{"atlas/empty_v1.atlas", empty.Save()},
          {"atlas/small_v1.atlas", small.Save()},
          {"atlas/marked_v1.atlas", marked.Save()},
          {"depth_file/two_keyframes_v1.bin", MadeDepth()},
          {"vocabulary/small_v1.voc", MadeVocabulary()}};
}

}  // namespace haustra::test
