#include "tools/capture/sequence_recorder.h"

#include <fcntl.h>

#include <algorithm>
#include <cerrno>
#include <cstdio>
#include <filesystem>
#include <system_error>
#include <utility>

#include "capture/calibration_reader.h"
#include "capture/codec/image_codec.h"
#include "capture/dataset/sequence_listing.h"
#include "capture/image_transform.h"
#include "capture/yuv.h"
#include "engine/io/text_writer.h"
#include "hal/core/errno_text.h"
#include "tools/command/sequence_content.h"

namespace haustra {
namespace {

namespace fs = std::filesystem;

constexpr int kJpegQuality = 95;
constexpr auto kSyncInterval = std::chrono::seconds(1);

// With the plane of colour, where there is one.
void CopyAll(const ImageView& image, Image* copy) {
  if (image.format != PixelFormat::kNv12) {
    CopyImage(image, copy);
    return;
  }
  // Colour is stored as JPEG and PNG have it anyway.
  ToBgr(image, copy);
}

}  // namespace

Result<std::unique_ptr<SequenceRecorder>> SequenceRecorder::Create(const std::string& folder, const Options& options,
                                                                   const CameraCalibration* calibration,
                                                                   ImageView mask) {
  HAUSTRA_ASSIGN(OutputFolder output, OutputFolder::Create(folder, kSequenceContent, options.overwrite));
  std::error_code error;
  fs::create_directories(fs::path(folder) / "frames", error);
  if (error) return Unavailable(folder + ": cannot be made: " + error.message());
  fs::permissions(folder, fs::perms::owner_all, error);
  if (error) return Unavailable(folder + ": its rights cannot be set: " + error.message());
  if (calibration != nullptr) {
    HAUSTRA_TRY(WriteCalibration((fs::path(folder) / "calib.yaml").string(), *calibration));
  }
  if (!mask.is_empty()) HAUSTRA_TRY(WritePng((fs::path(folder) / "mask.png").string(), mask));
  const std::string path = (fs::path(folder) / kRecordedTimesName).string();
  const int times = ::open(path.c_str(), O_WRONLY | O_CREAT | O_EXCL | O_APPEND | O_CLOEXEC, 0600);
  if (times < 0) return Unavailable(path + ": cannot be created: " + ErrnoText(errno));
  return std::unique_ptr<SequenceRecorder>(new SequenceRecorder(folder, std::move(output), times, options));
}

SequenceRecorder::SequenceRecorder(std::string folder, OutputFolder output, int times, const Options& options)
    : folder_(std::move(folder)),
      output_(std::move(output)),
      options_(options),
      times_((fs::path(folder_) / kRecordedTimesName).string(), times) {
  for (int i = 0; i < options.num_buffers; ++i) free_.push_back(std::make_unique<Slot>());
  const unsigned num_cores = std::max(1u, std::thread::hardware_concurrency());
  const unsigned num_threads = options.num_threads > 0 ? static_cast<unsigned>(options.num_threads) : num_cores;
  for (unsigned i = 0; i < num_threads; ++i) threads_.emplace_back([this] { Encode(); });
}

SequenceRecorder::~SequenceRecorder() { StopThreads(); }

void SequenceRecorder::StopThreads() {
  {
    const std::lock_guard lock(mutex_);
    is_stopping_ = true;
  }
  has_work_.notify_all();
  for (std::thread& thread : threads_) thread.join();
  threads_.clear();
}

bool SequenceRecorder::Add(const Frame& frame, std::span<const std::uint8_t> encoded) {
  std::unique_ptr<Slot> slot;
  {
    const std::lock_guard lock(mutex_);
    if (free_.empty() || !status_.ok()) {
      ++num_left_out_;
      return false;
    }
    slot = std::move(free_.back());
    free_.pop_back();
  }
  slot->index = frame.index;
  slot->timestamp = frame.timestamp;
  slot->encoded.assign(encoded.begin(), encoded.end());
  if (encoded.empty()) CopyAll(frame.image, &slot->image);
  {
    const std::lock_guard lock(mutex_);
    waiting_.push_back(std::move(slot));
  }
  has_work_.notify_one();
  return true;
}

Status SequenceRecorder::status() const {
  const std::lock_guard lock(mutex_);
  return status_;
}

void SequenceRecorder::Encode() {
  Image colour;
  std::unique_lock lock(mutex_);
  while (true) {
    has_work_.wait(lock, [this] { return is_stopping_ || !waiting_.empty(); });
    if (waiting_.empty()) return;
    std::unique_ptr<Slot> slot = std::move(waiting_.front());
    waiting_.erase(waiting_.begin());
    const auto now = std::chrono::steady_clock::now();
    const bool is_sync_due = now - synced_ >= kSyncInterval;
    if (is_sync_due) synced_ = now;
    lock.unlock();
    const Status status = WriteFrame(*slot, is_sync_due, &colour);
    lock.lock();
    if (status.ok()) written_.push_back({slot->index, slot->timestamp});
    if (status_.ok()) status_ = status;
    free_.push_back(std::move(slot));
  }
}

Status SequenceRecorder::WriteFrame(const Slot& slot, bool to_disk, Image* colour) {
  const bool is_jpeg = options_.store == Store::kJpeg || !slot.encoded.empty();
  char name[32];
  std::snprintf(name, sizeof(name), "%06u.%s", slot.index, is_jpeg ? "jpg" : "png");
  const std::string path = (fs::path(folder_) / "frames" / name).string();
  Status status;
  if (!slot.encoded.empty()) {
    status = WriteEncoded(path, slot.encoded);
  } else {
    ImageView image = slot.image.view();
    if (image.format != PixelFormat::kGrey8 && image.format != PixelFormat::kBgr8) {
      ToBgr(image, colour);
      image = colour->view();
    }
    status = is_jpeg ? WriteJpeg(path, image, kJpegQuality) : WritePng(path, image);
  }
  if (status.ok()) status = WriteTime(name, slot.timestamp, to_disk);
  // The file of a frame that was not written whole, or that has no time, goes.
  std::error_code ignored;
  if (!status.ok()) fs::remove(path, ignored);
  return status;
}

Status SequenceRecorder::WriteTime(const char* name, TimePoint timestamp, bool to_disk) {
  std::string line = std::string(name) + ' ';
  AppendSeconds(timestamp.time_since_epoch().count(), &line);
  line += '\n';
  return times_.Append(line, to_disk);
}

Status SequenceRecorder::WriteTimes() {
  std::sort(written_.begin(), written_.end(), [](const Written& a, const Written& b) { return a.index < b.index; });
  std::string text;
  for (const Written& frame : written_) {
    AppendSeconds((frame.timestamp - written_.front().timestamp).count(), &text);
    text += '\n';
  }
  HAUSTRA_TRY(WriteFile((fs::path(folder_) / "times.txt").string(), text));
  std::error_code ignored;
  fs::remove(fs::path(folder_) / kRecordedTimesName, ignored);
  return Status::Ok();
}

Result<SequenceRecorder::Summary> SequenceRecorder::Finish() {
  StopThreads();
  if (written_.empty()) {
    output_.Discard();
    HAUSTRA_TRY(status_);
    return Unavailable(folder_ + ": the camera gave no frame; nothing is written");
  }
  HAUSTRA_TRY(WriteTimes());
  HAUSTRA_TRY(status_);
  output_.Commit();
  return Summary{static_cast<std::uint32_t>(written_.size()), num_left_out_};
}

}  // namespace haustra
