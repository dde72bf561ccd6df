/* Holds one thread of a process, found by its name, until the process ends: a hang that the program takes no part in.
 *
 *     hold_thread PID NAME
 */
#include <dirent.h>
#include <errno.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/ptrace.h>
#include <sys/types.h>
#include <sys/wait.h>

static pid_t find_thread(const char* pid, const char* name) {
  char path[300];
  snprintf(path, sizeof path, "/proc/%s/task", pid);
  DIR* folder = opendir(path);
  if (folder == NULL) return 0;
  pid_t found = 0;
  for (struct dirent* entry; found == 0 && (entry = readdir(folder)) != NULL;) {
    snprintf(path, sizeof path, "/proc/%s/task/%s/comm", pid, entry->d_name);
    char comm[32] = "";
    FILE* file = fopen(path, "r");
    if (file == NULL) continue;
    if (fgets(comm, sizeof comm, file) != NULL) comm[strcspn(comm, "\n")] = '\0';
    fclose(file);
    if (strcmp(comm, name) == 0) found = atoi(entry->d_name);
  }
  closedir(folder);
  return found;
}

int main(int argc, char** argv) {
  if (argc != 3) return 64;
  pid_t thread = find_thread(argv[1], argv[2]);
  if (thread == 0) {
    fprintf(stderr, "hold_thread: process %s has no thread '%s'\n", argv[1], argv[2]);
    return 1;
  }
  if (ptrace(PTRACE_SEIZE, thread, NULL, NULL) != 0 || ptrace(PTRACE_INTERRUPT, thread, NULL, NULL) != 0) {
    perror("hold_thread");
    return 1;
  }
  printf("holding %s, thread %d\n", argv[2], (int)thread);
  fflush(stdout);
  /* Its end must be waited for, or the process could not be. */
  for (int status = 0;;) {
    if (waitpid(thread, &status, __WALL) < 0 && errno != EINTR) return 0;
    if (WIFEXITED(status) || WIFSIGNALED(status)) return 0;
  }
}
