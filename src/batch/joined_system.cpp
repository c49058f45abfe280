#include "batch/joined_system.hpp"

#include <algorithm>
#include <cmath>
#include <vector>

#include "base/at.hpp"
#include "solve/residual.hpp"

namespace espalier::batch {

namespace {

// For rows and columns alike, so that products of two are powers of four, which change no digit.
double unit_of(double largest) {
  if (!(largest > 0) || !std::isfinite(largest)) return 1;
  return std::ldexp(1.0, -std::ilogb(largest) / 2);
}

void append(solver::StoredMatrix& all, const MatrixView& a, Index first) {
  const Offset entries = all.col_ptr.back();
  for (Index c = 1; c <= a.cols; ++c) all.col_ptr.push_back(entries + a.col_ptr[at(c)]);
  for (const Index r : a.row_ind) all.row_ind.push_back(first + r);
}

// What is not there is ones.
void append(std::vector<double>& all, const std::vector<double>& scale, Index n, double unit) {
  for (Index k = 0; k < n; ++k) all.push_back(scale.empty() ? unit : unit * scale[at(k)]);
}

void append(analysis::AssemblyTree& all, const analysis::AssemblyTree& tree) {
  const Index n = all.n, fronts = all.fronts();
  const Offset rows = all.row_ptr.back();
  all.n += tree.n;
  for (const Index c : tree.order) all.order.push_back(n + c);
  for (Index f = 0; f < tree.fronts(); ++f) {
    all.first.push_back(n + tree.first[at(f) + 1]);
    all.row_ptr.push_back(rows + tree.row_ptr[at(f) + 1]);
    all.parent.push_back(tree.parent[at(f)] < 0 ? -1 : fronts + tree.parent[at(f)]);
  }
  for (const Index r : tree.rows) all.rows.push_back(n + r);
}

}  // namespace

solver::Ordered joined_system(std::span<const JoinedBlock> blocks, const solver::Context& context) {
  solver::Ordered joined;
  solver::System& system = joined.draft.system;
  solver::PreparedMatrix& all = system.prepared;
  const solver::System& first = blocks.front().ordered->draft.system;
  system.kind = first.kind;
  all.a.storage = first.prepared.a.storage;
  all.a.col_ptr.push_back(0);
  joined.tree.first.push_back(0);
  joined.tree.row_ptr.push_back(0);
  const auto has = [&](auto&& list) {
    return std::any_of(blocks.begin(), blocks.end(),
                       [&](const JoinedBlock& b) { return !list(b.ordered->draft.system.prepared).empty(); });
  };
  const bool matched = has([](const solver::PreparedMatrix& p) -> const auto& { return p.row_of_col; });
  for (const JoinedBlock& b : blocks) {
    const solver::PreparedMatrix& p = b.ordered->draft.system.prepared;
    const Index n = joined.tree.n;
    const double unit = unit_of(b.largest);
    append(all.a, p.a, n);
    append(all.row_scale, p.row_scale, p.n(), unit);
    append(all.col_scale, p.col_scale, p.n(), unit);
    for (Index c = 0; c < p.n() && matched; ++c) all.row_of_col.push_back(n + p.row_of(c));
    append(joined.tree, b.ordered->tree);
  }
  all.a.rows = all.a.cols = joined.tree.n;
  all.caller_nonzeros = all.a.nonzeros();
  solver::note_determinant(all);
  system.rows = solve::ResidualOperator::rows_of(all.a, context.pool);
  joined.start = base::now_seconds();
  return joined;
}

}  // namespace espalier::batch
