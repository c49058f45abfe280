/// \file
/// The benchmark's side of a rival's process.
#pragma once

#include <sys/types.h>

#include <nlohmann/json_fwd.hpp>
#include <string>
#include <vector>

#include "rivals/protocol.hpp"
#include "rivals/shared_system.hpp"

namespace espalier::bench {

/// How rivals' processes are run.
struct ChildSettings {
  std::string folder;                    ///< where the host program and the plug-ins lie
  std::vector<std::string> environment;  ///< "NAME=value", set in addition to this process's environment
  double timeout_seconds = 600;          ///< for one command
  Offset memory_limit_bytes = 0;         ///< RLIMIT_DATA of the process; 0: none
};

/// A rival in a process of its own. Every call returns a report; a process that dies or is too slow is a verdict
/// (crashed, out_of_memory, timed_out) and every later call repeats it.
class Child {
 public:
  /// `spec` is name or name:variant. The rival reads `system`. Starts the process and does not wait for it.
  Child(const std::string& spec, const SharedSystem& system, const ChildSettings& settings);
  Child(const Child&) = delete;
  Child& operator=(const Child&) = delete;
  /// Ends the process.
  ~Child();

  [[nodiscard]] const std::string& spec() const { return spec_; }
  /// How the start went; waits for it the first time.
  const Hello& hello();
  AnalyzeReport analyze(Kind kind, int threads);
  FactorReport factorize();
  /// `warm`: see warm_up().
  FactorReport refactorize(bool warm);
  SolveReport solve(Index columns, bool warm);
  MemoryReport memory();
  /// The last solutions, column by column, as many columns as the system has right-hand sides.
  [[nodiscard]] std::span<const double> solutions() const;

 private:
  void start(const std::string& plugin, const std::string& variant, int system_descriptor);
  /// Reads one line; false with verdict_ set where none came.
  bool read_answer(std::string& line);
  template <typename Report>
  Report ask(const nlohmann::json& command);
  /// Collects the ended process and says how it ended.
  Verdict post_mortem();
  void kill_process();
  /// Last non-empty line that the process wrote to its standard streams.
  [[nodiscard]] std::string last_words() const;

  std::string spec_;
  ChildSettings settings_;
  SharedMemory solutions_;
  Hello hello_;
  bool greeted_ = false;
  Verdict end_;  ///< set once the process is gone
  pid_t process_ = -1;
  int commands_ = -1, answers_ = -1, log_ = -1;
  std::string doing_ = "start", pending_;
};

}  // namespace espalier::bench
