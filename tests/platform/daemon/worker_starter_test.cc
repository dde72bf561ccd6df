#include "platform/daemon/worker_starter.h"

#include <gtest/gtest.h>
#include <signal.h>
#include <sys/socket.h>
#include <sys/wait.h>
#include <unistd.h>

#include <memory>
#include <string>

#include "platform/daemon/worker_channel.h"

namespace haustra {
namespace {

TEST(ForkedStarter, WorkersAreChildrenOfTheSupervisorAndHaveTheirChannel) {
  const auto starter = ForkedStarter::Fork({"/bin/sh", "-c", "echo here >&3; exit 7"});
  ASSERT_TRUE(starter.ok()) << starter.status().ToString();
  for (int i = 0; i < 3; ++i) {
    const ChannelPair channel = *MakeChannel();
    const Result<pid_t> pid = (*starter)->Start(channel.worker);
    close(channel.worker);
    ASSERT_TRUE(pid.ok()) << pid.status().ToString();
    int status = 0;
    EXPECT_EQ(waitpid(*pid, &status, 0), *pid);
    EXPECT_TRUE(WIFEXITED(status) && WEXITSTATUS(status) == 7);
    char text[16] = "";
    EXPECT_EQ(recv(channel.supervisor, text, sizeof text, MSG_DONTWAIT), 5);
    EXPECT_EQ(std::string(text, 5), "here\n");
    close(channel.supervisor);
  }
}

TEST(ForkedStarter, ProgramThatIsNotThereEndsAtOnce) {
  const auto starter = ForkedStarter::Fork({"/nonexistent"});
  ASSERT_TRUE(starter.ok()) << starter.status().ToString();
  const ChannelPair channel = *MakeChannel();
  const Result<pid_t> pid = (*starter)->Start(channel.worker);
  ASSERT_TRUE(pid.ok()) << pid.status().ToString();
  int status = 0;
  EXPECT_EQ(waitpid(*pid, &status, 0), *pid);
  EXPECT_TRUE(WIFEXITED(status) && WEXITSTATUS(status) == 127);
  close(channel.worker);
  close(channel.supervisor);
}

}  // namespace
}  // namespace haustra
