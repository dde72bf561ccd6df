#include "platform/daemon/worker_starter.h"

#include <gtest/gtest.h>
#include <signal.h>
#include <sys/socket.h>
#include <sys/wait.h>
#include <unistd.h>

#include <cstdlib>
#include <fstream>
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

// The only child of this program.
pid_t TheChild() {
  std::ifstream children("/proc/self/task/" + std::to_string(gettid()) + "/children");
  pid_t pid = 0, more = 0;
  children >> pid;
  return children >> more ? 0 : pid;
}

// Its answer comes when nobody waits for it any more, and must not be taken for that of the next request.
TEST(ForkedStarter, AnswerThatComesTooLateIsNotThatOfTheNextWorker) {
  const auto starter = ForkedStarter::Fork({"/bin/sh", "-c", "echo $$ >&3"});
  ASSERT_TRUE(starter.ok()) << starter.status().ToString();
  const pid_t pid_of_starter = TheChild();
  if (pid_of_starter == 0) GTEST_SKIP() << "this kernel does not list children";
  ASSERT_EQ(kill(pid_of_starter, SIGSTOP), 0);
  const ChannelPair late = *MakeChannel();
  EXPECT_FALSE((*starter)->Start(late.worker).ok());
  ASSERT_EQ(kill(pid_of_starter, SIGCONT), 0);

  const ChannelPair channel = *MakeChannel();
  const Result<pid_t> pid = (*starter)->Start(channel.worker);
  ASSERT_TRUE(pid.ok()) << pid.status().ToString();
  EXPECT_EQ(waitpid(*pid, nullptr, 0), *pid);
  char text[16] = "";
  EXPECT_GT(recv(channel.supervisor, text, sizeof text - 1, MSG_DONTWAIT), 0);
  EXPECT_EQ(std::atoi(text), *pid);
  for (const int end : {late.worker, late.supervisor, channel.worker, channel.supervisor}) close(end);
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
