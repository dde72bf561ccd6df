#include "platform/trap/wait_trap.h"

#include <dlfcn.h>
#include <execinfo.h>
#include <linux/filter.h>
#include <linux/futex.h>
#include <linux/seccomp.h>
#include <poll.h>
#include <pthread.h>
#include <sys/ioctl.h>
#include <sys/prctl.h>
#include <sys/syscall.h>
#include <unistd.h>

#include <atomic>
#include <cstddef>
#include <cstdio>
#include <cstdlib>
#include <memory>
#include <thread>

#if defined(__GLIBC__) && !defined(__SANITIZE_ADDRESS__) && !defined(__SANITIZE_THREAD__)
#define HAUSTRA_TRAPS_LOCKS 1
#else
#define HAUSTRA_TRAPS_LOCKS 0
#endif

namespace haustra {
namespace {

using Mode = WaitTrap::Mode;

// What the thread that is told of system calls shares with the one that makes them.
struct SystemCalls {
  const std::uint32_t thread = static_cast<std::uint32_t>(::gettid());  // threads that it starts are told of, too
  std::atomic<Mode> mode{Mode::kOff};
  std::atomic<std::uint32_t> num{0};
  std::atomic<int> last{-1};
};

thread_local Mode mode = Mode::kOff;
thread_local std::uint32_t num_locks_caught = 0;
thread_local SystemCalls* system_calls = nullptr;  // null: not told

void SetMode(Mode wanted) {
  mode = wanted;
  if (system_calls != nullptr) system_calls->mode.store(wanted);
}

[[noreturn]] void Abort(const char* what, bool has_backtrace) {
  mode = Mode::kOff;
  char text[128];
  const int size = std::snprintf(text, sizeof(text), "haustra: wait trap: %s on a thread that must not wait\n", what);
  (void)!write(STDERR_FILENO, text, static_cast<std::size_t>(size));
  void* frames[32];
  if (has_backtrace) backtrace_symbols_fd(frames, backtrace(frames, 32), STDERR_FILENO);
  std::abort();
}

// All calls but those that wake another thread or read the clock are told.
int InstallFilter() {
  constexpr auto kCall = static_cast<std::uint32_t>(offsetof(seccomp_data, nr));
  constexpr auto kFutexOperation = static_cast<std::uint32_t>(offsetof(seccomp_data, args) + sizeof(std::uint64_t));
  constexpr auto kCommand = static_cast<std::uint32_t>(FUTEX_CMD_MASK);
  sock_filter steps[] = {
      BPF_STMT(BPF_LD | BPF_W | BPF_ABS, kCall),
      BPF_JUMP(BPF_JMP | BPF_JEQ | BPF_K, SYS_clock_gettime, 6, 0),
      BPF_JUMP(BPF_JMP | BPF_JEQ | BPF_K, SYS_futex, 0, 4),
      BPF_STMT(BPF_LD | BPF_W | BPF_ABS, kFutexOperation),
      BPF_STMT(BPF_ALU | BPF_AND | BPF_K, kCommand),
      BPF_JUMP(BPF_JMP | BPF_JEQ | BPF_K, FUTEX_WAKE, 2, 0),
      BPF_JUMP(BPF_JMP | BPF_JEQ | BPF_K, FUTEX_WAKE_BITSET, 1, 0),
      BPF_STMT(BPF_RET | BPF_K, SECCOMP_RET_USER_NOTIF),
      BPF_STMT(BPF_RET | BPF_K, SECCOMP_RET_ALLOW),
  };
  const sock_fprog program = {sizeof(steps) / sizeof(steps[0]), steps};
  if (prctl(PR_SET_NO_NEW_PRIVS, 1, 0, 0, 0) != 0) return -1;
  return static_cast<int>(syscall(SYS_seccomp, SECCOMP_SET_MODE_FILTER, SECCOMP_FILTER_FLAG_NEW_LISTENER, &program));
}

// Until nobody is left whose calls are told.
void Listen(int listener, const std::unique_ptr<SystemCalls>& calls) {
  for (;;) {
    pollfd ready{listener, POLLIN, 0};
    if (poll(&ready, 1, -1) < 0) continue;
    if ((ready.revents & POLLIN) == 0) break;
    seccomp_notif call{};
    if (ioctl(listener, SECCOMP_IOCTL_NOTIF_RECV, &call) != 0) continue;  // it was interrupted meanwhile
    const Mode wanted = call.pid == calls->thread ? calls->mode.load() : Mode::kOff;
    if (wanted != Mode::kOff) {
      calls->last.store(call.data.nr);
      calls->num.fetch_add(1);
    }
    if (wanted == Mode::kAbort) {
      char what[32];
      std::snprintf(what, sizeof(what), "system call %d", call.data.nr);
      Abort(what, false);
    }
    seccomp_notif_resp answer{};
    answer.id = call.id;
    answer.flags = SECCOMP_USER_NOTIF_FLAG_CONTINUE;
    (void)ioctl(listener, SECCOMP_IOCTL_NOTIF_SEND, &answer);
  }
  close(listener);
}

std::uint32_t NumCaught() { return WaitTrap::num_locks() + WaitTrap::num_system_calls(); }

thread_local std::uint32_t num_before = 0;

void Begin(Mode wanted) {
  (void)WaitTrap::CatchSystemCalls();
  num_before = NumCaught();
  SetMode(wanted);
}
void BeginCounting() { Begin(Mode::kCount); }
void BeginAborting() { Begin(Mode::kAbort); }
std::uint32_t End() {
  SetMode(Mode::kOff);
  return NumCaught() - num_before;
}

}  // namespace

bool WaitTrap::CatchesLocks() { return HAUSTRA_TRAPS_LOCKS; }

bool WaitTrap::CatchSystemCalls() {
  if (system_calls != nullptr) return true;
  // The listener must be there when the thread's next call comes, so it is made first and told which one it is.
  auto calls = std::make_unique<SystemCalls>();
  SystemCalls* const shared = calls.get();
  std::atomic<int> listener{-2};
  std::atomic<bool> is_heard{false};
  std::thread thread([&listener, &is_heard, owned = std::move(calls)] {
    while (listener.load() == -2) std::this_thread::yield();
    const int mine = listener.load();
    is_heard.store(true);
    if (mine >= 0) Listen(mine, owned);
  });
  thread.detach();
  const int installed = InstallFilter();
  listener.store(installed);
  while (!is_heard.load()) {
  }
  if (installed >= 0) system_calls = shared;
  return installed >= 0;
}

WaitTrap::WaitTrap(Mode wanted) : former_(mode) { SetMode(wanted); }
WaitTrap::~WaitTrap() { SetMode(former_); }

std::uint32_t WaitTrap::num_locks() { return num_locks_caught; }
std::uint32_t WaitTrap::num_system_calls() { return system_calls == nullptr ? 0 : system_calls->num.load(); }
int WaitTrap::last_system_call() { return system_calls == nullptr ? -1 : system_calls->last.load(); }

const ThreadWatch& CountingWaitWatch() {
  static constexpr ThreadWatch kWatch{BeginCounting, End};
  return kWatch;
}
const ThreadWatch& AbortingWaitWatch() {
  static constexpr ThreadWatch kWatch{BeginAborting, End};
  return kWatch;
}

namespace {

#if HAUSTRA_TRAPS_LOCKS
template <typename Lock>
int Take(const char* name, Lock* lock, int (*take)(Lock*)) {
  if (mode != Mode::kOff) {
    ++num_locks_caught;
    if (mode == Mode::kAbort) Abort(name, true);
  }
  return take(lock);
}

template <typename Lock>
auto Next(const char* name) {
  return reinterpret_cast<int (*)(Lock*)>(dlsym(RTLD_NEXT, name));
}
#endif

}  // namespace
}  // namespace haustra

#if HAUSTRA_TRAPS_LOCKS
extern "C" {
int pthread_mutex_lock(pthread_mutex_t* mutex) {
  static const auto next = haustra::Next<pthread_mutex_t>("pthread_mutex_lock");
  return haustra::Take("pthread_mutex_lock", mutex, next);
}
int pthread_rwlock_rdlock(pthread_rwlock_t* lock) {
  static const auto next = haustra::Next<pthread_rwlock_t>("pthread_rwlock_rdlock");
  return haustra::Take("pthread_rwlock_rdlock", lock, next);
}
int pthread_rwlock_wrlock(pthread_rwlock_t* lock) {
  static const auto next = haustra::Next<pthread_rwlock_t>("pthread_rwlock_wrlock");
  return haustra::Take("pthread_rwlock_wrlock", lock, next);
}
}
#endif
