/// \file
/// The linear solver of a run: the library's solver with what a user wants to know of it, and matrices written for
/// others.
#pragma once

#include <memory>
#include <string>
#include <utility>
#include <vector>

#include "dynamics/dae/linear_solver.hpp"
#include "dynamics/model/run/shared_newton.hpp"

namespace espalier::dynamics::model {

/// What the solver did in this run.
struct SolverRecord {
  bool dense = false;
  Options options;
  AnalysisResult analysis;  ///< the last
  FactorResult factor;      ///< the last
  double analysis_seconds = 0;
  long followed = 0;  ///< analyses of a changed pattern that kept what the change did not touch
  /// With kind ldlt, which takes one half of the matrix for both: largest |a_ij - a_ji| / max |a_ij| of all
  /// factorizations, and how many had enough to slow Newton down.
  double largest_asymmetry = 0;
  long unsymmetric = 0;
  long dumped = 0;
};

/// Which Newton matrices are written.
struct DumpOptions {
  std::string folder;  ///< empty: none
  long every = 1, most = 10;
};

/// Options by name over newton_options(). @throws Error(invalid_input) for a wrong name or value
[[nodiscard]] Options run_options(const std::vector<std::pair<std::string, std::string>>& by_name, Index unknowns);

/// @param dense take the dense solver, for systems of a few dozen unknowns
/// @param analyses  folder where analyses are kept (SimulationOptions::analyses); empty: none
/// @param record kept up to date; must outlive the solver
/// @param shared  with other ranks, `options` being those that it has announced; null: there are none
[[nodiscard]] std::unique_ptr<LinearSolver> make_run_solver(const Options& options, bool dense, const DumpOptions& dump,
                                                            const std::string& analyses, SolverRecord& record,
                                                            std::unique_ptr<SharedNewton> shared = nullptr);

}  // namespace espalier::dynamics::model
