/// \file
/// Z factorized and solved at several frequencies at the same time, on one analysis.
#pragma once

#include <memory>
#include <span>
#include <vector>

#include "espalier/harmonic.hpp"
#include "harmonic/dynamic_stiffness.hpp"
#include "modes/resources.hpp"
#include "solver/session/session.hpp"

namespace espalier::harmonic {

/// What one frequency gave.
struct Answer {
  Status status;
  double backward_error = 0;
  double rounding = 0;     ///< how far rounding of the entries of Z may move the solution, relative, to its order
  std::vector<Complex> x;  ///< columns x n
  Index solved_columns = 0;
  double factor_seconds = 0, solve_seconds = 0;
};

/// Each frequency is given to a factor that treats it as one that has just been made on the shared analysis would: the
/// answers do not depend on which frequencies came before, nor on the number of threads. The analysis is made at the
/// first frequency of all, and is the one that this frequency's factor ended with (pivots moved, for instance).
class Teams {
 public:
  /// All outlive the object.
  Teams(const DynamicStiffness& z, std::span<const Complex> loads, Index columns, const HarmonicOptions& options,
        modes::Resources& shop, HarmonicResult& result);
  /// In the order of the frequencies. Times and counts go into the result.
  /// @throws Error where memory or devices fail, the caller interrupts, or Z has no analysis
  std::vector<Answer> solve(std::span<const double> frequencies);
  /// So many frequencies at a time keep all threads busy, and their solutions small.
  [[nodiscard]] std::size_t at_a_time() const;

 private:
  struct Team {
    Team(const Options& options, const solver::SharedAnalysis& analysis);
    solver::Session session;
    std::vector<Complex> z;
  };
  void begin(double frequency);
  [[nodiscard]] int most_teams() const;
  /// The team, made anew where its factor has gone its own way.
  Team& fresh(std::unique_ptr<Team>& team, int threads, int beside);
  [[nodiscard]] Answer solve_one(Team& team, double frequency) const;
  double rounding_of(Team& team, double w, const std::vector<Complex>& x, double z_norm, Answer& out) const;

  const DynamicStiffness& z_;
  std::span<const Complex> loads_;
  Index columns_;
  modes::Resources& shop_;
  HarmonicResult& result_;
  Options options_;
  std::unique_ptr<Team> whole_;  // analyzes, and has all threads
  solver::SharedAnalysis analysis_;
  std::vector<std::unique_ptr<Team>> teams_;  // of one thread each
};

}  // namespace espalier::harmonic
