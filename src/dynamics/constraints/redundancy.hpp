/// \file
/// Redundant constraints: found by the rank of Phi_q, named, left out, watched.
#pragma once

#include <string>
#include <vector>

#include "dynamics/dae/equations.hpp"
#include "dynamics/integrators/initial.hpp"

namespace espalier::dynamics {

/// A row that is a combination of rows before it: row = sum weight * partner.
struct DependentRow {
  Index row = 0;
  double remainder = 0;         ///< largest entry left of the row after elimination, relative to the row
  std::vector<Index> partners;  ///< rows with the largest weights first
  std::vector<double> weights;  ///< as many
};

/// Gaussian elimination of sparse rows with the largest entry of each row as its pivot, in the order given: the rows
/// whose remainder falls below tolerance * |row| depend on those before them. Costs the fill of Phi_q; for
/// loops that close far apart in the list it is the fill between them.
/// `tolerance` 1e-8: well above round-off (1e-16 times the growth of the elimination), far below any lever arm that
/// means something. `most_partners`: the combination of a row is followed back no further than that many rows.
/// `last`: rows, ascending, whose turn comes after all others.
[[nodiscard]] std::vector<DependentRow> find_dependent_rows(const SparsePattern& phi_q, ConstSpan values,
                                                            double tolerance = 1e-8,
                                                            std::size_t most_partners = ~std::size_t{0},
                                                            std::span<const Index> last = {});

/// What is known of a redundant constraint.
struct RedundantConstraint {
  Index row = 0;
  std::string name;                   ///< of the constraint left out
  std::vector<std::string> partners;  ///< names of the constraints that imply it, most important first (at most four)
  double violation = 0;               ///< |Phi| of the row left out, at the last check
};

struct RedundancyOptions {
  double tolerance = 1e-8;      ///< of the rank decision
  double inconsistency = 1e-5;  ///< a constraint left out that is violated by more (of constraint_sizes()) is an error
};

/// Finds redundant constraints and keeps the equations free of them. Of a holonomic and a non-holonomic one, which says
/// less, the latter is left out.
class RedundancyGuard {
 public:
  RedundancyGuard(Equations& equations, RedundancyOptions options = {}) : equations_(equations), options_(options) {}

  /// Constraints (m marks) that are not there at present, because their joint is switched off: left out, and no reason
  /// to leave out others. To be followed by analyze() or prepare().
  void set_absent(std::vector<char> absent) { absent_ = std::move(absent); }
  /// Takes up a decision made earlier (m marks, as in Equations::dropped()) instead of making one.
  void adopt(const std::vector<char>& dropped);

  /// Decides which constraints are left out, at a configuration near the constraints. Where the given configuration is
  /// singular (rank smaller than next to it), the decision is made beside it, so that no constraint is lost that
  /// matters as soon as the mechanism moves.
  void analyze(const State& state);
  /// analyze(), make_consistent() and check(): the usual beginning of a simulation.
  ConsistencyResult prepare(State& state, const ConsistencyOptions& options = {});
  /// Looks whether the constraints left out are satisfied at position and velocity level; to be called now and then.
  /// @param at_rest look at the positions only (statics, where motors do not turn)
  /// @throws espalier::Error that names the pair if they contradict the others by more than `inconsistency`
  void check(const State& state, bool at_rest = false);

  /// Reactions that constraints left out could bear as well as others are not determined by the motion. Makes those of
  /// least norm of the multipliers, which fit the same accelerations: sum (s_i lambda_i)^2, s_i the largest entry of a
  /// row by lengths (rotations times the extent of the model). As it is where there are very many.
  void share_reactions(State& state);

  [[nodiscard]] const std::vector<RedundantConstraint>& redundant() const { return redundant_; }
  /// Lines for the log, one per constraint left out.
  [[nodiscard]] std::vector<std::string> notices() const;
  /// n - rank(Phi_q)
  [[nodiscard]] Index degrees_of_freedom() const;

 private:
  /// Entries of Phi_q, those of lengths times the extent of the model (positions, and arms of the constraints), over
  /// the largest of each row (`sizes`); zero in absent rows.
  [[nodiscard]] std::vector<double> scaled_rows(double t, ConstSpan q, std::vector<double>& sizes);
  /// @param last  rows whose turn comes after all others
  [[nodiscard]] std::vector<DependentRow> dependent_at(double t, ConstSpan q,
                                                       const std::vector<DependentRow>& last = {});

  Equations& equations_;
  RedundancyOptions options_;
  [[nodiscard]] bool absent(Index row) const { return !absent_.empty() && absent_[at(row)] != 0; }

  std::vector<RedundantConstraint> redundant_;
  std::vector<char> absent_;  // m, or empty
};

}  // namespace espalier::dynamics
