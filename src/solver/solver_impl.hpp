/// \file
/// What is behind a Solver, for those who work with its factor.
#pragma once

#include "espalier/solver.hpp"
#include "solver/session.hpp"

namespace espalier {

struct Solver::Impl : solver::Session {
  using Session::Session;
};

namespace solver {

/// Whoever works with the factor of a Solver beside its own calls.
struct SolverAccess {
  static Session& session(Solver& s) { return *s.impl_; }
};

}  // namespace solver

}  // namespace espalier
