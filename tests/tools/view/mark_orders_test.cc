#include "tools/view/mark_orders.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <atomic>
#include <chrono>
#include <string>
#include <thread>
#include <vector>

#include "platform/control/control_server.h"
#include "tests/tools/evaluate/text_folder.h"

namespace haustra::view {
namespace {

using ::testing::HasSubstr;

// A haustrad that only notes what it is asked.
class NotingServer {
 public:
  explicit NotingServer(const std::string& folder) {
    auto server = ControlServer::Create(
        folder + "/control", 0600, static_cast<gid_t>(-1), {},
        [this](ControlServer::ClientId, const ControlPeer&, const ControlRequest& request) -> Result<std::string> {
          asked_.push_back(ToText(request));
          if (request.name == "taken") return FailedPrecondition("there is a mark of this name");
          return std::string("marked " + request.name + "\n");
        });
    EXPECT_TRUE(server.ok()) << server.status().message();
    thread_ = std::thread([this, server = std::move(*server)] {
      while (!is_stopping_) {
        server->Serve(TimePoint{});
        std::this_thread::sleep_for(std::chrono::milliseconds(2));
      }
    });
  }
  ~NotingServer() { Stop(); }
  const std::vector<std::string>& Stop() {
    is_stopping_ = true;
    if (thread_.joinable()) thread_.join();
    return asked_;
  }

 private:
  std::vector<std::string> asked_;
  std::atomic<bool> is_stopping_{false};
  std::thread thread_;
};

TEST(MarkOrders, AreAnsweredByHaustrad) {
  const evaluate::TextFolder folder;
  NotingServer server(folder.path());
  const Result<std::string> set = PassMarkOrder(folder.path(), "mark 1 2.5 polyp 7 3");
  ASSERT_TRUE(set.ok()) << set.status().message();
  EXPECT_EQ(*set, "marked polyp\n");
  EXPECT_TRUE(PassMarkOrder(folder.path(), "unmark polyp 3").ok());
  const Result<std::string> taken = PassMarkOrder(folder.path(), "mark 1 2 taken 7 3");
  ASSERT_EQ(taken.code(), StatusCode::kFailedPrecondition);
  EXPECT_THAT(taken.status().message(), HasSubstr("there is a mark of this name"));
  EXPECT_THAT(server.Stop(), ::testing::ElementsAre("mark 1 2.5 polyp 7 3", "unmark polyp 3", "mark 1 2 taken 7 3"));
}

TEST(MarkOrders, NothingElseIsPassedOn) {
  const evaluate::TextFolder folder;
  NotingServer server(folder.path());
  for (const char* request :
       {"end wipe", "end", "begin", "resume", "save all", "status", "metrics", "marks", "", "mark", "mark 1 2 polyp",
        "mark 1 2 ../polyp 7", "mark nan 2 polyp 7", "unmark", "unmark a b", "unmark polyp\nend wipe", "nonsense",
        // By now it may be another procedure's.
        "mark 1 2 polyp 7", "unmark polyp"}) {
    EXPECT_EQ(PassMarkOrder(folder.path(), request).code(), StatusCode::kInvalidArgument) << request;
  }
  EXPECT_TRUE(server.Stop().empty());
}

TEST(MarkOrders, AServiceThatIsNotThereIsSaid) {
  const evaluate::TextFolder folder;
  EXPECT_EQ(PassMarkOrder(folder.path(), "unmark polyp 3").code(), StatusCode::kNotFound);
}

}  // namespace
}  // namespace haustra::view
