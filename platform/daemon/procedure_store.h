// What a procedure leaves on the disk, so that a crash or a power cut loses no more than what came after the last
// checkpoint, and so that nothing of it outlasts its end unless somebody wants it to.
//
//   FOLDER/lock              held while a daemon uses the folder
//   FOLDER/procedure         that a procedure is open, and what it is called
//   FOLDER/checkpoint.atlas  its maps (engine/io/atlas_format.h)
//   FOLDER/saved/NAME.atlas  maps that were kept
//
// Files are replaced as a whole or not at all (capture/files/file_sink.h), those before them are overwritten, and they
// are readable by the service alone. Nothing replaces a file in saved/.
#pragma once

#include <cstdint>
#include <memory>
#include <optional>
#include <string>

#include "hal/core/status.h"
#include "hal/core/time.h"

namespace haustra {

// How the service that wrote a record was last heard of.
enum class RecordedState {
  kRunning,  // it did not come to say that it stops: a crash, a kill, a power cut
  kStopped,  // somebody stopped it in order
};

// An open procedure, as it stands on the disk.
struct ProcedureRecord {
  std::string label;    // may be empty
  std::string boot_id;  // of the system's run in which it was written
  // CLOCK_BOOTTIME of that run when it was written: no jump of the wall clock moves it.
  Duration written_at{0};
  RecordedState state = RecordedState::kRunning;
};

std::string ToText(const ProcedureRecord& record);
// kDataLoss says what is wrong.
Result<ProcedureRecord> ParseProcedureRecord(const std::string& text);

// thread-safe as long as no two calls concern the same file.
class ProcedureStore {
 public:
  // Makes the folder for saved maps and wipes what a crash left half written, with a line in the log for each file.
  // What cannot be wiped counts as an open procedure: nothing else begins before Close has wiped it. kNotFound: no such
  // folder; kUnavailable: no right to use it; kFailedPrecondition: another daemon does.
  static Result<std::unique_ptr<ProcedureStore>> Open(const std::string& folder);
  ~ProcedureStore();
  ProcedureStore(const ProcedureStore&) = delete;
  ProcedureStore& operator=(const ProcedureStore&) = delete;

  std::string checkpoint_path() const { return folder_ + "/checkpoint.atlas"; }
  std::string saved_path(const std::string& name) const { return folder_ + "/saved/" + name + ".atlas"; }
  bool has_checkpoint() const;
  bool has_saved(const std::string& name) const;
  // The first of NAME, NAME-2, NAME-3 ... that no saved file has. Right as long as nobody else puts one there: to be
  // asked where files are put into place.
  std::string FreeName(const std::string& name) const;

  // What an earlier daemon had left open at Open; nothing when it had ended its procedure. A record that cannot be read
  // counts as an open procedure without a name.
  const std::optional<ProcedureRecord>& interrupted() const { return interrupted_; }
  // Whether it may go on by itself: written in this run of the system, no longer ago than that, and not stopped in
  // order.
  bool MayResume(Duration limit) const;

  // Says that a procedure is open, at its begin, after each checkpoint and at the stop. kUnavailable.
  Status WriteOpen(const std::string& label, RecordedState state) const;
  // The same record, but stopped. It is changed in place, which needs no room on the disk; where there is none that can
  // be read, one is written as by WriteOpen. kUnavailable.
  Status MarkStopped(const std::string& label) const;
  // The procedure has ended: what was half written, checkpoint and record are overwritten and removed. A power cut in
  // between leaves a record without data, which the tower is asked about; never data that nobody knows of. kUnavailable
  // names what could not be wiped. It stays with the record, for another try.
  Status Close() const;
  // The checkpoint becomes a saved file under a name that is free (FreeName). Which one. kUnavailable: it is still
  // there for another try, or the message says that it is in place.
  Result<std::string> KeepCheckpoint(const std::string& name) const;

 private:
  ProcedureStore(std::string folder, int lock);
  std::string record_path() const { return folder_ + "/procedure"; }
  // What a crash left half written, and what was replaced or given up and could not be overwritten. No file is being
  // written meanwhile. kUnavailable names the first that stays.
  Status WipeLeftovers() const;

  std::string folder_;
  int lock_;
  std::optional<ProcedureRecord> interrupted_;
};

}  // namespace haustra
