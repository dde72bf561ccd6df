// What is asked of the system for a real-time session, and what is said of its answers; the system is a fake.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cerrno>
#include <latch>
#include <map>
#include <mutex>
#include <thread>

#include "platform/realtime/heartbeat.h"
#include "platform/realtime/realtime_threads.h"
#include "platform/realtime/wake_signal.h"

namespace haustra {
namespace {

using ::testing::Contains;
using ::testing::ElementsAre;
using ::testing::HasSubstr;
using ::testing::IsEmpty;
using ::testing::Not;

CpuList Cpus(std::string_view text) { return ParseCpuList(text).value(); }

// Grants what its fields say; remembers what each thread has.
class FakeSystem final : public ThreadSystem {
 public:
  int fifo_error = 0;
  int cpus_error = 0;
  int lock_error = 0;
  int heap_error = 0;
  std::size_t heap_bytes = 1000;
  bool may_lock_all = true;
  bool grants_silently_less = false;

  int SetFifo(int priority) override {
    const std::lock_guard lock(mutex_);
    if (fifo_error != 0) return fifo_error;
    priority_[std::this_thread::get_id()] = grants_silently_less ? priority - 1 : priority;
    return 0;
  }
  int SetCpus(const CpuList& cpus) override {
    const std::lock_guard lock(mutex_);
    if (cpus_error == 0) cpus_[std::this_thread::get_id()] = cpus;
    return cpus_error;
  }
  int SetNice(int nice) override {
    calls.push_back("nice " + std::to_string(nice));
    return 0;
  }
  int LockMemory(bool with_future) override {
    calls.push_back(with_future ? "lock all" : "lock current");
    return lock_error;
  }
  void UnlockMemory() override { calls.push_back("unlock"); }
  int HoldHeap(std::size_t num_free_bytes) override {
    calls.push_back("hold " + std::to_string(num_free_bytes));
    return heap_error;
  }
  void ReleaseHeap() override { calls.push_back("release"); }
  std::size_t HeapBytes() const override { return heap_bytes; }
  int FifoPriority() const override {
    const std::lock_guard lock(mutex_);
    const auto it = priority_.find(std::this_thread::get_id());
    return it == priority_.end() ? 0 : it->second;
  }
  CpuList Cpus() const override {
    const std::lock_guard lock(mutex_);
    const auto it = cpus_.find(std::this_thread::get_id());
    return it == cpus_.end() ? ParseCpuList("0-3").value() : it->second;
  }
  bool MayLockAll() const override { return may_lock_all; }
  std::int64_t PriorityLimit() const override { return 0; }
  std::int64_t LockLimitBytes() const override { return 65536; }
  std::string KernelPreemption() const override { return "PREEMPT_RT"; }
  double RealTimeShare() const override { return 0.95; }

  std::vector<std::string> calls;

 private:
  mutable std::mutex mutex_;
  std::map<std::thread::id, int> priority_;
  std::map<std::thread::id, CpuList> cpus_;
};

RealTimeConfig Config() {
  RealTimeConfig config;
  config.tracking_cpus = "2";
  return config;
}

void ApplyOnThreads(RealTimeThreads& threads) {
  std::latch all_live(4);  // at once, so that each has an id of its own
  std::vector<std::thread> running;
  for (const SessionThread thread :
       {SessionThread::kCapture, SessionThread::kTracking, SessionThread::kMapping, SessionThread::kMerging}) {
    running.emplace_back([&threads, &all_live, thread] {
      all_live.arrive_and_wait();
      threads.Apply(thread);
    });
  }
  for (std::thread& thread : running) thread.join();
}

TEST(RealTimeThreads, DepthIsNiceAndRunsWhereMergingDoes) {
  FakeSystem system;
  RealTimeConfig config = Config();
  config.merging_cpus = "1,3";
  {
    RealTimeThreads threads(config, system);
    threads.ApplyToDepth();
  }
  EXPECT_EQ(ToText(system.Cpus()), "1,3");
  EXPECT_THAT(system.calls, ::testing::Contains("nice 10"));
}

TEST(CpuListText, ReadsAndWritesWhatLinuxWrites) {
  for (const char* text : {"", "0", "3", "0-3", "0,2-5", "1,3,5-7,1023"}) {
    const Result<CpuList> cpus = ParseCpuList(text);
    ASSERT_TRUE(cpus.ok()) << text;
    EXPECT_EQ(ToText(*cpus), text);
  }
  EXPECT_EQ(ToText(Cpus("5,4,3,3")), "3-5");
}

TEST(CpuListText, RefusesWhatIsNoList) {
  for (const char* text : {",", "1,", "1,,2", "-1", "3-1", "a", "1 2", "0x3", "1-", "1024", "99999999999"}) {
    const Result<CpuList> cpus = ParseCpuList(text);
    EXPECT_EQ(cpus.code(), StatusCode::kInvalidArgument) << text;
    EXPECT_THAT(cpus.status().message(), HasSubstr("'" + std::string(text) + "'"));
  }
}

TEST(RealTimeThreads, GrantedSettingsAreReportedThreadByThread) {
  FakeSystem system;
  RealTimeThreads threads(Config(), system);
  ApplyOnThreads(threads);
  const RealTimeReport& report = threads.report();
  EXPECT_TRUE(report.is_all_granted());
  EXPECT_TRUE(report.is_memory_locked);
  EXPECT_EQ(report.threads[0].granted_priority, 48);
  EXPECT_EQ(report.threads[1].granted_priority, 46);
  EXPECT_EQ(report.threads[2].granted_priority, 0);
  EXPECT_EQ(report.threads[3].granted_priority, 0);
  EXPECT_EQ(report.threads[1].granted_cpus, Cpus("2"));
  EXPECT_EQ(report.threads[1].prefaulted_kb, 256);
  EXPECT_TRUE(threads.Check().ok());
  const std::string text = ToText(report);
  EXPECT_THAT(text, HasSubstr("PREEMPT_RT"));
  EXPECT_THAT(text, HasSubstr("tracking  asked SCHED_FIFO 46 on cpu 2, has SCHED_FIFO 46 on cpu 2, 256 kB"));
  EXPECT_THAT(text, Not(HasSubstr("REFUSED")));
}

TEST(RealTimeThreads, RefusedPriorityIsAWarningThatSaysWhatIsMissing) {
  FakeSystem system;
  system.fifo_error = EPERM;
  RealTimeThreads threads(Config(), system);
  ApplyOnThreads(threads);
  EXPECT_TRUE(threads.Check().ok()) << "rt.require is off";
  EXPECT_THAT(Refusals(threads.report()),
              ElementsAre(HasSubstr("capture thread: SCHED_FIFO 48 refused: Operation not permitted"),
                          HasSubstr("tracking thread: SCHED_FIFO 46 refused")));
  EXPECT_THAT(Refusals(threads.report())[0], HasSubstr("RLIMIT_RTPRIO 0); it needs CAP_SYS_NICE or LimitRTPRIO=48"));
  EXPECT_THAT(ToText(threads.report()), HasSubstr("asked SCHED_FIFO 46 on cpu 2, has ordinary scheduling on cpu 2, "
                                                  "256 kB of stack touched  <- REFUSED"));
}

TEST(RealTimeThreads, RequiredPrivilegeThatIsMissingIsAnError) {
  RealTimeConfig config = Config();
  config.require = true;
  {
    FakeSystem system;
    RealTimeThreads threads(config, system);
    ApplyOnThreads(threads);
    EXPECT_TRUE(threads.Check().ok());
  }
  FakeSystem refuses_fifo, refuses_cpus, refuses_lock, limits_lock, grants_less;
  refuses_fifo.fifo_error = EPERM;
  refuses_cpus.cpus_error = EINVAL;
  refuses_lock.lock_error = ENOMEM;
  limits_lock.may_lock_all = false;
  grants_less.grants_silently_less = true;
  const std::pair<FakeSystem*, const char*> cases[] = {
      {&refuses_fifo, "tracking thread: SCHED_FIFO 46 refused: Operation not permitted"},
      {&refuses_cpus, "tracking thread: cpu 2 refused: Invalid argument; it has cpu 0-3"},
      {&refuses_lock, "memory: not locked: Cannot allocate memory (RLIMIT_MEMLOCK 65536 bytes)"},
      {&limits_lock, "memory: only what was taken at the start is locked"},
      {&grants_less, "tracking thread: asked for SCHED_FIFO 46, has SCHED_FIFO 45"}};
  for (const auto& [system, message] : cases) {
    RealTimeThreads threads(config, *system);
    ApplyOnThreads(threads);
    EXPECT_EQ(threads.Check().code(), StatusCode::kFailedPrecondition) << message;
    EXPECT_THAT(threads.Check().message(), HasSubstr(message));
    EXPECT_THAT(threads.Check().message(), HasSubstr("rt.require is set"));
  }
}

TEST(RealTimeThreads, MemoryIsLockedForGoodOnlyWhereThereIsNoLimit) {
  FakeSystem system;
  system.may_lock_all = false;
  { const RealTimeThreads threads(Config(), system); }
  EXPECT_THAT(system.calls, ElementsAre("lock current", "hold 192000000", "unlock", "release"));
  system.calls.clear();
  system.may_lock_all = true;
  { const RealTimeThreads threads(Config(), system); }
  EXPECT_THAT(system.calls, ElementsAre("lock all", "hold 192000000", "unlock", "release"));
}

TEST(RealTimeThreads, HeapThatIsSetAsideIsReportedAndSoIsItsGrowth) {
  FakeSystem system;
  RealTimeThreads threads(Config(), system);
  ApplyOnThreads(threads);
  EXPECT_THAT(ToText(threads.report()), HasSubstr("memory    locked, now and later, 192 MB of heap set aside"));
  EXPECT_EQ(threads.HeapGrowthBytes(), 0u);
  system.heap_bytes = 900;
  EXPECT_EQ(threads.HeapGrowthBytes(), 0u);
  system.heap_bytes = 1200;
  EXPECT_EQ(threads.HeapGrowthBytes(), 200u);

  FakeSystem full;
  full.heap_error = ENOMEM;
  RealTimeThreads without(Config(), full);
  ApplyOnThreads(without);
  EXPECT_THAT(Refusals(without.report()), ElementsAre(HasSubstr("heap not set aside (rt.heap_prefault_mb)")));
  EXPECT_THAT(full.calls, Not(Contains("release")));
}

TEST(RealTimeThreads, SwitchedOffAsksForNothing) {
  FakeSystem system;
  system.fifo_error = system.cpus_error = system.lock_error = EPERM;
  RealTimeConfig config = Config();
  config.enabled = false;
  RealTimeThreads threads(config, system);
  ApplyOnThreads(threads);
  EXPECT_THAT(system.calls, IsEmpty());
  EXPECT_THAT(Refusals(threads.report()), IsEmpty());
  EXPECT_THAT(ToText(threads.report()), HasSubstr("switched off"));
}

// Whatever this machine grants, the report says what the kernel says.
TEST(RealTimeThreads, ThisMachineIsReportedAsItIs) {
  RealTimeConfig config;
  config.lock_memory = false;
  RealTimeThreads threads(config, LinuxThreadSystem());
  int priority = -1;
  std::thread([&] {
    threads.Apply(SessionThread::kTracking);
    priority = LinuxThreadSystem().FifoPriority();
  }).join();
  const ThreadGrant& grant = threads.report().threads[1];
  EXPECT_EQ(grant.granted_priority, priority);
  EXPECT_EQ(grant.granted_priority, grant.priority_error == 0 ? config.tracking_priority : 0);
  EXPECT_TRUE(grant.granted_cpus.any());
}

TEST(WakeSignal, EachPostWakesOnceAndATimeLimitEndsTheWait) {
  WakeSignal signal;
  EXPECT_FALSE(signal.WaitFor(std::chrono::milliseconds(1)));
  signal.Post();
  signal.Post();
  EXPECT_TRUE(signal.WaitFor(std::chrono::seconds(100)));
  EXPECT_TRUE(signal.WaitFor(std::chrono::seconds(100)));
  EXPECT_FALSE(signal.WaitFor(Duration{0}));
}

TEST(Heartbeat, CountsAndRemembersTheLast) {
  Heartbeat heartbeat;
  EXPECT_EQ(heartbeat.count(), 0u);
  heartbeat.Beat(TimePoint(std::chrono::seconds(3)));
  heartbeat.Beat(TimePoint(std::chrono::seconds(5)));
  EXPECT_EQ(heartbeat.count(), 2u);
  EXPECT_EQ(heartbeat.last(), TimePoint(std::chrono::seconds(5)));
}

}  // namespace
}  // namespace haustra
