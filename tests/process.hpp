/// \file
/// Work in a child process, for tests of fork() and of limits that hold for the whole process.
#pragma once

#include <sys/resource.h>
#include <sys/wait.h>
#include <unistd.h>

#include <cstdint>
#include <cstdio>
#include <fstream>

namespace espalier::test {

/// Runs `work` (returns whether all is well) in a child of fork(), for `seconds` at most. The child's exit code: 0 all
/// is well, 1 it is not, 2 an exception; -n when signal n ended it (-14: too late).
template <class Work>
int in_child(Work&& work, unsigned seconds = 60) {
  std::fflush(nullptr);
  const pid_t child = ::fork();
  if (child == 0) {
    ::alarm(seconds);
    int code = 2;
    try {
      code = work() ? 0 : 1;
    } catch (...) {
    }
    ::_exit(code);
  }
  int status = 0;
  if (child < 0 || ::waitpid(child, &status, 0) != child) return 3;
  return WIFEXITED(status) ? WEXITSTATUS(status) : -WTERMSIG(status);
}

/// Lets the process take `bytes` of addresses more than it has.
inline void limit_address_space(std::uint64_t bytes) {
  std::uint64_t pages = 0;
  std::ifstream("/proc/self/statm") >> pages;
  rlimit limit{};
  limit.rlim_cur = limit.rlim_max = pages * static_cast<std::uint64_t>(::sysconf(_SC_PAGE_SIZE)) + bytes;
  ::setrlimit(RLIMIT_AS, &limit);
}

}  // namespace espalier::test
