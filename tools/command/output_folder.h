// The one rule for everything that commands write: what is there already is kept, unless --overwrite says to replace
// it. thread-bound(caller).
//
// Earlier results are not deleted before the new ones are complete. Until then they lie in FOLDER/replaced-PID; what
// ends before it has written anything puts them back.
#pragma once

#include <string>
#include <string_view>
#include <vector>

#include "hal/core/status.h"

namespace haustra {

// What a command writes into a folder.
struct FolderContent {
  std::string_view what;   // "a run", for messages
  std::string_view names;  // regular expression of every name in it, files and folders, relative to the folder
  // A folder in it that is another command's output, and what that holds; empty and null: there is none.
  std::string_view inner_name = {};
  const FolderContent* inner = nullptr;  // its own inner folder does not count
  // A file that Create writes first, for a content whose other names may be those of another command's, too: nothing is
  // replaced without it. Empty: the names alone tell.
  std::string_view mark = {};
};

// What a command writes as one file.
struct FileContent {
  std::string_view what;                     // "a report", for messages
  std::vector<std::string_view> beginnings;  // every such file has one of these; what has none is not replaced
  // False: other files begin so, too (a PNG), so that nothing in a folder of the inputs is replaced.
  bool is_told_by_beginning = true;
};

class OutputFolder {
 public:
  // Whether the folder may be written to: it is not there, is empty, or holds nothing but earlier results and
  // `overwrite` is on. Changes nothing. kFailedPrecondition names what stands in the way; kInvalidArgument: no name.
  static Status Check(const std::string& path, const FolderContent& content, bool overwrite);

  // Makes the folder, and those above it, and sets earlier results aside. From then on a stop is a flag
  // (stop_signal.h). Errors of Check; kUnavailable: the folder cannot be made or changed.
  static Result<OutputFolder> Create(const std::string& path, const FolderContent& content, bool overwrite);

  OutputFolder(OutputFolder&& other) noexcept;
  OutputFolder& operator=(OutputFolder&&) = delete;
  // PutBack, without Commit.
  ~OutputFolder();

  // The new results are complete: the earlier ones go.
  void Commit();
  // Nothing comes of the new results: the earlier ones are put back when no file was written in their place. Where they
  // stay aside; empty: they are back, or there are none.
  std::string PutBack();
  // The new results are not wanted: what was written of them goes, the earlier ones are put back, and a folder that was
  // made for them goes, too.
  void Discard();
  // Where earlier results lie until then; empty: there are none.
  const std::string& aside() const { return aside_; }

 private:
  OutputFolder(std::string path, const FolderContent& content) : path_(std::move(path)), content_(content) {}

  Status SetAside();

  std::string path_;
  FolderContent content_;
  bool is_new_ = false;  // the folder was not there before
  std::string aside_;
};

// Whether none of what a command reads lies in the folder that it writes. What is not there does not.
// kFailedPrecondition names the first that does.
Status CheckInputsOutside(const std::string& folder, const std::vector<std::string>& inputs);

// Whether a file may be written: nothing has its name, or an earlier file of `content` or an empty one has it,
// `overwrite` is on and it is none of `inputs`. Errors as OutputFolder::Check; kNotFound: its folder does not exist;
// kUnavailable: what is there cannot be read.
Status CheckOutputFile(const std::string& path, const FileContent& content, bool overwrite,
                       const std::vector<std::string>& inputs);

// What an option of a command names, which is written.
struct NamedOutput {
  std::string_view option;
  std::string path;  // empty: not given
};

// Whether two are two files, whatever the spelling. kInvalidArgument names both.
Status CheckOutputsDiffer(const NamedOutput& one, const NamedOutput& other);

// Whether one is none of the files that the command writes into `folder`, too. kInvalidArgument.
Status CheckNotOfFolder(const NamedOutput& output, const std::string& folder, const FolderContent& content);

// As a whole or not at all (capture/files/file_sink.h). From then on a stop is a flag (stop_signal.h). Errors of
// FileSink.
Status WriteFile(const std::string& path, std::string_view bytes);

}  // namespace haustra
