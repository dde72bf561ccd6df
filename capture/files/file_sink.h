// A file that is there as a whole or not at all: bytes go to a temporary file beside it, Commit renames it into place.
// A reader, or a crash in the middle, never meets half a file, and an older file stays until the new one is complete.
// Any number of writers of one name do not meet: the last to commit wins, or the first where a file stays (of several
// processes: rename.h).
#pragma once

#include <cstdint>
#include <span>
#include <string>
#include <string_view>

#include "capture/files/write_buffer.h"
#include "hal/core/byte_sink.h"
#include "hal/core/status.h"

namespace haustra {

// What becomes of the bytes that a new file replaces, or that were not committed: the file system gets them as they
// are, or overwritten (wipe_file.h), which takes as long as writing them. kStays: no file is replaced, and what was not
// committed is overwritten. What cannot be overwritten keeps the temporary name.
enum class FormerFile { kFreed, kWiped, kStays };

// Up to what a committed file is there as a whole. A power cut costs the wait for the disk, twice: too long for each of
// the frames of a camera, where it may leave the last ones empty.
enum class Outlasts { kPowerCut, kProcess };

// thread-bound(the writer), not rt-safe.
class FileSink final : public ByteSink {
 public:
  // kNotFound: the folder does not exist; kUnavailable: cannot be created (rights, disk). The message names the file.
  // Where the file system cannot exchange two names (FAT, NFS), a crash while kWiped overwrites the former file leaves
  // the new one in place, and the rest of the former one on the disk, without a name.
  static Result<FileSink> Create(const std::string& path, FormerFile former, Outlasts outlasts = Outlasts::kPowerCut);
  // kFreed.
  static Result<FileSink> Create(const std::string& path);

  FileSink(FileSink&& other) noexcept;
  FileSink& operator=(FileSink&&) = delete;
  // Without Commit the temporary file is removed, and what was at `path` before stays.
  ~FileSink() override;

  // kUnavailable: disk full, I/O error. After the first error nothing more is written and Commit fails.
  Status Write(std::string_view bytes) override;
  // Of the temporary file, for another process that writes the bytes in place of Write; -1 after an error or Commit.
  int descriptor() const { return descriptor_; }

  // To the disk (kPowerCut) and into place, with the folder's entry. kUnavailable as for Write, and with kStays when
  // there is a file; kFailedPrecondition when called twice.
  Status Commit();
  // The same under another name in that folder.
  Status CommitAs(const std::string& path);

 private:
  FileSink(std::string path, std::string temporary_path, int descriptor, FormerFile former, Outlasts outlasts);

  // Discards, and stays in the error.
  Status FailWriting(int error);
  void Discard();
  void RemoveTemporary();
  // The former file, once the new one is in place.
  struct Former {
    bool has_temporary_name = false;
    int descriptor = -1;  // without a name; -1: there is none
  };
  bool PutIntoPlace(Former* former) const;
  Status Wipe(const Former& former) const;

  std::string path_;
  std::string temporary_path_;
  int descriptor_ = -1;  // -1: committed, failed or moved from
  FormerFile former_ = FormerFile::kFreed;
  Outlasts outlasts_ = Outlasts::kPowerCut;
  WriteBuffer buffer_;
  Status status_;
};

// All of a file at once. Errors of FileSink.
Status WriteWholeFile(const std::string& path, std::string_view bytes, Outlasts outlasts = Outlasts::kPowerCut);
Status WriteWholeFile(const std::string& path, std::span<const std::uint8_t> bytes,
                      Outlasts outlasts = Outlasts::kPowerCut);

}  // namespace haustra
