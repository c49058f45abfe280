/// \file
/// What is behind a Solver or a ComplexSolver, for those who work with its factor.
#pragma once

#include "espalier/complex_solver.hpp"
#include "espalier/solver.hpp"
#include "solver/session/session.hpp"

namespace espalier {

struct Solver::Impl : solver::Session {
  using Session::Session;
};

struct ComplexSolver::Impl : solver::Session {
  using Session::Session;
};

namespace solver {

/// Whoever works with the factor of a solver beside its own calls.
struct SolverAccess {
  static Session& session(Solver& s) { return *s.impl_; }
  static Session& session(ComplexSolver& s) { return *s.impl_; }
};

}  // namespace solver

}  // namespace espalier
