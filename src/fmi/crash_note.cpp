#include "fmi/crash_note.hpp"

#include <unistd.h>

#include <array>
#include <csignal>
#include <cstring>
#include <mutex>
#include <utility>

namespace espalier::fmi {
namespace {

constexpr std::array<int, 5> kFaults = {SIGSEGV, SIGBUS, SIGFPE, SIGILL, SIGABRT};

thread_local const char* title_of_thread = nullptr;
thread_local const char* function_of_thread = nullptr;
std::mutex handlers_mutex;
int handlers_users = 0;
std::array<struct sigaction, kFaults.size()> handlers_before;

void say(const char* text) {
  const ssize_t written = ::write(STDERR_FILENO, text, std::strlen(text));
  static_cast<void>(written);  // nothing can be done about it here
}

/// Then what was there before takes its turn: the fault comes again.
void on_fault(int signal) {
  if (title_of_thread != nullptr) {
    for (const char* part : {"\nespalier: ", title_of_thread, ": crashed in ", function_of_thread, "\n"}) say(part);
  }
  for (std::size_t k = 0; k < kFaults.size(); ++k)
    if (kFaults[k] == signal) ::sigaction(signal, &handlers_before[k], nullptr);
}

}  // namespace

CrashNote::CrashNote(const std::string& title, const char* function)
    : title_before_(std::exchange(title_of_thread, title.c_str())),
      function_before_(std::exchange(function_of_thread, function)) {
  const std::lock_guard<std::mutex> lock(handlers_mutex);
  if (handlers_users++ > 0) return;
  struct sigaction ours = {};
  ours.sa_handler = &on_fault;
  ours.sa_flags = SA_ONSTACK;
  for (std::size_t k = 0; k < kFaults.size(); ++k) ::sigaction(kFaults[k], &ours, &handlers_before[k]);
}

CrashNote::~CrashNote() {
  title_of_thread = title_before_;
  function_of_thread = function_before_;
  const std::lock_guard<std::mutex> lock(handlers_mutex);
  if (--handlers_users > 0) return;
  for (std::size_t k = 0; k < kFaults.size(); ++k) ::sigaction(kFaults[k], &handlers_before[k], nullptr);
}

}  // namespace espalier::fmi
