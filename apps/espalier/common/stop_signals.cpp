#include "common/stop_signals.hpp"

#include <atomic>
#include <csignal>

namespace espalier::cli {

namespace {

std::atomic<bool> stop_asked{false};

void on_stop_signals(void (*handler)(int)) {
  std::signal(SIGINT, handler);
  std::signal(SIGTERM, handler);
  if (std::signal(SIGHUP, handler) == SIG_IGN) std::signal(SIGHUP, SIG_IGN);  // nohup
}

extern "C" void ask_to_stop(int) {
  stop_asked.store(true);
  on_stop_signals(SIG_DFL);
}

}  // namespace

StopSignals::StopSignals() { on_stop_signals(ask_to_stop); }
StopSignals::~StopSignals() { on_stop_signals(SIG_DFL); }

bool stop_was_asked() { return stop_asked.load(); }

}  // namespace espalier::cli
