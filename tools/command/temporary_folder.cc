#include "tools/command/temporary_folder.h"

#include <unistd.h>

#include <filesystem>
#include <system_error>

#include "tools/command/stop_signal.h"

namespace haustra {

namespace fs = std::filesystem;

TemporaryFolder::TemporaryFolder(const std::string& name) {
  CatchStopSignals();
  std::string pattern = (fs::temp_directory_path() / ("haustra-" + name + "-XXXXXX")).string();
  if (mkdtemp(pattern.data()) != nullptr) path_ = pattern;
}

TemporaryFolder::~TemporaryFolder() {
  std::error_code error;
  if (!path_.empty()) fs::remove_all(path_, error);
}

}  // namespace haustra
