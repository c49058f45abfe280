#include "rivals/process_memory.hpp"

#include <malloc.h>

#include <fstream>
#include <string>

namespace espalier::bench {
namespace {

/// The figure behind `key` in /proc/self/status, which counts in KiB; 0 where it is absent.
Offset status_bytes(const std::string& key) {
  std::ifstream status("/proc/self/status");
  std::string line;
  while (std::getline(status, line))
    if (line.compare(0, key.size(), key) == 0) return std::stoll(line.substr(key.size())) * 1024;
  return 0;
}

}  // namespace

Offset resident_bytes() { return status_bytes("VmRSS:"); }

Offset peak_resident_bytes() { return status_bytes("VmHWM:"); }

void reset_peak_memory() {
  malloc_trim(0);
  std::ofstream("/proc/self/clear_refs") << 5;
}

}  // namespace espalier::bench
