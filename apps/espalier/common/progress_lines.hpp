/// \file
/// `--json-progress`: how far a command is, for other programs.
#pragma once

#include <chrono>
#include <optional>
#include <string>
#include <string_view>

#include "espalier/progress.hpp"

namespace CLI {
class App;
}

namespace espalier::cli {

/// One JSON object a line (docs/guide/command_line.md), each written at once. A reader that is gone or a full disk ends
/// the lines, not the command. Not for several threads at a time.
class ProgressLines {
 public:
  /// Where lines go.
  struct Options {
    std::string file;     ///< "-": stderr; empty: to `descriptor`
    int descriptor = -1;  ///< negative, without a file: nowhere
    void add_to(CLI::App& command);
    [[nodiscard]] bool wanted() const { return !file.empty() || descriptor >= 0; }
  };
  struct Step {
    double time = 0;
    long steps = 0;
    int newton = 0;
  };

  /// There is one: its last line tells how the program ends.
  static ProgressLines& of_program();

  /// @throws Error(invalid_input) where nothing can be written there
  void open(std::string_view command, const Options& options);
  [[nodiscard]] bool open() const { return descriptor_ >= 0; }
  [[nodiscard]] bool on_stderr() const;
  /// At most five a second. @param since  seconds that have passed since the report
  void write(const ProgressReport& report, double since);
  void note_step(const Step& step) { step_ = step; }
  /// The last line.
  void finish(int exit_code, const std::string& message);

 private:
  using Clock = std::chrono::steady_clock;
  [[nodiscard]] std::string members(const ProgressReport& report, double since) const;
  void write_line(const std::string& text);

  std::string command_;
  int descriptor_ = -1;  // -1: closed
  bool owned_ = false;
  Clock::time_point start_, due_;
  ProgressReport last_;
  std::optional<Step> step_;
};

}  // namespace espalier::cli
