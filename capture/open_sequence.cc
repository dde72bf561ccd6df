#include "capture/open_sequence.h"

#include <filesystem>
#include <system_error>
#include <utility>

#include "capture/dataset/endomapper.h"
#include "capture/dataset/folder.h"
#include "capture/dataset/sequence_listing.h"
#include "capture/image_folder_source.h"
#include "capture/v4l2/v4l2_source.h"
#include "capture/video_source.h"

namespace haustra {
namespace {

using capture::internal::CheckFolder;
using capture::internal::FileNames;
using capture::internal::IsFile;
using capture::internal::IsFolder;
using capture::internal::Joined;

Result<SequenceListing> ListFolder(const std::string& folder, const SequenceOptions& options) {
  if (LooksLikeEuroc(folder)) return ListEuroc(folder, options);
  if (LooksLikeTum(folder)) return ListTum(folder, options);
  if (LooksLikeC3vd(folder)) return ListC3vd(folder, options);
  if (LooksLikeSequenceFolder(folder)) return ListSequenceFolder(folder, options);
  HAUSTRA_TRY(CheckFolder(folder));
  std::string message =
      folder +
      ": not a sequence that is known here; looked for frames/ with calib.yaml (haustra), N_color.png "
      "(C3VD), a recording .mov, .mp4, .m4v, .avi or .mkv (EndoMapper), mav0/cam0/data.csv (EuRoC), rgb.txt "
      "(TUM), and .png or .jpg files in the folder itself";
  // A file that is named itself is told by what it holds.
  if (const Result<std::vector<std::string>> names = FileNames(folder); names.ok() && !names->empty()) {
    message += "; a video whose name ends otherwise is named itself: " + Joined(folder, names->front());
  }
  return InvalidArgument(message);
}

Result<std::unique_ptr<FrameSource>> OpenFolder(const std::string& folder, const SequenceOptions& options) {
  // After everything that is told by a name.
  const bool is_named =
      LooksLikeEuroc(folder) || LooksLikeTum(folder) || LooksLikeC3vd(folder) || IsFolder(Joined(folder, "frames"));
  if (!is_named && LooksLikeEndomapper(folder)) return OpenEndomapper(folder, options);
  HAUSTRA_ASSIGN(SequenceListing listing, ListFolder(folder, options));
  return ImageFolderSource::Create(std::move(listing), options);
}

}  // namespace

Result<std::unique_ptr<FrameSource>> OpenSequence(const std::string& path, const SequenceOptions& options) {
  HAUSTRA_TRY(options.Validate());
  if (IsV4l2Spec(path)) {
    HAUSTRA_TRY(options.RefuseFrameRate(path));
    return OpenV4l2(path, options);
  }
  if (IsFolder(path)) return OpenFolder(path, options);
  if (IsFile(path)) return OpenVideo(path, options);
  const Status status = CheckFolder(path);
  return status.code() == StatusCode::kUnavailable ? status : NotFound(path + ": no such file or folder");
}

}  // namespace haustra
