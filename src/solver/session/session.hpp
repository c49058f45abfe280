/// \file
/// The state of a solver: one analysis, and a factor of it.
#pragma once

#include <cstdint>
#include <future>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "solver/analysis/analysis.hpp"
#include "solver/analysis/fresh_order.hpp"
#include "solver/factor/factor.hpp"
#include "solver/ranks/gathered_matrix.hpp"
#include "solver/session/context.hpp"

namespace espalier::solver {

/// Threads of a session with these options. @throws std::invalid_argument for values that options cannot have
/// @param link  to other ranks; null: there are none
int threads_of(const Options& options, const ranks::Communicator* link = nullptr);

/// Methods throw Error; Solver turns it into a Status.
class Session {
 public:
  explicit Session(Options the_options, const device::Registry& registry = device::registry())
      : Session(Ranks(), std::move(the_options), registry) {}
  Session(const Ranks& ranks, Options the_options, const device::Registry& registry = device::registry());
  ~Session();
  Session(const Session&) = delete;
  Session& operator=(const Session&) = delete;
  /// Another factor on the same analysis. @param threads  of its pool; 0: as many as the other one has
  Session(const Session& other, int threads);

  /// Both begin with nothing and end with a factor that has no numbers yet.
  void analyze(const GivenMatrix& a, std::shared_ptr<const Border> border = nullptr);
  void load_analysis(const std::string& path, const GivenMatrix& a);
  /// The same with what was read from a file, in a session that has done nothing yet.
  void take_analysis(const std::string& path, SavedAnalysis saved, const GivenMatrix& a);
  /// From the analysis that is there, where little has changed. @pre factor
  ChangeResult analyze_change(const GivenMatrix& a);
  /// The same of what the caller gives: with ranks, of rank 0's matrix.
  void analyze_given(const GivenMatrix& a);
  void load_given(const std::string& path, const GivenMatrix& a);
  ChangeResult analyze_change_given(const GivenMatrix& a);
  /// The same of a part.
  template <class Local>
  void analyze_part(const GivenLocal<Local>& part) {
    analyze(gather_part(part));
  }
  template <class Local>
  void load_part(const std::string& path, const GivenLocal<Local>& part) {
    load_analysis(path, gather_part(part));
  }
  /// The communicator of other ranks; null: there are none.
  [[nodiscard]] ranks::Communicator* link() const { return ranks.size() > 1 ? ranks.link().get() : nullptr; }

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

  Ranks ranks;
  Options options;  ///< the caller's, whatever becomes of them; Solver::set_refinement() alone changes them
  base::Interruption interruption;
  base::ThreadPool pool;
  base::MemoryBudget budget;
  std::unique_ptr<base::Timeline> timeline;
  int planning_threads = 1;  ///< see Context
  base::SpareMemory spare;   ///< likewise; outlives what lies in it
  const Context context;
  std::future<void> opening;           ///< of devices that the caller has named, beside the first analysis
  std::optional<std::uint64_t> forks;  ///< base::forks() when such a device was used; none: it was not
  std::optional<Factor> factor;        ///< none: there is no analysis
  AnalysisResult analysis;
  SolveResult solution;
  bool parts = false;            ///< values and vectors come in parts, by `gathered`
  GatheredMatrix gathered;       ///< of ranks, or of parts without them
  std::optional<RowRange> rows;  ///< of vectors on this rank, where the caller has said so

 private:
  template <class Local>
  WholeMatrix gather_part(const GivenLocal<Local>& part) {
    parts = true;
    rows.reset();
    return gathered.gather(part, link(), pool);
  }
  void agree_on_threads();
  void open_devices();
  void take(Analyzed made);
  ChangeResult analyze_anew(const GivenMatrix& a, ChangeResult result);
  void watch_drift();

  std::unique_ptr<FreshOrder> fresh_;  // null: no order is being made beside the work
};

/// See Solver::tiers().
std::vector<Solver::TierRow> tiers_of(const Session& s);

}  // namespace espalier::solver
