// Writes live frames into a sequence folder (frames/, times.txt, calib.yaml, mask.png) that `haustra run` reads.
#pragma once

#include <condition_variable>
#include <cstdint>
#include <memory>
#include <mutex>
#include <span>
#include <string>
#include <thread>
#include <vector>

#include "capture/image.h"
#include "hal/camera_calibration.h"
#include "hal/core/status.h"
#include "hal/frame_source.h"
#include "tools/command/output_folder.h"

namespace haustra {

// Frames are copied and encoded by threads of the recorder, so that the camera is not kept waiting; when all its
// buffers are full a frame is left out, and counted. The folder is for its owner's eyes only (0700): it shows a
// patient. thread-bound(its owner).
class SequenceRecorder {
 public:
  enum class Store {
    kPng,   // lossless
    kJpeg,  // quality 95
  };
  struct Options {
    Store store = Store::kPng;
    int num_threads = 0;  // 0: one a core
    int num_buffers = 32;
    bool overwrite = false;  // replace a sequence that is already there, when the recording is finished
  };

  // Errors of OutputFolder::Create.
  static Result<std::unique_ptr<SequenceRecorder>> Create(const std::string& folder, const Options& options);
  ~SequenceRecorder();

  // encoded: the frame as a JPEG file, written as it is instead of the pixels; empty: none. False when there was no
  // room.
  bool Add(const Frame& frame, std::span<const std::uint8_t> encoded);
  // The first error of writing, from any thread; no more frames are taken then.
  Status status() const;

  struct Summary {
    std::uint32_t num_written = 0;
    std::uint32_t num_left_out = 0;  // no room
  };
  // Writes what is waiting, then times.txt (seconds from the first frame), and calib.yaml and mask.png where they are
  // given. Whatever went wrong before, the folder then holds whole frames and their times. kUnavailable.
  Result<Summary> Finish(const CameraCalibration* calibration, ImageView mask);

 private:
  struct Slot {
    std::uint32_t index = 0;
    TimePoint timestamp;
    Image image;
    std::vector<std::uint8_t> encoded;
  };
  struct Written {
    std::uint32_t index = 0;
    TimePoint timestamp;
  };

  SequenceRecorder(std::string folder, OutputFolder output, const Options& options);
  void Encode();
  Status WriteFrame(const Slot& slot, Image* colour) const;
  void StopThreads();

  const std::string folder_;
  OutputFolder output_;
  const Options options_;
  std::vector<std::thread> threads_;
  mutable std::mutex mutex_;
  std::condition_variable has_work_;
  std::vector<std::unique_ptr<Slot>> free_;     // guarded by mutex_, as all that follows
  std::vector<std::unique_ptr<Slot>> waiting_;  // oldest first
  std::vector<Written> written_;
  std::uint32_t num_left_out_ = 0;
  Status status_;
  bool is_stopping_ = false;
};

}  // namespace haustra
