/// \file
/// How far a command is: a line on a terminal, and lines of JSON for other programs.
#pragma once

#include <chrono>
#include <condition_variable>
#include <memory>
#include <mutex>
#include <optional>
#include <string>
#include <string_view>
#include <thread>

#include "base/stage.hpp"
#include "common/progress_lines.hpp"

namespace espalier::cli {

/// Says on stderr which phase is running: elsewhere than on a terminal one plain line when it has ended; on one, when
/// the command takes longer than two seconds, also a line that is rewritten: what is done, with a bar, and how long it
/// will take. One at a time, in the thread that works.
class Progress {
 public:
  /// @param enabled  false: says nothing to people  @param lines  for programs
  Progress(bool enabled, std::string_view command, const ProgressLines::Options& lines);
  ~Progress();
  Progress(const Progress&) = delete;
  Progress& operator=(const Progress&) = delete;

  /// Starts a phase. @param predicted_seconds 0: not known
  void begin(std::string phase, double predicted_seconds = 0);
  /// Ends it; `outcome` ("1.2 s, 97 GFLOP/s") may be empty.
  void end(std::string_view outcome);
  /// Ends a phase that failed, if one is running: leaves a clean line for the message.
  void abandon();
  /// From here on the line says what the library does, with `note` ("t = 0.12") in the middle.
  void follow(std::string note);
  /// A line of text, above the one that is rewritten.
  void say(std::string_view line);
  /// The progress of a simulation, for programs.
  void note_step(const ProgressLines::Step& step) {
    const std::lock_guard lock(mutex_);
    lines_.note_step(step);
  }
  [[nodiscard]] bool live() const { return live_; }

 private:
  using Clock = std::chrono::steady_clock;
  void hear(const ProgressReport& report);
  void repaint_until_stopped();
  void paint();
  void clear();

  bool enabled_, live_ = false;
  bool running_ = false, stop_ = false, painted_ = false;  // guarded by mutex_, as all below
  std::string phase_, note_;
  ProgressReport report_;
  Clock::time_point start_, heard_;
  std::mutex mutex_;
  std::condition_variable wake_;
  ProgressLines& lines_;
  std::unique_ptr<ProgressListener> listener_;  // null: nobody looks
  std::optional<base::Stage> stage_;
  std::thread painter_;
};

}  // namespace espalier::cli
