/// \file
/// The state of a solver: one analysis, and a factor of it.
#pragma once

#include <cstdint>
#include <future>
#include <memory>
#include <optional>
#include <string>

#include "solver/analysis.hpp"
#include "solver/context.hpp"
#include "solver/factor.hpp"

namespace espalier::solver {

/// Threads of a session with these options. @throws std::invalid_argument for values that options cannot have
int threads_of(const Options& options);

/// Methods throw Error; Solver turns it into a Status.
class Session {
 public:
  explicit Session(Options the_options, const device::Registry& registry = device::registry());
  ~Session();
  Session(const Session&) = delete;
  Session& operator=(const Session&) = delete;
  /// Another factor on the same analysis. @param threads  of its pool; 0: as many as the other one has
  Session(const Session& other, int threads);

  /// Both begin with nothing and end with a factor that has no numbers yet.
  void analyze(const MatrixView& a);
  void load_analysis(const std::string& path, const MatrixView& a);

  [[nodiscard]] Solver::State state() const {
    if (!factor) return Solver::State::empty;
    return factor->factorized() ? Solver::State::factorized : Solver::State::analyzed;
  }
  /// @throws Error(device_error) in the child of a fork() whose parent had used a device with memory of its own here
  void expect_usable() const;
  [[nodiscard]] bool device_lost() const;
  /// The current analysis' devices are about to be used.
  void note_devices();
  /// @pre factor
  [[nodiscard]] const Analysis& current() const { return *factor->analysis(); }

  Options options;  ///< the caller's, whatever becomes of them; Solver::set_refinement() alone changes them
  base::Interruption interruption;
  base::ThreadPool pool;
  base::MemoryBudget budget;
  std::unique_ptr<base::Timeline> timeline;
  const Context context;
  std::future<void> opening;           ///< of devices that the caller has named, beside the first analysis
  std::optional<std::uint64_t> forks;  ///< base::forks() when such a device was used; none: it was not
  std::optional<Factor> factor;        ///< none: there is no analysis
  AnalysisResult analysis;
  SolveResult solution;

 private:
  void open_devices();
  void take(Analyzed made);
};

}  // namespace espalier::solver
