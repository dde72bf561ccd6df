// Writes live frames into a sequence folder (frames/, times.txt, calib.yaml, mask.png) that `haustra run` reads.
#pragma once

#include <chrono>
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
#include "tools/command/line_file.h"
#include "tools/command/output_folder.h"

namespace haustra {

// A frame is in times.recording as soon as it is whole, and its time on the disk about a second later: a recording that
// is cut can be read up to there (capture/dataset/sequence_listing.h). Frames are copied and encoded by threads of the
// recorder, so that the camera is not kept waiting; when all its buffers are full a frame is left out, and counted.
// When a time cannot be written the recording ends with the one before. The folder is for its owner's eyes only (0700):
// it shows a patient. thread-bound(its owner).
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

  // Writes calib.yaml and mask.png, where they are given. Errors of OutputFolder::Create; kUnavailable: a file cannot
  // be written.
  static Result<std::unique_ptr<SequenceRecorder>> Create(const std::string& folder, const Options& options,
                                                          const CameraCalibration* calibration, ImageView mask);
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
  // Writes what is waiting, then times.txt (seconds from the first frame) in place of times.recording. Whatever went
  // wrong before, the folder then holds whole frames and their times. kUnavailable, kNotFound (the folder has gone):
  // that it went wrong, or there was no frame; nothing is left of a recording without one.
  Result<Summary> Finish();

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

  SequenceRecorder(std::string folder, OutputFolder output, int times, const Options& options);
  void Encode();
  // With its time, which goes to the disk at once where that is said.
  Status WriteFrame(const Slot& slot, bool to_disk, Image* colour);
  Status WriteTime(const char* name, TimePoint timestamp, bool to_disk);
  Status WriteTimes();
  void StopThreads();

  const std::string folder_;
  OutputFolder output_;
  const Options options_;
  LineFile times_;  // times.recording
  std::vector<std::thread> threads_;
  mutable std::mutex mutex_;
  std::condition_variable has_work_;
  std::vector<std::unique_ptr<Slot>> free_;     // guarded by mutex_, as all that follows
  std::vector<std::unique_ptr<Slot>> waiting_;  // oldest first
  std::vector<Written> written_;
  std::uint32_t num_left_out_ = 0;
  Status status_;
  std::chrono::steady_clock::time_point synced_;  // when times.recording last went to the disk
  bool is_stopping_ = false;
};

}  // namespace haustra
