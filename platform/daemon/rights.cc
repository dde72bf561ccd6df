#include "platform/daemon/rights.h"

#include <fcntl.h>
#include <linux/audit.h>
#include <linux/filter.h>
#include <linux/seccomp.h>
#include <sys/prctl.h>
#include <sys/socket.h>
#include <sys/syscall.h>
#include <unistd.h>

#include <cerrno>
#include <cstddef>
#include <cstdint>
#include <filesystem>
#include <system_error>

#include "hal/core/errno_text.h"

#if __has_include(<linux/landlock.h>)
#include <linux/landlock.h>
#define HAUSTRA_HAVE_LANDLOCK 1
#endif

namespace haustra {
namespace {

std::string RefusalText(int error) { return "not taken: " + ErrnoText(error); }

#if defined(__x86_64__)
constexpr std::uint32_t kArchitecture = AUDIT_ARCH_X86_64;
#elif defined(__aarch64__)
constexpr std::uint32_t kArchitecture = AUDIT_ARCH_AARCH64;
#else
#error "which architecture a system call is of has to be known"
#endif

// Answered with EPERM. Numbers that an older header does not know are those of every architecture.
constexpr std::uint32_t kRefused[] = {
    SYS_ioctl,
    SYS_execve,
    SYS_execveat,
    SYS_mount,
    SYS_umount2,
    SYS_pivot_root,
    SYS_chroot,
    SYS_setns,
    SYS_unshare,
    SYS_init_module,
    SYS_finit_module,
    SYS_delete_module,
    SYS_kexec_load,
    SYS_bpf,
    SYS_perf_event_open,
    SYS_userfaultfd,
    SYS_open_by_handle_at,
    SYS_keyctl,
    SYS_add_key,
    SYS_request_key,
    SYS_reboot,
    SYS_swapon,
    SYS_settimeofday,
    SYS_clock_settime,
    425 /* io_uring_setup */,
    426 /* io_uring_enter */,
    438 /* pidfd_getfd */,
};

std::string TakeSystemCalls() {
  std::vector<sock_filter> program;
  const auto add = [&](std::uint16_t code, std::uint32_t value, std::uint8_t if_true, std::uint8_t if_false) {
    program.push_back({code, if_true, if_false, value});
  };
  constexpr std::uint16_t kLoad = BPF_LD | BPF_W | BPF_ABS, kIs = BPF_JMP | BPF_JEQ | BPF_K, kReturn = BPF_RET | BPF_K;
  constexpr std::uint32_t kRefuse = SECCOMP_RET_ERRNO | EPERM;
  add(kLoad, offsetof(seccomp_data, arch), 0, 0);
  add(kIs, kArchitecture, 1, 0);
  add(kReturn, SECCOMP_RET_KILL_PROCESS, 0, 0);
  add(kLoad, offsetof(seccomp_data, nr), 0, 0);
#if defined(__x86_64__)
  // The numbers of x32, which mean other calls.
  add(BPF_JMP | BPF_JGE | BPF_K, 0x40000000, 0, 1);
  add(kReturn, kRefuse, 0, 0);
#endif
  for (const std::uint32_t number : kRefused) {
    add(kIs, number, 0, 1);
    add(kReturn, kRefuse, 0, 0);
  }
  for (const std::uint32_t number : {SYS_socket, SYS_socketpair}) {
    add(kIs, number, 0, 4);
    add(kLoad, offsetof(seccomp_data, args), 0, 0);
    add(kIs, AF_UNIX, 1, 0);
    add(kReturn, kRefuse, 0, 0);
    add(kReturn, SECCOMP_RET_ALLOW, 0, 0);
  }
  add(kReturn, SECCOMP_RET_ALLOW, 0, 0);
  const sock_fprog filter{static_cast<unsigned short>(program.size()), program.data()};  // NOLINT: the kernel's type
  return ::prctl(PR_SET_SECCOMP, SECCOMP_MODE_FILTER, &filter, 0, 0) == 0 ? "taken" : RefusalText(errno);
}

#ifdef HAUSTRA_HAVE_LANDLOCK
// Those of the first version, which every kernel with Landlock has.
constexpr std::uint64_t kReading = LANDLOCK_ACCESS_FS_READ_FILE | LANDLOCK_ACCESS_FS_READ_DIR;
constexpr std::uint64_t kWriting = LANDLOCK_ACCESS_FS_WRITE_FILE | LANDLOCK_ACCESS_FS_REMOVE_DIR |
                                   LANDLOCK_ACCESS_FS_REMOVE_FILE | LANDLOCK_ACCESS_FS_MAKE_DIR |
                                   LANDLOCK_ACCESS_FS_MAKE_REG | LANDLOCK_ACCESS_FS_MAKE_SOCK;
constexpr std::uint64_t kNeither = LANDLOCK_ACCESS_FS_EXECUTE | LANDLOCK_ACCESS_FS_MAKE_CHAR |
                                   LANDLOCK_ACCESS_FS_MAKE_BLOCK | LANDLOCK_ACCESS_FS_MAKE_FIFO |
                                   LANDLOCK_ACCESS_FS_MAKE_SYM;
// Since the second version. Before, a file is never moved to another folder, and maps could not be kept.
constexpr std::uint64_t kMoving = std::uint64_t{1} << 13;

bool Allow(int rules, const std::string& path, std::uint64_t rights) {
  const int folder = ::open(path.c_str(), O_PATH | O_CLOEXEC);
  if (folder < 0) return errno == ENOENT;
  landlock_path_beneath_attr rule{};
  rule.allowed_access = rights;
  rule.parent_fd = folder;
  const bool is_added = ::syscall(SYS_landlock_add_rule, rules, LANDLOCK_RULE_PATH_BENEATH, &rule, 0) == 0;
  ::close(folder);
  return is_added;
}
#endif

std::string TakeFiles([[maybe_unused]] const std::vector<std::string>& writable) {
#ifdef HAUSTRA_HAVE_LANDLOCK
  const long version =  // NOLINT(google-runtime-int): syscall's type
      ::syscall(SYS_landlock_create_ruleset, nullptr, 0, LANDLOCK_CREATE_RULESET_VERSION);
  if (version < 0) return RefusalText(errno);
  if (version < 2) return "not taken: the kernel's Landlock cannot let files move between folders";
  landlock_ruleset_attr attributes{};
  attributes.handled_access_fs = kReading | kWriting | kNeither | kMoving;
  const int rules = static_cast<int>(::syscall(SYS_landlock_create_ruleset, &attributes, sizeof attributes, 0));
  if (rules < 0) return RefusalText(errno);
  bool is_complete = true;
  std::error_code error;
  for (const auto& entry : std::filesystem::directory_iterator("/", error)) {
    if (entry.path() == "/dev" || !entry.is_directory(error) || entry.is_symlink(error)) continue;
    is_complete = Allow(rules, entry.path(), kReading) && is_complete;
  }
  for (const std::string& folder : writable) {
    is_complete = Allow(rules, folder, kReading | kWriting | kMoving) && is_complete;
  }
  const bool is_taken = is_complete && ::syscall(SYS_landlock_restrict_self, rules, 0) == 0;
  const int reason = errno;
  ::close(rules);
  return is_taken ? "taken" : RefusalText(reason);
#else
  return "not taken: built without Landlock";
#endif
}

}  // namespace

RightsTaken TakeRightsAway(const std::vector<std::string>& writable) {
  // Or neither is allowed without being the superuser.
  if (::prctl(PR_SET_NO_NEW_PRIVS, 1, 0, 0, 0) != 0) return {RefusalText(errno), RefusalText(errno)};
  RightsTaken taken;
  taken.files = TakeFiles(writable);
  taken.system_calls = TakeSystemCalls();
  return taken;
}

}  // namespace haustra
