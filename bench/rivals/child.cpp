#include "rivals/child.hpp"

#include <fcntl.h>
#include <poll.h>
#include <signal.h>
#include <spawn.h>
#include <sys/mman.h>
#include <sys/resource.h>
#include <sys/wait.h>
#include <unistd.h>

#include <cerrno>
#include <chrono>
#include <cstring>
#include <fstream>
#include <sstream>
#include <system_error>

extern char** environ;

namespace espalier::bench {
namespace {

struct Pipe {
  Pipe() {
    if (pipe2(ends, O_CLOEXEC) != 0) throw std::system_error(errno, std::generic_category(), "pipe2");
  }
  int ends[2] = {-1, -1};
};

/// This process's environment with `extra` in front of what it replaces.
std::vector<std::string> merged_environment(const std::vector<std::string>& extra) {
  std::vector<std::string> merged = extra;
  for (char** entry = environ; *entry != nullptr; ++entry) {
    const std::string text = *entry;
    const std::string name = text.substr(0, text.find('=') + 1);
    bool replaced = false;
    for (const std::string& own : extra) replaced |= own.compare(0, name.size(), name) == 0;
    if (!replaced) merged.push_back(text);
  }
  return merged;
}

std::vector<char*> as_arguments(std::vector<std::string>& texts) {
  std::vector<char*> pointers;
  for (std::string& text : texts) pointers.push_back(text.data());
  pointers.push_back(nullptr);
  return pointers;
}

}  // namespace

Child::Child(const std::string& spec, const SharedSystem& system, const ChildSettings& settings)
    : spec_(spec), settings_(settings), solutions_(system.right_hand_sides().size_bytes()) {
  signal(SIGPIPE, SIG_IGN);
  const std::size_t colon = spec.find(':');
  start(settings.folder + "/rival_" + spec.substr(0, colon) + ".so",
        colon == std::string::npos ? "" : spec.substr(colon + 1), system.descriptor());
}

const Hello& Child::hello() {
  if (greeted_) return hello_;
  greeted_ = true;
  std::string line;
  if (read_answer(line))
    hello_ = nlohmann::json::parse(line);
  else
    hello_ = {end_, spec_, ""};
  if (end_.ok() && !hello_.verdict.ok()) end_ = hello_.verdict;
  return hello_;
}

void Child::start(const std::string& plugin, const std::string& variant, int system_descriptor) {
  Pipe in, out;
  log_ = memfd_create("rival-log", MFD_CLOEXEC);
  posix_spawn_file_actions_t actions;
  posix_spawn_file_actions_init(&actions);
  posix_spawn_file_actions_adddup2(&actions, log_, STDOUT_FILENO);
  posix_spawn_file_actions_adddup2(&actions, log_, STDERR_FILENO);
  posix_spawn_file_actions_adddup2(&actions, in.ends[0], kCommandDescriptor);
  posix_spawn_file_actions_adddup2(&actions, out.ends[1], kAnswerDescriptor);
  posix_spawn_file_actions_adddup2(&actions, system_descriptor, kSystemDescriptor);
  posix_spawn_file_actions_adddup2(&actions, solutions_.descriptor(), kSolutionDescriptor);
  std::vector<std::string> arguments = {settings_.folder + "/espalier_rival_host", plugin, variant};
  std::vector<std::string> environment = merged_environment(settings_.environment);
  const int error = posix_spawn(&process_, arguments[0].c_str(), &actions, nullptr, as_arguments(arguments).data(),
                                as_arguments(environment).data());
  posix_spawn_file_actions_destroy(&actions);
  close(in.ends[0]);
  close(out.ends[1]);
  commands_ = in.ends[1];
  answers_ = out.ends[0];
  if (error != 0) {
    process_ = -1;
    end_ = {Outcome::missing, arguments[0] + ": " + std::strerror(error)};
    return;
  }
  if (settings_.memory_limit_bytes > 0) {
    const rlimit limit{static_cast<rlim_t>(settings_.memory_limit_bytes),
                       static_cast<rlim_t>(settings_.memory_limit_bytes)};
    prlimit(process_, RLIMIT_DATA, &limit, nullptr);
  }
}

Child::~Child() {
  if (commands_ >= 0) close(commands_);
  kill_process();
  if (answers_ >= 0) close(answers_);
  if (log_ >= 0) close(log_);
}

void Child::kill_process() {
  if (process_ < 0) return;
  kill(process_, SIGKILL);
  waitpid(process_, nullptr, 0);
  process_ = -1;
}

bool Child::read_answer(std::string& line) {
  using Clock = std::chrono::steady_clock;
  const auto deadline = Clock::now() + std::chrono::duration<double>(settings_.timeout_seconds);
  while (end_.ok()) {
    if (const std::size_t end = pending_.find('\n'); end != std::string::npos) {
      line = pending_.substr(0, end);
      pending_.erase(0, end + 1);
      return true;
    }
    const auto left = std::chrono::duration_cast<std::chrono::milliseconds>(deadline - Clock::now()).count();
    pollfd waiting{answers_, POLLIN, 0};
    const int ready = left > 0 ? poll(&waiting, 1, static_cast<int>(std::min<long long>(left, 1 << 30))) : 0;
    if (ready < 0 && errno == EINTR) continue;
    if (ready <= 0) {
      kill_process();
      end_ = {Outcome::timed_out,
              doing_ + " took more than " + std::to_string(static_cast<long long>(settings_.timeout_seconds)) + " s"};
      break;
    }
    char buffer[4096];
    const ssize_t count = read(answers_, buffer, sizeof buffer);
    if (count > 0)
      pending_.append(buffer, static_cast<std::size_t>(count));
    else if (count == 0 || errno != EINTR)
      end_ = post_mortem();
  }
  return false;
}

Verdict Child::post_mortem() {
  int status = 0;
  waitpid(process_, &status, 0);
  process_ = -1;
  const std::string words = last_words();
  const std::string tail = " in " + doing_ + (words.empty() ? "" : "; last words: " + words);
  if (WIFSIGNALED(status) && WTERMSIG(status) == SIGKILL)
    return {Outcome::out_of_memory, "killed from outside, most likely by the kernel for memory," + tail};
  if (WIFSIGNALED(status)) return {Outcome::crashed, std::string(strsignal(WTERMSIG(status))) + tail};
  return {Outcome::crashed, "exit with " + std::to_string(WEXITSTATUS(status)) + tail};
}

std::string Child::last_words() const {
  std::ifstream log("/proc/self/fd/" + std::to_string(log_));
  std::string line, last;
  while (std::getline(log, line))
    if (line.find_first_not_of(" \t\r") != std::string::npos) last = line;
  return last.substr(0, 200);
}

template <typename Report>
Report Child::ask(const nlohmann::json& command) {
  Report report;
  hello();
  doing_ = command.at("do");
  const std::string text = command.dump() + "\n";
  if (end_.ok() && write(commands_, text.data(), text.size()) != static_cast<ssize_t>(text.size()))
    end_ = post_mortem();
  std::string line;
  if (end_.ok() && read_answer(line)) report = nlohmann::json::parse(line).get<Report>();
  if constexpr (requires { report.verdict; }) {
    if (!end_.ok()) report.verdict = end_;
  }
  return report;
}

AnalyzeReport Child::analyze(Kind kind, int threads) {
  return ask<AnalyzeReport>({{"do", "analyze"}, {"kind", kind_name(kind)}, {"threads", threads}});
}
FactorReport Child::factorize() { return ask<FactorReport>({{"do", "factorize"}}); }
FactorReport Child::refactorize(bool warm) { return ask<FactorReport>({{"do", "refactorize"}, {"warm", warm}}); }
SolveReport Child::solve(Index columns, bool warm) {
  return ask<SolveReport>({{"do", "solve"}, {"columns", columns}, {"warm", warm}});
}
MemoryReport Child::memory() { return ask<MemoryReport>({{"do", "memory"}}); }

std::span<const double> Child::solutions() const {
  const auto bytes = solutions_.bytes();
  return {reinterpret_cast<const double*>(bytes.data()), bytes.size() / sizeof(double)};
}

}  // namespace espalier::bench
