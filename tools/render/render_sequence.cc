#include "tools/render/render_sequence.h"

#include <algorithm>
#include <cmath>
#include <memory>
#include <mutex>

#include "capture/calibration_reader.h"
#include "capture/codec/image_codec.h"
#include "capture/image.h"
#include "tools/command/output_folder.h"
#include "tools/command/parallel_for.h"
#include "tools/command/range_picture.h"
#include "tools/command/sequence_content.h"
#include "tools/render/exposure.h"
#include "tools/render/interlace.h"
#include "tools/render/normal_picture.h"
#include "tools/render/out_of_range.h"
#include "tools/render/revisits.h"
#include "tools/render/seen_wall.h"
#include "tools/render/sequence_model.h"
#include "tools/render/sequence_writer.h"

namespace haustra::render {
namespace {

// Frames in flight for each thread: enough that threads seldom wait for the last one of a batch.
constexpr int kBatchPerThread = 6;

// Keeps the first error of many threads.
class FirstError {
 public:
  void Note(const Status& status) {
    if (status.ok()) return;
    const std::lock_guard<std::mutex> lock(mutex_);
    if (status_.ok()) status_ = status;
  }
  Status status() const { return status_; }

 private:
  std::mutex mutex_;
  Status status_;
};

// Depth, normals or both, as the options say.
Status WriteGeometry(const std::string& folder, int frame, const SequenceModel& model, FrameRenderer* renderer) {
  const RenderOptions& options = model.options();
  RangePicture picture;
  picture.width = options.width_px / RangePicture::kStepPx;
  picture.height = options.height_px / RangePicture::kStepPx;
  std::vector<Eigen::Vector3f> normals;
  model.MeasureRange(frame, RangePicture::kStepPx, renderer, &picture.range_mm, &normals);
  if (options.with_depth) HAUSTRA_TRY(WriteFile(DepthPath(folder, frame), RangePictureBytes(picture)));
  if (!options.with_normals) return Status::Ok();
  return WritePng(NormalsPath(folder, frame), NormalPicture(normals, picture.width, picture.height).view());
}

Status WriteDescription(const std::string& folder, const SequenceModel& model) {
  const RenderOptions& options = model.options();
  std::vector<double> times_s;
  std::vector<SE3> world_from_cam;
  times_s.reserve(options.num_frames());
  world_from_cam.reserve(options.num_frames());
  for (int i = 0; i < options.num_frames(); ++i) {
    times_s.push_back(model.TimeS(i));
    world_from_cam.push_back(model.path().WorldFromCam(model.TimeS(i)));
  }
  HAUSTRA_TRY(WriteTimes(folder, times_s));
  HAUSTRA_TRY(WriteGroundTruth(folder, times_s, world_from_cam));
  HAUSTRA_TRY(WriteEvents(folder, model.spans()));
  HAUSTRA_TRY(WriteRevisits(folder, FindRevisits(world_from_cam, options.rate_hz, HiddenSpans(model.spans()))));
  const CameraCalibration& camera = model.camera().calibration();
  HAUSTRA_TRY(WriteCalibration(folder + "/calib.yaml", Misjudged(camera, options.calibration_error)));
  if (!options.calibration_error.is_none()) HAUSTRA_TRY(WriteCalibration(folder + "/calib_true.yaml", camera));
  return WritePng(folder + "/mask.png", model.window().mask());
}

}  // namespace

RenderOptions RenderOptions::FromPreset(const Preset& preset) {
  RenderOptions options;
  options.preset = preset;
  options.seconds = preset.seconds;
  options.rate_hz = preset.rate_hz;
  options.width_px = preset.width_px;
  options.height_px = preset.height_px;
  options.events = PlaceEvents(preset.events, preset.seconds);
  return options;
}

Status RenderOptions::Validate() const {
  if (!(seconds >= 0.2 && seconds <= 3600.0)) return OutOfRange("seconds", seconds, "[0.2, 3600]");
  if (!(rate_hz >= 1.0 && rate_hz <= 120.0)) return OutOfRange("rate", rate_hz, "[1, 120] Hz");
  if (width_px < 64 || width_px > 4096) return OutOfRange("width", width_px, "[64, 4096]");
  if (height_px < 64 || height_px > 4096) return OutOfRange("height", height_px, "[64, 4096]");
  if (num_threads < 1 || num_threads > 256) return OutOfRange("threads", num_threads, "[1, 256]");
  if (jpeg_quality < 5 || jpeg_quality > 100) return OutOfRange("quality", jpeg_quality, "[5, 100]");
  const Breathing& breathing = preset.colon.breathing;
  for (const auto& [name, value] :
       {std::pair("breathing", breathing.amplitude), std::pair("contraction", breathing.wave_amplitude),
        std::pair("tangential", breathing.tangential)}) {
    if (!(value >= 0.0 && value <= Breathing::kMaxAmplitude)) return OutOfRange(name, value, "[0, 0.15] of the radius");
  }
  const double remodel = preset.colon.remodel;
  if (!(remodel >= 0.0 && remodel <= ColonStyle::kMaxRemodel))
    return OutOfRange("remodel", remodel, "[0, 0.15] of the radius");
  const double fluid = preset.colon.fluid;
  if (!(fluid >= 0.0 && fluid <= FluidLevel::kMaxShare)) return OutOfRange("fluid", fluid, "[0, 0.6] of the radius");
  const PressureCurve& pressure = breathing.pressure;
  if (!(pressure.collapse >= 0.0 && pressure.collapse <= PressureCurve::kMaxCollapse)) {
    return OutOfRange("collapse", pressure.collapse, "[0, 0.4] of the radius");
  }
  if (!(pressure.period_s >= PressureCurve::kMinPeriodS && pressure.period_s <= 3600.0)) {
    return OutOfRange("period of the collapse", pressure.period_s, "[2, 3600] s");
  }
  HAUSTRA_TRY(preset.lens_drops.Validate());
  const MucosaStyle& mucosa = preset.mucosa;
  if (!(mucosa.stool >= 0.0 && mucosa.stool <= 1.0)) return OutOfRange("stool", mucosa.stool, "[0, 1] of the wall");
  if (!(mucosa.blood.share >= 0.0 && mucosa.blood.share <= 1.0)) {
    return OutOfRange("blood", mucosa.blood.share, "[0, 1] of the wall");
  }
  if (!(mucosa.blood.spread_s >= 0.0 && mucosa.blood.spread_s <= 3600.0)) {
    return OutOfRange("seconds until blood has spread", mucosa.blood.spread_s, "[0, 3600]");
  }
  HAUSTRA_TRY(shutter.Validate());
  return calibration_error.Validate(width_px);
}

int RenderOptions::num_frames() const { return std::max(1, static_cast<int>(std::lround(seconds * rate_hz))); }

std::vector<Event> PlaceEvents(const std::vector<PresetEvent>& events, double seconds) {
  std::vector<Event> placed;
  for (const PresetEvent& event : events) placed.push_back({event.kind, event.at_share * seconds, event.duration_s});
  return placed;
}

Status RenderSequence(const std::string& folder, const RenderOptions& options, const Progress& progress) {
  HAUSTRA_TRY(options.Validate());
  HAUSTRA_TRY(OutputFolder::Check(folder, kSequenceContent, options.overwrite));
  HAUSTRA_ASSIGN(const std::unique_ptr<SequenceModel> model, SequenceModel::Create(options));
  HAUSTRA_ASSIGN(OutputFolder output, OutputFolder::Create(folder, kSequenceContent, options.overwrite));
  HAUSTRA_TRY(MakeFramesFolder(folder));
  if (options.with_depth) HAUSTRA_TRY(MakeDepthFolder(folder));
  if (options.with_normals) HAUSTRA_TRY(MakeNormalsFolder(folder));
  HAUSTRA_TRY(WriteDescription(folder, *model));

  const int num_frames = options.num_frames(), num_threads = options.num_threads;
  std::vector<std::unique_ptr<FrameRenderer>> renderers;
  renderers.reserve(num_threads);
  for (int i = 0; i < num_threads; ++i) {
    renderers.push_back(
        std::make_unique<FrameRenderer>(model->colon(), model->mucosa(), model->camera(), model->window()));
  }
  std::vector<SeenWall> seen_walls;  // of each thread; what all have seen does not depend on which thread saw it
  for (int i = 0; options.with_seen_wall && i < num_threads; ++i) {
    seen_walls.emplace_back(model->colon().mesh(), CoverageOptions());
  }
  std::vector<Image> pictures(num_threads);
  const int batch = std::min(num_frames, kBatchPerThread * num_threads);
  std::vector<LinearImage> light(batch, LinearImage(options.width_px, options.height_px));
  const bool has_fields = options.shutter.field_lag > 0.0;
  std::vector<LinearImage> second_light(has_fields ? batch : 0, LinearImage(options.width_px, options.height_px));
  std::vector<Image> second_fields(num_threads);
  std::vector<Metering> metering(batch);
  std::vector<float> gain(batch);

  // Light does not depend on exposure, and exposure only on earlier frames: each batch is rendered in parallel, exposed
  // in order, and developed in parallel.
  AutoExposure exposure;
  FirstError error;
  std::mutex progress_mutex;
  int num_done = 0;
  const auto is_stopped = [&options] { return options.stop != nullptr && *options.stop; };
  for (int begin = 0; begin < num_frames && error.status().ok() && !is_stopped(); begin += batch) {
    const int count = std::min(batch, num_frames - begin);
    ParallelFor(count, num_threads, [&](int i, int worker) {
      if (is_stopped()) return;
      model->Expose(begin + i, renderers[worker].get(), &light[i]);
      if (has_fields) model->Expose(model->SecondFieldS(begin + i), renderers[worker].get(), &second_light[i]);
      metering[i] = Meter(light[i], model->window());
    });
    if (is_stopped()) break;
    for (int i = 0; i < count; ++i) {
      if (begin + i == 0) exposure.Start(metering[0]);
      gain[i] = exposure.gain();
      exposure.Update(metering[i], 1.0 / options.rate_hz);
    }
    ParallelFor(count, num_threads, [&](int i, int worker) {
      if (is_stopped()) return;
      model->sensor().Develop(gain[i], begin + i, &light[i], &pictures[worker]);
      if (has_fields) {
        model->sensor().Develop(gain[i], begin + i, &second_light[i], &second_fields[worker]);
        WeaveFields(second_fields[worker], &pictures[worker]);
      }
      if (options.with_depth || options.with_normals) {
        error.Note(WriteGeometry(folder, begin + i, *model, renderers[worker].get()));
      }
      if (options.with_seen_wall) model->FindSeenWall(begin + i, renderers[worker].get(), &seen_walls[worker]);
      error.Note(WriteJpeg(FramePath(folder, begin + i), pictures[worker].view(), options.jpeg_quality));
      const std::lock_guard<std::mutex> lock(progress_mutex);
      ++num_done;
      if (progress) progress(num_done, num_frames);
    });
  }
  HAUSTRA_TRY(error.status());
  if (num_done < num_frames) {
    output.Discard();
    return Status(StatusCode::kCancelled,
                  "stopped at frame " + std::to_string(num_done) + " of " + std::to_string(num_frames));
  }
  if (options.with_seen_wall) {
    for (int i = 1; i < num_threads; ++i) seen_walls[0].Add(seen_walls[i]);
    HAUSTRA_TRY(WriteFile(folder + "/seen_wall.csv", seen_walls[0].Csv()));
  }
  output.Commit();
  return Status::Ok();
}

}  // namespace haustra::render
