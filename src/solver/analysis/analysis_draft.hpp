/// \file
/// Steps that all ways to an analysis share.
#pragma once

#include "solver/analysis/analysis.hpp"

namespace espalier::solver {

/// An analysis in the making.
struct Draft {
  System system;
  Values values;
  AnalysisResult result;
};

/// A draft whose order of elimination is known. Only where it will be factorized is left to be chosen.
struct Ordered {
  Draft draft;
  analysis::AssemblyTree tree;
  double start = 0;
};

/// analyze() in two steps; the first does not look at devices.
Ordered order(const GivenMatrix& a, const Context& context, std::shared_ptr<const Border> border = nullptr);
Analyzed finish(Ordered ordered, const Context& context);

/// @throws Error(invalid_input) for what is no linear system
void check_matrix(const GivenMatrix& given, base::ThreadPool& pool);
/// The plan of a system with this tree.
/// @param rows  index of the whole matrix; null: it is made
/// @param kept  see plan::make_plan()
Analysis lay_out(std::shared_ptr<const System> system, analysis::AssemblyTree tree, Changes changes,
                 const Context& context, const matrix::RowIndex* rows, const plan::KeptEntries* kept = nullptr);
/// Keeps of the index what this rank computes residuals of, where they are shared. @returns the index of the whole
/// matrix, for the plan
std::shared_ptr<const matrix::RowIndex> share_rows(System& system, const DeviceChoice& device, const Context& context);
/// Fills in what the plan says. @pre `result` may hold what the plan does not
void describe(Analysis& analysis, const Context& context);

}  // namespace espalier::solver
