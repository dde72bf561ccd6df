// A sequence as an object: everything but the files.
#pragma once

#include <memory>
#include <vector>

#include "engine/camera/camera_model.h"
#include "tools/render/colon.h"
#include "tools/render/event_script.h"
#include "tools/render/frame_renderer.h"
#include "tools/render/instrument.h"
#include "tools/render/lens_drops.h"
#include "tools/render/lens_effects.h"
#include "tools/render/mucosa_texture.h"
#include "tools/render/render_sequence.h"
#include "tools/render/scope_path.h"
#include "tools/render/sensor.h"
#include "tools/render/window_mask.h"

namespace haustra::render {

// The colon that a sequence with these options is taken in: as long as its path needs.
ColonStyle ColonStyleFor(const RenderOptions& options);

// All that a sequence is made from, put together from its options: colon, mucosa, camera, path, poses, lens effects.
// Pictures of it can be taken in any order. Immutable after construction; reentrant. Construction takes one to two core
// seconds.
class SequenceModel {
 public:
  // Errors as for RenderOptions::Validate and CameraModel::Create.
  static Result<std::unique_ptr<SequenceModel>> Create(const RenderOptions& options);
  SequenceModel(const SequenceModel&) = delete;
  SequenceModel& operator=(const SequenceModel&) = delete;

  const RenderOptions& options() const { return options_; }
  const Colon& colon() const { return colon_; }
  const MucosaTexture& mucosa() const { return mucosa_; }
  const CameraModel& camera() const { return camera_; }
  const WindowMask& window() const { return window_; }
  const Sensor& sensor() const { return sensor_; }
  const ScopePath& path() const { return path_; }
  const std::vector<FrameSpan>& spans() const { return spans_; }
  double TimeS(int frame) const { return frame / options_.rate_hz; }

  // The light of one frame, motion blur and lens effects included. `renderer` is this model's, of the calling thread.
  void Expose(int frame, FrameRenderer* renderer, LinearImage* light) const { Expose(TimeS(frame), renderer, light); }
  // The same of a picture whose middle row is half exposed at that time.
  void Expose(double time_s, FrameRenderer* renderer, LinearImage* light) const;
  // FrameRenderer::MeasureRange at the time of the frame, with all rows at once.
  void MeasureRange(int frame, int step_px, FrameRenderer* renderer, std::vector<float>* range_mm,
                    std::vector<Eigen::Vector3f>* normals = nullptr) const;
  // FrameRenderer::FindSeenWall at the time of the frame, with all rows at once. Frames in which events hide the scene
  // show nothing.
  void FindSeenWall(int frame, FrameRenderer* renderer, SeenWall* seen) const;
  // When the second of two fields is exposed; TimeS(frame) where there are no fields.
  double SecondFieldS(int frame) const { return TimeS(frame) + options_.shutter.field_lag / options_.rate_hz; }
  // Later than the middle row by so much, a row in the middle of its exposure; 0 without a rolling shutter.
  double RowDelayS(int row) const;

 private:
  // The colon is of options.seed, what happens in it of path_seed.
  SequenceModel(const RenderOptions& options, const CameraModel& camera, std::uint64_t path_seed);
  bool IsNarrowBand(double time_s) const;
  double ShutterS(double time_s) const;
  ExposureMoment MomentAt(double time_s) const;
  // The moments of the rows of a picture, one for all when they are the same.
  std::vector<ExposureMoment> RowsAt(double time_s) const;
  // How far the picture moves at most while the shutter is open, pixels.
  double MotionPx(double time_s, double shutter_s) const;

  RenderOptions options_;
  CameraModel camera_;
  WindowMask window_;
  Colon colon_;
  MucosaTexture mucosa_;
  ScopePath path_;
  LensDrops drops_;
  LensEffects effects_;
  Instrument instrument_;
  Sensor sensor_;
  std::vector<FrameSpan> spans_;
};

}  // namespace haustra::render
