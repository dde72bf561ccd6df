// What is there already is kept: refused without --overwrite, set aside with it, back again when nothing came of it.
#include "tools/command/output_folder.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <filesystem>
#include <optional>
#include <string>
#include <vector>

#include "capture/files/file_sink.h"
#include "tests/capture/temp_folder.h"
#include "tools/command/sequence_content.h"

namespace haustra {
namespace {

namespace fs = std::filesystem;
using ::testing::HasSubstr;

constexpr FolderContent kContent{"a result", R"(table\.csv|maps(/map_\d+\.ply)?)"};

class OutputFolderTest : public testing::Test {
 protected:
  void WriteEarlier() const {
    folder_.Write("out/table.csv", "earlier");
    folder_.Write("out/maps/map_0.ply", "earlier map");
  }
  // Names of all files, sorted.
  std::vector<std::string> Files() const {
    std::vector<std::string> files;
    for (const auto& entry : fs::recursive_directory_iterator(out_)) {
      if (!entry.is_directory()) files.push_back(entry.path().lexically_relative(out_).generic_string());
    }
    std::sort(files.begin(), files.end());
    return files;
  }
  Status Check(bool overwrite) const { return OutputFolder::Check(out_, kContent, overwrite); }
  Result<OutputFolder> Create() const { return OutputFolder::Create(out_, kContent, true); }

  const TempFolder folder_;
  const std::string out_ = folder_.Path("out");
  const std::vector<std::string> earlier_ = {"maps/map_0.ply", "table.csv"};
};

TEST_F(OutputFolderTest, NewAndEmptyFoldersAreTaken) {
  EXPECT_TRUE(Check(false).ok());
  EXPECT_FALSE(fs::exists(out_));
  fs::create_directories(out_ + "/maps");  // of a run that came to nothing
  EXPECT_TRUE(Check(false).ok());
  EXPECT_EQ(OutputFolder::Check("", kContent, true).code(), StatusCode::kInvalidArgument);
}

TEST_F(OutputFolderTest, EarlierResultsNeedOverwrite) {
  WriteEarlier();
  const Status refused = Check(false);
  EXPECT_EQ(refused.code(), StatusCode::kFailedPrecondition);
  EXPECT_THAT(refused.message(), HasSubstr(out_ + ": holds a result already; --overwrite replaces it"));
  EXPECT_EQ(OutputFolder::Create(out_, kContent, false).code(), StatusCode::kFailedPrecondition);
  EXPECT_EQ(Files(), earlier_);
  EXPECT_TRUE(Check(true).ok());
}

TEST_F(OutputFolderTest, ForeignFilesAreNeverTouched) {
  WriteEarlier();
  folder_.Write("out/maps/scan.ply", "precious");
  for (const bool overwrite : {false, true}) {
    EXPECT_EQ(Check(overwrite).code(), StatusCode::kFailedPrecondition);
    EXPECT_THAT(Check(overwrite).message(), HasSubstr("holds 'maps/scan.ply', which is not part of a result"));
  }
  EXPECT_EQ(Create().code(), StatusCode::kFailedPrecondition);
  EXPECT_EQ(folder_.Read("out/maps/scan.ply"), "precious");
}

TEST_F(OutputFolderTest, FileOfTheNameIsInTheWay) {
  folder_.Write("out", "precious");
  EXPECT_EQ(Check(true).code(), StatusCode::kFailedPrecondition);
  EXPECT_EQ(folder_.Read("out"), "precious");
  EXPECT_EQ(OutputFolder::Create(out_ + "/below", kContent, true).code(), StatusCode::kUnavailable);
}

TEST_F(OutputFolderTest, CommitReplacesTheEarlierResults) {
  WriteEarlier();
  folder_.Write("out/table.csv.partial-7", "of a killed run");
  {
    Result<OutputFolder> folder = Create();
    ASSERT_TRUE(folder.ok()) << folder.status().ToString();
    folder_.Write("out/table.csv", "new");
    EXPECT_EQ(Files().size(), 4u);  // the earlier ones are still there
    folder->Commit();
  }
  EXPECT_EQ(Files(), std::vector<std::string>{"table.csv"});
  EXPECT_EQ(folder_.Read("out/table.csv"), "new");
}

TEST_F(OutputFolderTest, WhatAKilledRunWasWritingIsReplaced) {
  WriteEarlier();
  // As it lies at the moment of the kill.
  const Result<FileSink> table = FileSink::Create(out_ + "/table.csv");
  const Result<FileSink> map = FileSink::Create(out_ + "/maps/map_0.ply");
  ASSERT_TRUE(table.ok() && map.ok());
  EXPECT_EQ(Files().size(), 4u);
  EXPECT_TRUE(Check(true).ok()) << Check(true).message();
  folder_.Write("out/table.csv.partial-mine", "precious");
  EXPECT_EQ(Check(true).code(), StatusCode::kFailedPrecondition);
}

TEST_F(OutputFolderTest, StartThatFailsPutsTheEarlierResultsBack) {
  WriteEarlier();
  {
    const Result<OutputFolder> folder = Create();
    ASSERT_TRUE(folder.ok());
    fs::create_directories(out_ + "/maps");
    EXPECT_FALSE(fs::exists(out_ + "/table.csv"));
  }
  EXPECT_EQ(Files(), earlier_);
  EXPECT_EQ(folder_.Read("out/maps/map_0.ply"), "earlier map");
}

TEST_F(OutputFolderTest, PutBackSaysWhereEarlierResultsStay) {
  WriteEarlier();
  Result<OutputFolder> folder = Create();
  ASSERT_TRUE(folder.ok());
  EXPECT_EQ(folder->PutBack(), "");
  EXPECT_EQ(Files(), earlier_);
  Result<OutputFolder> again = Create();
  ASSERT_TRUE(again.ok());
  folder_.Write("out/table.csv", "half");
  EXPECT_EQ(again->PutBack(), again->aside());
  EXPECT_TRUE(fs::exists(again->aside() + "/table.csv"));
}

TEST_F(OutputFolderTest, UnfinishedResultsLeaveTheEarlierOnesAside) {
  WriteEarlier();
  std::string aside;
  {
    const Result<OutputFolder> folder = Create();
    ASSERT_TRUE(folder.ok());
    aside = folder->aside();
    folder_.Write("out/table.csv", "half");
  }
  EXPECT_EQ(folder_.Read("out/table.csv"), "half");
  EXPECT_TRUE(fs::exists(aside + "/maps/map_0.ply"));
  // They count as results of ours.
  EXPECT_EQ(Check(false).code(), StatusCode::kFailedPrecondition);
  ASSERT_TRUE(Check(true).ok());
  Result<OutputFolder> again = Create();
  ASSERT_TRUE(again.ok());
  again->Commit();
  EXPECT_TRUE(Files().empty());
}

// One command's folder inside another's: its names count there, and only there.
TEST_F(OutputFolderTest, AnInnerFolderIsReplacedWithTheRest) {
  static constexpr FolderContent kInner{"a mesh", R"(mesh\.ply)"};
  constexpr FolderContent kWithInner{"a result", kContent.names, "wall", &kInner};
  WriteEarlier();
  folder_.Write("out/wall/mesh.ply", "earlier mesh");
  folder_.Write("out/wall/mesh.ply.partial-7", "of a killed run");
  folder_.Write("out/wall/replaced-7/mesh.ply", "set aside");
  EXPECT_EQ(Check(true).code(), StatusCode::kFailedPrecondition) << "of a content without it";
  ASSERT_TRUE(OutputFolder::Check(out_, kWithInner, true).ok());
  folder_.Write("out/wall/scan.ply", "precious");
  EXPECT_THAT(OutputFolder::Check(out_, kWithInner, true).message(), HasSubstr("holds 'wall/scan.ply'"));
  fs::remove(out_ + "/wall/scan.ply");
  folder_.Write("out/mesh.ply", "precious");
  EXPECT_THAT(OutputFolder::Check(out_, kWithInner, true).message(), HasSubstr("holds 'mesh.ply'"));
  fs::remove(out_ + "/mesh.ply");
  Result<OutputFolder> folder = OutputFolder::Create(out_, kWithInner, true);
  ASSERT_TRUE(folder.ok()) << folder.status().ToString();
  EXPECT_FALSE(fs::exists(out_ + "/wall"));
  folder->Commit();
  EXPECT_TRUE(Files().empty());
}

TEST_F(OutputFolderTest, WhatIsDiscardedGoesAndTheEarlierResultsComeBack) {
  WriteEarlier();
  Result<OutputFolder> folder = Create();
  ASSERT_TRUE(folder.ok());
  folder_.Write("out/table.csv", "half");
  folder_.Write("out/maps/map_1.ply.partial-7", "half");
  folder->Discard();
  EXPECT_EQ(Files(), earlier_);
  EXPECT_EQ(folder_.Read("out/table.csv"), "earlier");
}

TEST_F(OutputFolderTest, FolderThatWasMadeForWhatIsDiscardedGoes) {
  Result<OutputFolder> folder = Create();
  ASSERT_TRUE(folder.ok());
  folder_.Write("out/maps/map_0.ply", "half");
  folder->Discard();
  EXPECT_FALSE(fs::exists(out_));
}

TEST_F(OutputFolderTest, WhatSomebodyElsePutThereIsNotDiscarded) {
  Result<OutputFolder> folder = Create();
  ASSERT_TRUE(folder.ok());
  folder_.Write("out/table.csv", "half");
  folder_.Write("out/maps/scan.ply", "precious");
  folder->Discard();
  EXPECT_EQ(Files(), std::vector<std::string>{"maps/scan.ply"});
}

// The names of its files are also those of another content.
TEST_F(OutputFolderTest, WithoutItsMarkNothingIsReplaced) {
  static constexpr FolderContent kMarked{"a copy", R"(map_\d+\.ply)", {}, nullptr, "copy.txt"};
  folder_.Write("out/maps/map_0.ply", "precious");
  const std::string maps = out_ + "/maps";
  const Status refused = OutputFolder::Check(maps, kMarked, true);
  EXPECT_EQ(refused.code(), StatusCode::kFailedPrecondition);
  EXPECT_THAT(refused.message(), HasSubstr("has no 'copy.txt', so its files need not be a copy"));
  EXPECT_EQ(OutputFolder::Create(maps, kMarked, true).code(), StatusCode::kFailedPrecondition);
  EXPECT_EQ(Files(), std::vector<std::string>{"maps/map_0.ply"});

  const std::string copy = out_ + "/copy";
  for (const char* text : {"first", "second"}) {
    Result<OutputFolder> folder = OutputFolder::Create(copy, kMarked, true);
    ASSERT_TRUE(folder.ok()) << folder.status().ToString();
    folder_.Write("out/copy/map_0.ply", text);
    folder->Commit();
  }
  EXPECT_EQ(folder_.Read("out/copy/map_0.ply"), "second");
  EXPECT_TRUE(fs::exists(copy + "/copy.txt"));
}

TEST_F(OutputFolderTest, InputsAreLookedForInTheOutput) {
  folder_.Write("out/table.csv", "read");
  folder_.Write("output.csv", "read");
  EXPECT_TRUE(CheckInputsOutside(out_, {"", folder_.Path("output.csv"), out_ + "/none", folder_.path()}).ok());
  for (const std::string& folder : {out_, out_ + "/", out_ + "/../out", folder_.path()}) {
    EXPECT_EQ(CheckInputsOutside(folder, {out_ + "/table.csv"}).code(), StatusCode::kFailedPrecondition) << folder;
  }
  fs::create_symlink(out_, folder_.Path("link"));
  EXPECT_EQ(CheckInputsOutside(folder_.Path("link"), {out_ + "/table.csv"}).code(), StatusCode::kFailedPrecondition);
}

TEST_F(OutputFolderTest, RenderedAndRecordedSequencesAreKnown) {
  for (const char* name : {"frames/000012.jpg", "frames/1000000.png", "times.txt", "times.recording", "calib.yaml",
                           "mask.png", "groundtruth.txt", "events.csv", "revisits.csv"}) {
    folder_.Write(std::string("out/") + name, "x");
  }
  EXPECT_TRUE(OutputFolder::Check(out_, kSequenceContent, true).ok());
  folder_.Write("out/frames/holiday.jpg", "precious");
  EXPECT_EQ(OutputFolder::Check(out_, kSequenceContent, true).code(), StatusCode::kFailedPrecondition);
}

TEST_F(OutputFolderTest, FilesFollowTheSameRule) {
  const FileContent file{"a page", {"<page", "xml"}};
  EXPECT_TRUE(CheckOutputFile(out_, file, false, {}).ok());
  folder_.Write("out", "<page>");
  EXPECT_THAT(CheckOutputFile(out_, file, false, {}).message(),
              HasSubstr(out_ + ": exists already; --overwrite replaces it"));
  EXPECT_TRUE(CheckOutputFile(out_, file, true, {}).ok());
  folder_.Write("out", "");  // as mktemp makes it
  EXPECT_TRUE(CheckOutputFile(out_, file, true, {}).ok());
  for (const char* foreign : {"<pag", "precious"}) {
    folder_.Write("out", foreign);
    for (const bool overwrite : {false, true}) {
      const Status status = CheckOutputFile(out_, file, overwrite, {});
      EXPECT_EQ(status.code(), StatusCode::kFailedPrecondition);
      EXPECT_THAT(status.message(), HasSubstr(out_ + ": exists already and is not a page; choose another file"));
    }
  }
  // Renaming a file into the place of a device would be the end of that device.
  EXPECT_EQ(CheckOutputFile("/dev/null", file, true, {}).code(), StatusCode::kFailedPrecondition);
  EXPECT_EQ(CheckOutputFile(folder_.path(), file, true, {}).code(), StatusCode::kFailedPrecondition);
  EXPECT_EQ(CheckOutputFile("", file, true, {}).code(), StatusCode::kInvalidArgument);
  // Known before the work, not after hours of it.
  const Status homeless = CheckOutputFile(folder_.Path("none/page.html"), file, false, {});
  EXPECT_EQ(homeless.code(), StatusCode::kNotFound);
  EXPECT_THAT(homeless.message(), HasSubstr("page.html: its folder does not exist"));
  EXPECT_TRUE(CheckOutputFile("page.html", file, false, {}).ok());
  const Status own_input = CheckOutputFile(out_, file, true, {folder_.Path("none"), folder_.path() + "/./out"});
  EXPECT_EQ(own_input.code(), StatusCode::kFailedPrecondition);
  EXPECT_THAT(own_input.message(), HasSubstr(out_ + ": is read"));
}

}  // namespace
}  // namespace haustra
