/// \file
/// The state behind espalier::Solver.
#pragma once

#include <future>
#include <memory>
#include <optional>

#include "analysis/ordering.hpp"
#include "base/memory.hpp"
#include "base/thread_pool.hpp"
#include "base/timeline.hpp"
#include "espalier/solver.hpp"
#include "plan/plan.hpp"
#include "solve/refinement.hpp"
#include "solve/residual.hpp"
#include "solver/device_choice.hpp"
#include "solver/equations.hpp"
#include "solver/numeric.hpp"

namespace espalier {

/// What analyze(), factorize() and solve() share. Methods throw Error; Solver turns it into a Status.
struct Solver::Impl {
  explicit Impl(Options the_options);
  ~Impl();
  Impl(const Impl&) = delete;
  Impl& operator=(const Impl&) = delete;

  /// @throws Error(device_error) in the child of a fork() whose parent had used a GPU here
  void expect_usable() const;
  [[nodiscard]] bool gpu_lost() const;

  // analysis.cpp
  void analyze(const MatrixView& a);
  void analyze_as(const MatrixView& a, Kind kind);
  void load_analysis(const std::string& path, const MatrixView& a);
  void open_gpus();
  void lay_out_plan(analysis::AssemblyTree tree);
  void describe_plan(double start);

  // factorization.cpp
  void factorize(std::span<const double> values);
  void factorize_device(const double* values, Offset count, void* stream);
  void fetch_values();
  void load_values(std::span<const double> values);
  void send_values();
  void begin_factorization();
  void finish_factorization(device::FactorOutcome outcome, double start);
  void set_smallest_pivot();
  void make_numeric();
  /// Of every device; 0: what is free.
  [[nodiscard]] std::vector<Offset> budgets() const;
  void turn_to_ldlt();
  device::FactorOutcome factorize_moving_pivots();
  bool move_pivots(const device::FactorOutcome& outcome);
  [[nodiscard]] bool narrow_tiles() const;
  [[nodiscard]] bool factor_solves() const;
  void choose_pivots_freely();
  void report(const device::FactorOutcome& outcome);

  // substitution.cpp
  void solve(std::span<const double> b, std::span<double> x, Index columns, bool transpose);
  void solve_device(const double* b, double* x, Index columns, bool transpose, void* stream);
  bool solve_through_device(const double* b, double* x, Index columns, bool transpose);
  void solve_on_device(solver::DeviceSystem& system, const double* b, double* x, Index columns, bool transpose);
  void solve_at(const solve::ResidualSpace& space, const solve::Preconditioner& apply, const double* b, double* x,
                Index columns, bool transpose, bool krylov);
  void judge_solution(const double* b, Index columns);  ///< b: null where it lies on a GPU
  double condition_estimate();

  void log(const std::string& line) const {
    if (options.log) options.log(line);
  }
  [[nodiscard]] bool single() const { return options.precision != Precision::fp64; }
  /// Of the equations, their index and the plan: they count in the budget from the first factorization on.
  [[nodiscard]] Offset analysis_bytes() const;
  /// Most bytes on the host, with a factor and a refined solution for one right-hand side.
  [[nodiscard]] Offset predicted_host_bytes() const;
  void charge_analysis();

  Options options;
  State state = State::empty;
  base::ThreadPool pool;
  base::MemoryBudget budget;
  Offset charged = 0;  // of the analysis, in the budget
  std::unique_ptr<base::Timeline> timeline;
  Kind kind = Kind::automatic;   // of the current analysis
  bool kind_may_change = false;  // automatic took llt: ldlt when a pivot is not positive
  solver::Equations equations;
  solve::ResidualOperator residual;
  std::future<void> gpus_open;             // of options.device, beside the analysis
  std::optional<std::uint64_t> gpu_forks;  // base::forks() when a GPU was used first; none: no GPU was used
  solver::DeviceChoice device;
  solver::PredictedTime predicted;
  plan::Plan plan;
  std::unique_ptr<solver::Numeric> numeric;  // made by the first factorize()
  double smallest_pivot = 0;                 // relative; a smaller pivot counts as zero
  bool values_on_device = false;             // the last values are on the GPU alone
  Index moved_pivots = 0;                    // columns moved to later fronts since analyze()
  bool free_pivots = false;                  // the host's tiles took over since, see choose_pivots_freely()
  AnalysisResult analysis;
  FactorResult factor;
  SolveResult solution;
};

}  // namespace espalier
