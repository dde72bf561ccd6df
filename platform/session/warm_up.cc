#include "platform/session/warm_up.h"

#include <algorithm>
#include <array>
#include <vector>

namespace haustra {
namespace {

// Blots that an extractor finds: each place a value of its own, repeatable. In all formats luma has it, too.
std::vector<std::uint8_t> Pattern(int row_bytes, int rows) {
  constexpr int kBlot = 9;
  std::vector<std::uint8_t> bytes(static_cast<std::size_t>(row_bytes) * static_cast<std::size_t>(rows));
  for (int y = 0; y < rows; ++y) {
    for (int x = 0; x < row_bytes; ++x) {
      const auto place = static_cast<std::uint32_t>((y / kBlot) * 7919 + x / kBlot);
      const std::uint32_t mixed = (place * 2654435761u) >> 24;
      bytes[static_cast<std::size_t>(y) * static_cast<std::size_t>(row_bytes) + static_cast<std::size_t>(x)] =
          static_cast<std::uint8_t>(40 + mixed * 180 / 255);
    }
  }
  return bytes;
}

Status MatchWithItself(VisionDevice& device, FeatureSetHandle set, const std::vector<Keypoint>& keypoints) {
  std::vector<Match> matches(keypoints.size());
  std::int32_t num_matches = 0;
  MatchRequest match;
  match.query = match.train = DescriptorList::Whole(set);
  match.matches = matches;
  match.num_matches = &num_matches;
  // Sideways; any motion will do.
  const std::vector<std::array<float, 3>> bearings(keypoints.size(), {0.0f, 0.0f, 1.0f});
  const std::vector<float> tolerances(keypoints.size(), 1.0f);
  const EpipolarGate gate = {{0, 0, 0, 0, 0, -1, 0, 1, 0}, bearings, bearings, tolerances, tolerances};
  for (const EpipolarGate* epipolar : {static_cast<const EpipolarGate*>(nullptr), &gate}) {
    match.epipolar = epipolar;
    for (const Lane lane : {Lane::kTracking, Lane::kBackground}) HAUSTRA_TRY(MatchAndWait(device, lane, match));
  }
  // A session asks for no more at a time.
  const int num = std::min(static_cast<int>(keypoints.size()), device.plan().max_match_list);
  std::vector<GuidedQuery> queries(static_cast<std::size_t>(num));
  for (int i = 0; i < num; ++i) {
    const Keypoint& keypoint = keypoints[static_cast<std::size_t>(i)];
    queries[static_cast<std::size_t>(i)] = {
        {set, i}, keypoint.x_px, keypoint.y_px, 20.0f, 0.5f * keypoint.scale_px, 2.0f * keypoint.scale_px};
  }
  GuidedMatchRequest guided;
  guided.queries = queries;
  guided.train = set;
  guided.matches = matches;
  guided.num_matches = &num_matches;
  for (const Lane lane : {Lane::kTracking, Lane::kBackground}) HAUSTRA_TRY(GuidedMatchAndWait(device, lane, guided));
  return Status::Ok();
}

}  // namespace

Result<int> WarmUp(VisionDevice& device, int width_px, int height_px, PixelFormat format) {
  const int row_bytes = width_px * BytesPerPixel(format);
  const std::vector<std::uint8_t> picture = Pattern(row_bytes, MemoryRows(format, height_px));
  std::vector<Keypoint> keypoints(static_cast<std::size_t>(device.plan().max_features));
  std::int32_t num_keypoints = 0;
  ExtractRequest extract;
  extract.image = {picture.data(), width_px, height_px, row_bytes, format};
  extract.keypoints = keypoints;
  extract.num_keypoints = &num_keypoints;
  // The second time the features of the first are followed.
  std::vector<Keypoint> known;
  for (const bool is_first : {true, false}) {
    HAUSTRA_ASSIGN(extract.set, device.CreateFeatureSet());
    extract.follow = known;
    Status status = ExtractAndWait(device, Lane::kTracking, extract);
    if (status.ok()) {
      known.assign(keypoints.begin(), keypoints.begin() + num_keypoints);
      if (is_first) status = MatchWithItself(device, extract.set, known);
    }
    device.ReleaseFeatureSet(extract.set);
    if (!status.ok()) return status;
  }
  return static_cast<int>(known.size());
}

Result<int> WarmUp(VisionDevice& device, const FrameSource& source) {
  return WarmUp(device, source.calibration().width_px, source.calibration().height_px,
                source.pixel_format().value_or(PixelFormat::kBgr8));
}

}  // namespace haustra
