#include "platform/daemon/procedure_store.h"

#include <fcntl.h>
#include <sys/file.h>
#include <sys/stat.h>
#include <unistd.h>

#include <algorithm>
#include <array>
#include <cerrno>
#include <charconv>
#include <cstdio>
#include <ctime>
#include <filesystem>
#include <fstream>
#include <iterator>
#include <regex>
#include <system_error>
#include <utility>
#include <vector>

#include "capture/files/file_sink.h"
#include "capture/files/rename.h"
#include "capture/files/wipe_file.h"
#include "hal/core/errno_text.h"
#include "platform/control/control_protocol.h"
#include "platform/daemon/log.h"

namespace haustra {
namespace {

namespace fs = std::filesystem;

constexpr std::string_view kRecordHead = "haustra procedure 2\n";

Duration BootTime() {
  timespec now{};
  ::clock_gettime(CLOCK_BOOTTIME, &now);
  return std::chrono::seconds(now.tv_sec) + Duration(now.tv_nsec);
}

std::string BootId() {
  std::ifstream file("/proc/sys/kernel/random/boot_id");
  std::string id;
  std::getline(file, id);
  return id;
}

// Its first 4096 bytes. kNotFound: there is none; kUnavailable: it cannot be read.
Result<std::string> ReadSmallFile(const std::string& path) {
  const int descriptor = ::open(path.c_str(), O_RDONLY | O_CLOEXEC | O_NOFOLLOW);
  if (descriptor < 0) {
    const int error = errno;
    return error == ENOENT ? NotFound(path + ": is not there")
                           : Unavailable(path + ": cannot be read: " + ErrnoText(error));
  }
  std::string text(4096, '\0');
  const ssize_t count = ::read(descriptor, text.data(), text.size());
  const int error = errno;
  ::close(descriptor);
  if (count < 0) return Unavailable(path + ": cannot be read: " + ErrnoText(error));
  text.resize(static_cast<std::size_t>(count));
  return text;
}

constexpr std::string_view kRunningWord = "running";
constexpr std::string_view kStoppedWord = "stopped";

std::string_view WordFor(RecordedState state) { return state == RecordedState::kRunning ? kRunningWord : kStoppedWord; }

// Whether FileSink gave the name, to one of the files of this folder: NAME.partial-PROCESS-COUNT. Labels have dots and
// dashes, too.
bool IsHalfWritten(const std::string& name) {
  static const std::regex kForm(R"((procedure|.+\.atlas)\.partial-[0-9]+-[0-9]+)");
  return std::regex_match(name, kForm);
}

// Ok only where it is known that no file has that name: of what cannot be looked at nobody knows whether it is there.
Status WipeIfThere(const std::string& path) {
  std::error_code error;
  return fs::symlink_status(path, error).type() == fs::file_type::not_found ? Status::Ok() : WipeFile(path);
}

}  // namespace

std::string ToText(const ProcedureRecord& record) {
  return std::string(kRecordHead) + "label " + record.label + "\nboot " + record.boot_id + "\nwritten_at_ns " +
         std::to_string(record.written_at.count()) + "\nstate " + std::string(WordFor(record.state)) + "\n";
}

Result<ProcedureRecord> ParseProcedureRecord(const std::string& text) {
  if (!text.starts_with(kRecordHead)) return DataLoss("is not a record of a procedure");
  std::string_view rest = std::string_view(text).substr(kRecordHead.size());
  const auto take = [&rest](std::string_view key) -> std::optional<std::string> {
    const std::size_t end = rest.find('\n');
    if (end == std::string_view::npos || !rest.starts_with(key)) return std::nullopt;
    std::string value(rest.substr(key.size(), end - key.size()));
    rest.remove_prefix(end + 1);
    return value;
  };
  const std::optional<std::string> label = take("label ");
  if (!label || (!label->empty() && !IsControlName(*label))) return DataLoss("its label cannot be read");
  const std::optional<std::string> boot = take("boot ");
  if (!boot || boot->size() > 64) return DataLoss("its boot id cannot be read");
  const std::optional<std::string> written = take("written_at_ns ");
  std::int64_t written_ns = -1;
  if (written) {
    const auto [end, error] = std::from_chars(written->data(), written->data() + written->size(), written_ns);
    if (error != std::errc() || end != written->data() + written->size()) written_ns = -1;
  }
  if (written_ns < 0) return DataLoss("its time cannot be read");
  const std::optional<std::string> word = take("state ");
  for (const RecordedState state : {RecordedState::kRunning, RecordedState::kStopped}) {
    if (word != WordFor(state)) continue;
    if (!rest.empty()) return DataLoss("it goes on after its end");
    return ProcedureRecord{*label, *boot, Duration(written_ns), state};
  }
  return DataLoss("its state cannot be read");
}

Result<std::unique_ptr<ProcedureStore>> ProcedureStore::Open(const std::string& folder) {
  const int lock = ::open((folder + "/lock").c_str(), O_RDWR | O_CREAT | O_CLOEXEC | O_NOFOLLOW, 0600);
  if (lock < 0) {
    const int error = errno;
    if (error == ENOENT || error == ENOTDIR) return NotFound(folder + ": no such folder");
    return Unavailable(folder + ": cannot be used: " + ErrnoText(error));
  }
  if (::flock(lock, LOCK_EX | LOCK_NB) != 0) {
    ::close(lock);
    return FailedPrecondition(folder + ": another haustrad uses it");
  }
  std::unique_ptr<ProcedureStore> store(new ProcedureStore(folder, lock));
  std::error_code error;
  fs::create_directory(folder + "/saved", error);
  if (error) return Unavailable(folder + "/saved: cannot be made: " + error.message());
  Status wiped = store->WipeLeftovers();
  const Result<std::string> text = ReadSmallFile(store->record_path());
  if (text.code() != StatusCode::kNotFound) {
    const Result<ProcedureRecord> record = text.ok() ? ParseProcedureRecord(*text) : text.status();
    if (!record.ok()) Log(LogLevel::kError, "record_cannot_be_read", {{"what", record.status().message()}});
    store->interrupted_ = record.ok() ? *record : ProcedureRecord{};
  } else if (wiped.ok() && store->has_checkpoint()) {
    wiped = WipeFile(store->checkpoint_path());
  }
  if (!wiped.ok()) {
    Log(LogLevel::kError, "leftover_not_wiped", {{"what", wiped.message()}});
    if (!store->interrupted_) store->interrupted_ = ProcedureRecord{};
  }
  return store;
}

ProcedureStore::ProcedureStore(std::string folder, int lock) : folder_(std::move(folder)), lock_(lock) {}

ProcedureStore::~ProcedureStore() { ::close(lock_); }

bool ProcedureStore::has_checkpoint() const {
  std::error_code error;
  return fs::is_regular_file(checkpoint_path(), error);
}

bool ProcedureStore::has_saved(const std::string& name) const {
  std::error_code error;
  return fs::exists(fs::symlink_status(saved_path(name), error));
}

std::string ProcedureStore::FreeName(const std::string& name) const {
  std::string free = name;
  for (int i = 2; has_saved(free); ++i) free = name + "-" + std::to_string(i);
  return free;
}

bool ProcedureStore::MayResume(Duration limit) const {
  if (!interrupted_ || interrupted_->boot_id.empty() || interrupted_->boot_id != BootId()) return false;
  if (interrupted_->state == RecordedState::kStopped) return false;
  return BootTime() - interrupted_->written_at <= limit;
}

Status ProcedureStore::WriteOpen(const std::string& label, RecordedState state) const {
  HAUSTRA_ASSIGN(FileSink sink, FileSink::Create(record_path(), FormerFile::kWiped));
  HAUSTRA_TRY(sink.Write(ToText(ProcedureRecord{label, BootId(), BootTime(), state})));
  return sink.Commit();
}

Status ProcedureStore::MarkStopped(const std::string& label) const {
  const Result<std::string> text = ReadSmallFile(record_path());
  const Result<ProcedureRecord> record = text.ok() ? ParseProcedureRecord(*text) : text.status();
  if (!record.ok()) return WriteOpen(label, RecordedState::kStopped);
  if (record->state == RecordedState::kStopped) return Status::Ok();
  // The word is the last one, before the end of the line, and as long as the other: a crash leaves one of the two.
  static_assert(kRunningWord.size() == kStoppedWord.size());
  const std::string_view word = kStoppedWord;
  const auto at = static_cast<off_t>(text->size() - word.size() - 1);
  const int descriptor = ::open(record_path().c_str(), O_WRONLY | O_CLOEXEC | O_NOFOLLOW);
  const bool is_marked = descriptor >= 0 && ::pwrite(descriptor, word.data(), word.size(), at) == std::ssize(word) &&
                         ::fdatasync(descriptor) == 0;
  if (descriptor >= 0) ::close(descriptor);
  return is_marked ? Status::Ok() : WriteOpen(label, RecordedState::kStopped);
}

Status ProcedureStore::WipeLeftovers() const {
  Status all;
  for (const std::string& place : {folder_, folder_ + "/saved"}) {
    std::error_code error;
    fs::directory_iterator entry(place, error);
    for (; !error && entry != fs::directory_iterator(); entry.increment(error)) {
      const std::string path = entry->path().string();
      std::error_code unknown;
      const bool is_other = !entry->is_regular_file(unknown) && !unknown;
      if (is_other || !IsHalfWritten(entry->path().filename().string())) continue;
      const Status wiped = WipeFile(path);
      if (wiped.ok()) Log(LogLevel::kWarning, "leftover_removed", {{"file", path}});
      if (all.ok()) all = wiped;
    }
    const bool is_unknown = error && error != std::errc::no_such_file_or_directory;
    if (is_unknown && all.ok()) all = Unavailable(place + ": cannot be looked into: " + error.message());
  }
  return all;
}

Status ProcedureStore::Close() const {
  Status all = WipeLeftovers();
  const Status wiped = WipeIfThere(checkpoint_path());
  if (all.ok()) all = wiped;
  HAUSTRA_TRY(all);
  return WipeIfThere(record_path());
}

Result<std::string> ProcedureStore::KeepCheckpoint(const std::string& name) const {
  const std::string free = FreeName(name);
  const std::string path = saved_path(free);
  if (!RenameToFreeName(checkpoint_path(), path)) {
    return Unavailable(path + ": cannot be put into place: " + ErrnoText(errno));
  }
  Status synced = SyncFolderOf(path);
  if (synced.ok()) synced = SyncFolderOf(checkpoint_path());
  if (synced.ok()) return free;
  // Put back, it can be kept by another try.
  if (!RenameToFreeName(path, checkpoint_path())) return synced;
  return Unavailable(path + ": would not outlast a power cut, the checkpoint stays: its folder cannot be synced");
}

}  // namespace haustra
