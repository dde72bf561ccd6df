#include "tools/render/sequence_model.h"

#include <algorithm>
#include <cmath>

namespace haustra::render {
namespace {

// Less motion than this does not show; more is averaged over pictures this far apart.
constexpr double kUnseenMotionPx = 1.6;
constexpr double kMotionStepPx = 2.2;
constexpr int kMaxExposures = 12;
constexpr int kMaxFixedExposures = 32;  // of an exposure that was asked for
constexpr double kNearMm = 15.0;        // depth at which the motion is judged

}  // namespace

ColonStyle ColonStyleFor(const RenderOptions& options) {
  ColonStyle style = options.preset.colon;
  const double reach = ScopePath::ReachMm(options.preset.path, options.seconds);
  const double far_end = options.preset.path.start_arc_mm + reach;
  style.length_mm = far_end + options.preset.blind_end_mm + style.dome_mm;
  style.remodel_seed = options.path_seed.value_or(options.seed);
  if (options.preset.twin_length_mm > 0.0) {
    // One in the first half of the path, one in the second.
    style.twin.length_mm = std::min(options.preset.twin_length_mm, 0.42 * reach);
    style.twin.start_mm = options.preset.path.start_arc_mm + 14.0;
    style.twin.offset_mm = std::max(0.56 * reach, style.twin.length_mm + 10.0);
  }
  return style;
}

Result<std::unique_ptr<SequenceModel>> SequenceModel::Create(const RenderOptions& options) {
  HAUSTRA_TRY(options.Validate());
  HAUSTRA_ASSIGN(const CameraModel camera,
                 CameraModel::Create(CalibrationFor(options.width_px, options.height_px, options.rate_hz)));
  return std::unique_ptr<SequenceModel>(new SequenceModel(options, camera, options.path_seed.value_or(options.seed)));
}

SequenceModel::SequenceModel(const RenderOptions& options, const CameraModel& camera, std::uint64_t path_seed)
    : options_(options),
      camera_(camera),
      window_(options.width_px, options.height_px),
      colon_(ColonStyleFor(options), options.seed),
      mucosa_(options.preset.mucosa, colon_, options.seed, options.num_threads),
      path_(options.preset.path, colon_.centreline(), options.events, options.seconds, path_seed),
      drops_(options.preset.lens_drops, window_, path_seed),
      effects_(options.events, window_, path_seed),
      instrument_(options.events, path_seed),
      sensor_(window_, options.width_px, options.height_px, options.preset.noise, path_seed),
      spans_(FrameSpans(options.events, options.rate_hz, options.num_frames())) {}

double SequenceModel::MotionPx(double time_s, double shutter_s) const {
  const SE3 before = path_.WorldFromCam(time_s - 0.5 * shutter_s), after = path_.WorldFromCam(time_s + 0.5 * shutter_s);
  const double turn = RotationAngle(before.rotation, after.rotation);
  const double shift = (before.translation - after.translation).norm() / kNearMm;
  return camera_.focal_px() * (turn + shift);
}

bool SequenceModel::IsNarrowBand(double time_s) const {
  // The processor switches between two frames.
  return std::any_of(options_.events.begin(), options_.events.end(), [&](const Event& event) {
    return event.kind == EventKind::kNarrowBand && time_s >= event.start_s &&
           time_s <= event.start_s + event.duration_s;
  });
}

double SequenceModel::ShutterS(double time_s) const {
  return std::max(options_.shutter.exposure / options_.rate_hz, path_.ShutterS(time_s));
}

double SequenceModel::RowDelayS(int row) const {
  const double share = (row + 0.5) / options_.height_px - 0.5;
  return share * options_.shutter.readout / options_.rate_hz;
}

ExposureMoment SequenceModel::MomentAt(double time_s) const {
  const auto blood_share = static_cast<float>(options_.preset.mucosa.blood.ShareAt(time_s));
  return {time_s,     path_.ArcMm(time_s), path_.WorldFromCam(time_s), IsNarrowBand(time_s), instrument_.At(time_s),
          blood_share};
}

void SequenceModel::MeasureRange(int frame, int step_px, FrameRenderer* renderer, std::vector<float>* range_mm,
                                 std::vector<Eigen::Vector3f>* normals) const {
  renderer->MeasureRange(MomentAt(TimeS(frame)), step_px, range_mm, normals);
}

void SequenceModel::FindSeenWall(int frame, FrameRenderer* renderer, SeenWall* seen) const {
  for (const FrameSpan& span : spans_) {
    if (HidesScene(span.kind) && frame >= span.first_frame && frame <= span.last_frame) return;
  }
  renderer->FindSeenWall(MomentAt(TimeS(frame)), seen);
}

std::vector<ExposureMoment> SequenceModel::RowsAt(double time_s) const {
  const int num_rows = options_.shutter.readout > 0.0 ? options_.height_px : 1;
  std::vector<ExposureMoment> rows(num_rows);
  for (int y = 0; y < num_rows; ++y) {
    rows[y] = MomentAt(num_rows > 1 ? time_s + RowDelayS(y) : time_s);
  }
  return rows;
}

void SequenceModel::Expose(double time_s, FrameRenderer* renderer, LinearImage* light) const {
  const double shutter_s = ShutterS(time_s);
  const double motion_px = MotionPx(time_s, shutter_s);
  const int max_count = options_.shutter.exposure > 0.0 ? kMaxFixedExposures : kMaxExposures;
  const int count = motion_px < kUnseenMotionPx
                        ? 1
                        : std::clamp(static_cast<int>(std::ceil(motion_px / kMotionStepPx)), 2, max_count);
  std::fill(light->rgb.begin(), light->rgb.end(), 0.0f);
  for (int i = 0; i < count; ++i) {
    const double t = time_s + shutter_s * ((i + 0.5) / count - 0.5);
    renderer->Accumulate(RowsAt(t), 1.0f / static_cast<float>(count), light);
  }
  if (drops_.is_active()) drops_.Apply(time_s, light);
  if (effects_.IsActive(time_s)) effects_.Apply(time_s, light);
}

}  // namespace haustra::render
