#include "batch/repeated_analysis.hpp"

#include <utility>
#include <vector>

#include "base/at.hpp"
#include "solve/residual.hpp"
#include "solver/analysis/analysis_draft.hpp"

namespace espalier::batch {

namespace {

// `copies` of the matrix along the diagonal.
solver::StoredMatrix repeated(const MatrixView& a, Index copies) {
  solver::StoredMatrix all;
  all.rows = all.cols = a.cols * copies;
  all.storage = a.storage;
  all.col_ptr.resize(at(all.cols) + 1);
  all.row_ind.resize(at(a.nonzeros() * copies));
  for (Index k = 0; k < copies; ++k) {
    for (Index c = 0; c < a.cols; ++c) all.col_ptr[at(k * a.cols + c)] = k * a.nonzeros() + a.col_ptr[at(c)];
    for (Offset q = 0; q < a.nonzeros(); ++q) all.row_ind[at(k * a.nonzeros() + q)] = k * a.cols + a.row_ind[at(q)];
  }
  all.col_ptr[at(all.cols)] = a.nonzeros() * copies;
  return all;
}

template <class List, class T>
List repeated(const List& one, Index copies, T step) {
  List all;
  all.reserve(one.size() * at(copies));
  for (Index k = 0; k < copies; ++k)
    for (const auto v : one) all.push_back(v + static_cast<T>(k) * step);
  return all;
}

analysis::AssemblyTree repeated(const analysis::AssemblyTree& one, Index copies) {
  analysis::AssemblyTree all;
  all.n = one.n * copies;
  all.order = repeated(one.order, copies, one.n);
  all.rows = repeated(one.rows, copies, one.n);
  all.first.push_back(0);
  all.row_ptr.push_back(0);
  for (Index k = 0; k < copies; ++k)
    for (Index f = 0; f < one.fronts(); ++f) {
      all.first.push_back(k * one.n + one.first[at(f) + 1]);
      all.row_ptr.push_back(k * one.row_ptr.back() + one.row_ptr[at(f) + 1]);
      all.parent.push_back(one.parent[at(f)] < 0 ? -1 : k * one.fronts() + one.parent[at(f)]);
    }
  return all;
}

}  // namespace

solver::SharedAnalysis repeated_analysis(const solver::Analysis& one, Index copies, const solver::Context& context) {
  const solver::PreparedMatrix& p = one.system->prepared;
  auto system = std::make_shared<solver::System>();
  system->kind = one.kind();
  solver::PreparedMatrix& all = system->prepared;
  all.a = repeated(p.a, copies);
  all.caller_nonzeros = all.a.nonzeros();
  all.row_scale = repeated(p.row_scale, copies, 0.0);
  all.col_scale = repeated(p.col_scale, copies, 0.0);
  all.row_of_col = repeated(p.row_of_col, copies, p.n());
  all.wide = p.wide;
  const auto rows = system->rows = solve::ResidualOperator::rows_of(all.a, context.pool);
  return std::make_shared<const solver::Analysis>(solver::lay_out(
      std::move(system), repeated(one.plan.tree, copies), {one.device, 0, one.free_pivots}, context, rows.get()));
}

}  // namespace espalier::batch
