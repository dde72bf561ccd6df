#include "tools/soak/sample_file.h"

#include <fcntl.h>

#include <cerrno>

#include "hal/core/errno_text.h"
#include "tools/command/output_folder.h"

namespace haustra {

void SampleFile::Add(const SoakSample& sample) {
  if (path_.empty() || !status_.ok()) return;
  status_ = lines_ == nullptr ? Begin(sample) : lines_->Append(SoakCsvLine(sample));
}

Status SampleFile::Begin(const SoakSample& first) {
  HAUSTRA_TRY(WriteFile(path_, SoakCsvHeader() + SoakCsvLine(first)));
  const int file = ::open(path_.c_str(), O_WRONLY | O_APPEND | O_CLOEXEC);
  if (file < 0) return Unavailable(path_ + ": cannot be written: " + ErrnoText(errno));
  lines_ = std::make_unique<LineFile>(path_, file);
  return Status::Ok();
}

}  // namespace haustra
