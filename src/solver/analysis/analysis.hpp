/// \file
/// What is known of a system before its values are factorized: a value that nobody changes once it is made, and that
/// any number of factors share.
#pragma once

#include <memory>

#include "matrix/row_index.hpp"
#include "plan/changed_plan.hpp"
#include "plan/kept_entries.hpp"
#include "solver/analysis/border.hpp"
#include "solver/analysis/prepared_matrix.hpp"
#include "solver/analysis/real_form.hpp"
#include "solver/options/device_choice.hpp"
#include "solver/session/context.hpp"

namespace espalier::solver {

struct SavedAnalysis;

/// The part that does not depend on where pivots are eliminated.
struct System {
  Kind kind = Kind::automatic;
  bool kind_may_change = false;                  ///< automatic took llt: ldlt when a pivot is not positive
  PreparedMatrix prepared;                       ///< without values
  std::shared_ptr<const matrix::RowIndex> rows;  ///< of prepared.a, see ResidualOperator::rows_of()
  bool rows_are_shared = false;  ///< by ranks: each has in `rows` what it computes residuals of (solve::own_rows())
  std::shared_ptr<const Border> border;  ///< null: there is none
  /// Complex: the real system that plans and factors are made for; null: they are made for this one.
  std::shared_ptr<const RealForm> real_form;

  [[nodiscard]] Offset bytes() const { return prepared.bytes() + rows->bytes() + (real_form ? real_form->bytes() : 0); }
  /// The rows of the whole matrix; null where each rank has its part.
  [[nodiscard]] const matrix::RowIndex* all_rows() const { return rows_are_shared ? nullptr : rows.get(); }
  /// The rows of the whole matrix, made where each rank has its part.
  [[nodiscard]] std::shared_ptr<const matrix::RowIndex> index_of_all(base::ThreadPool& pool) const;
  [[nodiscard]] base::Numbers numbers() const { return prepared.numbers; }
  /// Doubles in one number.
  [[nodiscard]] Index parts() const { return base::parts_of(prepared.numbers); }

  /// What plans and factors are made for.
  [[nodiscard]] MatrixView factored_pattern() const { return real_form ? real_form->a : prepared.a; }
  [[nodiscard]] const std::vector<Index>& factored_row_of_col() const {
    return real_form ? real_form->row_of_col : prepared.row_of_col;
  }
  [[nodiscard]] const matrix::RowIndex& factored_rows() const { return real_form ? real_form->rows : *rows; }
  [[nodiscard]] bool complex_factor() const { return numbers() != base::Numbers::real && !real_form; }
  /// So many of this system's unknowns have these pivots of a factor.
  [[nodiscard]] Index unknowns(std::size_t pivots) const {
    return static_cast<Index>(real_form ? (pivots + 1) / 2 : pivots);
  }
  /// The unknown (column) that an unknown of plans stands for.
  [[nodiscard]] Index unknown_of(Index col) const { return real_form ? col / 2 : col; }
};

struct Analysis {
  std::shared_ptr<const System> system;
  DeviceChoice device;  ///< where it will be factorized
  plan::Plan plan;
  Index moved_pivots = 0;             ///< columns moved to later fronts since analyze()
  bool free_pivots = false;           ///< the host's own widths of tiles, whatever the caller asked for
  bool fp64 = false;                  ///< whatever the caller asked for: see Context::raised
  double gain_of_single = 1;          ///< Precision::automatic: see gain_of_single()
  Offset fill_of_ordering = 0;        ///< entries of the factor, and
  double flops_of_ordering = 0;       ///< work, when all of it was ordered the last time
  Offset changed_since_ordering = 0;  ///< entries that have come or gone since then
  AnalysisResult result = {};         ///< what analyze() tells the caller

  [[nodiscard]] Kind kind() const { return system->kind; }
  [[nodiscard]] Index n() const { return system->prepared.n(); }
  /// Doubles in a vector of n numbers.
  [[nodiscard]] Offset doubles() const { return Offset{system->parts()} * n(); }
  /// Operations of real numbers: a complex multiplication and addition are eight, not two.
  [[nodiscard]] double flops() const { return plan.flops * (system->complex_factor() ? 4 : 1); }
  /// The tree of the system itself, where pivots have not moved yet (real form), or as they are.
  [[nodiscard]] const analysis::AssemblyTree& own_tree() const {
    return system->real_form ? system->real_form->tree : plan.tree;
  }
  /// With the values of one factor.
  [[nodiscard]] Offset bytes() const;
};
/// Most bytes on the host, with a factor and a refined solution for one right-hand side.
Offset predicted_host_bytes(const Analysis& analysis, const Context& context);
using SharedAnalysis = std::shared_ptr<const Analysis>;

/// A new analysis, and the values that it was made with, for its first factor.
struct Analyzed {
  SharedAnalysis analysis;
  Values values;
};

/// @param border  null: none. It is part of the plan where the backend keeps it (Limits::keeps_border)
/// @throws Error(invalid_input) for a matrix that is not square, has no rows, or is inconsistent
Analyzed analyze(const GivenMatrix& a, const Context& context, std::shared_ptr<const Border> border = nullptr);
/// From a file of write_analysis().
Analyzed load_analysis(const std::string& path, const GivenMatrix& a, const Context& context);
/// The same with what was read, of a matrix that was checked. @param path  for messages
Analyzed analysis_from(const std::string& path, SavedAnalysis saved, const GivenMatrix& given, const Context& context);
/// The same system for ldlt, with these values; the caller's values still go where they went.
Analyzed analyze_for_ldlt(const Analysis& llt, std::span<const double> values, const Context& context);

/// What changes when a plan is laid out anew: pivots were moved, or other devices take over.
struct Changes {
  DeviceChoice device;
  Index moved_pivots = 0;  ///< in all
  bool free_pivots = false;
};
/// An analysis for the pattern of `a` that keeps of `before` what the change of the pattern does not touch: the order
/// but for a few unknowns (analysis/tree_change.hpp), scaling, matching, kind and devices. See
/// Solver::analyze_change().
struct FollowedAnalysis {
  /// For the numbers of a factor: which fronts stay, and where the entries of before stand now.
  struct Numbers {
    plan::FrontsBefore fronts;
    plan::SourceMap entries;
    std::string why_none;  ///< no front stays, for this reason; empty: some do
  };
  Analyzed made;  ///< no analysis: `why` says why all must be ordered anew
  std::string why;
  Offset added = 0, removed = 0;  ///< entries
  Index moved = 0, kept = 0;      ///< unknowns; fronts
  bool reordered = false;         ///< by the order that was made beside the work
  Numbers numbers = {};           ///< where they were asked for
};
class FreshOrder;
/// @param fresh  an order that is being made; null: none. It is taken when it is due and the factor becomes smaller by
/// it
/// @param numbers  whether a factor's are there, of which the next one is to keep what it can
/// @throws Error(singular) naming rows of which no entry is left, where singular matrices are errors
FollowedAnalysis follow_pattern(const Analysis& before, const GivenMatrix& a, const Context& context,
                                FreshOrder* fresh = nullptr, bool numbers = false);

/// The same system with this tree.
SharedAnalysis lay_out_again(const Analysis& before, analysis::AssemblyTree tree, Changes changes,
                             const Context& context);
/// The same system and devices where pivots have moved, in a plan that is made of the one before (plan::change_plan()).
struct ChangedAnalysis {
  SharedAnalysis analysis;
  plan::FrontsBefore fronts;
};
/// @param front_before  what relocate_pivots() returned for this tree
/// @param moved_pivots  in all
/// @returns no analysis where the plan has to be laid out anew
ChangedAnalysis change_analysis(const Analysis& before, analysis::AssemblyTree tree, std::vector<Index> front_before,
                                Index moved_pivots, const Context& context);

}  // namespace espalier::solver
