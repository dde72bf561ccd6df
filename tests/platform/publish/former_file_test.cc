// What a daemon of another version left in the shared memory when it died: of an unknown layout, but a patient's.
#include <gtest/gtest.h>
#include <signal.h>
#include <sys/wait.h>
#include <unistd.h>

#include <cstring>
#include <filesystem>
#include <fstream>
#include <functional>
#include <iterator>
#include <string>
#include <system_error>
#include <utility>
#include <vector>

#include "platform/publish/depth_table_writer.h"
#include "platform/publish/haustra_pose_ring.h"
#include "platform/publish/pose_ring_writer.h"
#include "platform/publish/view_ring_writer.h"

namespace haustra {
namespace {

namespace fs = std::filesystem;

constexpr auto kOwnGroup = static_cast<gid_t>(-1);

class FormerSharedFile : public testing::Test {
 protected:
  FormerSharedFile() : folder_(testing::TempDir() + "haustra_former_file_" + std::to_string(::getpid())) {
    fs::remove_all(folder_);
    fs::create_directories(folder_);
  }
  ~FormerSharedFile() override { fs::remove_all(folder_); }

  static std::string Read(const std::string& path) {
    std::ifstream file(path, std::ios::binary);
    return {std::istreambuf_iterator<char>(file), {}};
  }

  std::string folder_;
};

// A second name shows what becomes of the bytes that had the first one.
TEST_F(FormerSharedFile, OfAnyLayoutIsOverwrittenBeforeItIsReplacedOrRemoved) {
  RecordProperty("req", "DATA-001");
  using Take = std::function<bool(const std::string&)>;
  const std::vector<std::pair<std::string, Take>> takers{
      {"poses", [](const auto& path) { return PoseRingWriter::Create(path, 0600, kOwnGroup).ok(); }},
      {"view", [](const auto& path) { return ViewRingWriter::Create(path, 0600, kOwnGroup).ok(); }},
      {"no view", [](const auto& path) { return ViewRingWriter::RemoveFormer(path).ok(); }},
      {"depth", [](const auto& path) { return DepthTableWriter::Create(path, 0600, kOwnGroup, 4).ok(); }},
      {"no depth", [](const auto& path) { return DepthTableWriter::RemoveFormer(path).ok(); }},
  };
  std::string other_version(100003, 's');
  const std::uint64_t magic = HAUSTRA_RING_MAGIC;
  std::memcpy(other_version.data(), &magic, sizeof magic);
  for (const auto& [what, take] : takers) {
    for (const std::string& left : {other_version, std::string("short"), std::string()}) {
      SCOPED_TRACE(what + ", " + std::to_string(left.size()) + " bytes");
      const std::string path = folder_ + "/file", seen = folder_ + "/seen";
      std::ofstream(path, std::ios::binary) << left;
      fs::create_hard_link(path, seen);
      EXPECT_TRUE(take(path));
      EXPECT_TRUE(Read(seen) == std::string(left.size(), '\0'));
      fs::remove(path);
      fs::remove(seen);
    }
  }
}

// Nothing of it is the service's.
TEST_F(FormerSharedFile, WhereALinkLeadsNothingIsOverwritten) {
  const std::string path = folder_ + "/file", other = folder_ + "/other";
  std::ofstream(other) << "of somebody else";
  fs::create_symlink(other, path);
  EXPECT_TRUE(ViewRingWriter::RemoveFormer(path).ok());
  EXPECT_FALSE(fs::is_symlink(path));
  fs::create_symlink(other, path);
  EXPECT_TRUE(PoseRingWriter::Create(path, 0600, kOwnGroup).ok());
  EXPECT_EQ(Read(other), "of somebody else");
}

// A program that runs cannot be overwritten, not even by the superuser.
TEST_F(FormerSharedFile, ThatCannotBeOverwrittenStopsTheStart) {
  RecordProperty("req", "DATA-001");
  const std::string path = folder_ + "/file";
  fs::copy("/bin/sleep", path);
  fs::permissions(path, fs::perms::owner_all);
  const pid_t child = ::fork();
  if (child == 0) {
    ::execl(path.c_str(), "sleep", "60", nullptr);
    ::_exit(1);
  }
  // Until it runs.
  std::error_code error;
  for (int i = 0; i < 1000 && fs::read_symlink("/proc/" + std::to_string(child) + "/exe", error) != path; ++i) {
    ::usleep(10000);
  }
  const Status status = PoseRingWriter::Create(path, 0600, kOwnGroup).status();
  EXPECT_EQ(status.code(), StatusCode::kUnavailable);
  EXPECT_TRUE(status.message().starts_with(path + ": what a former run left cannot be overwritten: "))
      << status.message();
  EXPECT_EQ(std::distance(fs::directory_iterator(folder_), {}), 1);
  ::kill(child, SIGKILL);
  ::waitpid(child, nullptr, 0);
}

}  // namespace
}  // namespace haustra
