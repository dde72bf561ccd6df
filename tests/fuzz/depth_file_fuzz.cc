#include <string>

#include "engine/depth/depth_file.h"
#include "hal/core/check.h"
#include "tests/engine/io/sealed_file.h"
#include "tests/fuzz/fuzz_entries.h"

namespace haustra::test {
namespace {

void TryDepthFile(std::span<const std::uint8_t> bytes) {
  const Result<DepthFile> file = ReadDepthFile(bytes);
  if (!file.ok()) {
    HAUSTRA_CHECK(!file.status().message().empty());
    return;
  }
  // What was taken is written as it came.
  StringSink sink;
  DepthFileWriter writer(sink);
  HAUSTRA_CHECK(writer.Begin(file->grid, static_cast<int>(file->keyframes.size())).ok());
  const SavedDepth* before = nullptr;
  for (const SavedDepth& saved : file->keyframes) {
    HAUSTRA_CHECK(before == nullptr || saved.keyframe_id > before->keyframe_id);
    before = &saved;
    const DepthMap& depth = saved.depth;
    HAUSTRA_CHECK(depth.width() == file->grid.width && depth.height() == file->grid.height);
    HAUSTRA_CHECK(saved.bgr.size() == 3 * static_cast<std::size_t>(depth.num_cells()));
    for (int i = 0; i < depth.num_cells(); ++i) HAUSTRA_CHECK(!depth.has_depth(i) || depth.range_mu(i) > 0.0);
    HAUSTRA_CHECK(writer.Add(saved.keyframe_id, saved.frame_index, depth, saved.bgr).ok());
  }
  HAUSTRA_CHECK(writer.End().ok());
  HAUSTRA_CHECK(sink.bytes() == std::string(bytes.begin(), bytes.end()));
}

}  // namespace

void FuzzDepthFile(std::span<const std::uint8_t> bytes) {
  TryDepthFile(bytes);
  TryDepthFile(Sealed(bytes));
}

}  // namespace haustra::test
