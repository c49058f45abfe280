#include "common/log.hpp"

#include <fcntl.h>
#include <unistd.h>

#include <cstdlib>
#include <mutex>
#include <string_view>

namespace espalier::hosts {

namespace {

std::string_view wish() {
  const char* text = std::getenv("ESPALIER_LOG");
  return text == nullptr ? std::string_view("0") : std::string_view(text);
}

// One write for a line: lines of several threads and processes do not mix.
void write_line(int file, const std::string& interface, const std::string& text) {
  const std::string line = "espalier " + interface + ": " + text + "\n";
  [[maybe_unused]] const auto written = ::write(file, line.data(), line.size());
}

}  // namespace

bool logs() { return !wish().empty() && wish() != "0"; }

void log(const std::string& interface, const std::string& text) {
  if (!logs()) return;
  if (wish() == "1") return write_line(STDERR_FILENO, interface, text);
  const int file = ::open(std::getenv("ESPALIER_LOG"), O_WRONLY | O_CREAT | O_APPEND | O_CLOEXEC, 0666);
  if (file < 0) return complain(interface, "the file of ESPALIER_LOG cannot be written");
  write_line(file, interface, text);
  ::close(file);
}

void complain(const std::string& interface, const std::string& text) {
  static std::mutex mutex;
  static std::string last;
  const std::lock_guard lock(mutex);
  if (last == text) return;
  last = text;
  write_line(STDERR_FILENO, interface, text);
}

}  // namespace espalier::hosts
