#include <cerrno>
#include <cstdio>
#include <cstdlib>
#include <dirent.h>
#include <string>
#include <sys/ptrace.h>
#include <sys/wait.h>
#include <unistd.h>

/// Holds the one thread beside the main one of a process, as a debugger would, until it is killed: a hang of just that
/// thread. SIGSTOP cannot do that, it stops them all.
int main(int argc, char** argv) {
  if (argc != 2) return std::fprintf(stderr, "usage: hold_thread PID\n"), 2;
  const std::string process = argv[1];
  DIR* const threads = ::opendir(("/proc/" + process + "/task").c_str());
  if (threads == nullptr) return std::perror("hold_thread"), 1;
  pid_t held = 0;
  int beside = 0;
  while (const dirent* entry = ::readdir(threads))
    if (entry->d_name[0] != '.' && entry->d_name != process)
      held = static_cast<pid_t>(std::strtol(entry->d_name, nullptr, 10)), ++beside;
  ::closedir(threads);
  if (beside != 1) return std::fprintf(stderr, "hold_thread: %d threads beside the main one, not 1\n", beside), 1;
  int status = 0;
  if (::ptrace(PTRACE_SEIZE, held, nullptr, nullptr) != 0 || ::ptrace(PTRACE_INTERRUPT, held, nullptr, nullptr) != 0 ||
      ::waitpid(held, &status, __WALL) != held || !WIFSTOPPED(status))
    return std::perror("hold_thread"), 1;
  std::printf("thread %d of %s is held\n", held, process.c_str());
  std::fflush(stdout);
  while (::waitpid(held, &status, __WALL) == held && !WIFEXITED(status) && !WIFSIGNALED(status)) {
  }
  return 0;
}
