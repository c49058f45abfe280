#include "solver/analysis/condition_guess.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <numeric>

namespace espalier::solver {

namespace {

constexpr Index kShare = 64, kSmallest = 200, kLargest = 4096;  // unknowns of the larger part

// Positions of a sub-tree's pivots.
struct SubTree {
  Index begin = 0, end = 0;
  [[nodiscard]] Index size() const { return end - begin; }
};

// The largest sub-tree of at most `most` unknowns within a range of positions.
SubTree largest_sub_tree(const analysis::AssemblyTree& tree, SubTree within, Index most) {
  std::vector<Index> begin(tree.first.begin(), tree.first.end() - 1);  // of each sub-tree
  SubTree found;
  for (Index f = 0; f < tree.fronts(); ++f) {
    const SubTree p{begin[at(f)], tree.first[at(f) + 1]};
    if (p.begin >= within.begin && p.end <= within.end && p.size() <= most && p.size() > found.size()) found = p;
    if (const Index parent = tree.parent[at(f)]; parent >= 0) begin[at(parent)] = std::min(begin[at(parent)], p.begin);
  }
  return found;
}

// Its principal submatrix, in the order of elimination, with a diagonal of 1. Empty: the diagonal is not positive.
SparseMatrix part_of(const MatrixView& a, const Values& values, std::span<const Index> order) {
  const auto size = static_cast<Index>(order.size());
  std::vector<Index> local(at(a.cols), -1);
  for (Index k = 0; k < size; ++k) local[at(order[at(k)])] = k;
  SparseMatrix part{size, size, std::vector<Offset>(order.size() + 1), {}, {}, Storage::symmetric_lower};
  std::vector<double> scale(order.size(), 0.0);
  const auto for_each = [&](auto&& use) {  // (row, column, value) of the lower triangle
    for (Index k = 0; k < size; ++k)
      for (Offset e = a.col_ptr[at(order[at(k)])]; e < a.col_ptr[at(order[at(k)]) + 1]; ++e)
        if (const Index other = local[at(a.row_ind[e])]; other >= 0)
          use(std::max(k, other), std::min(k, other), values[at(e)]);
  };
  for_each([&](Index r, Index c, double value) {
    ++part.col_ptr[at(c) + 1];
    if (r == c) scale[at(c)] = value;
  });
  for (double& s : scale) {
    if (!(s > 0)) return {};
    s = 1 / std::sqrt(s);
  }
  std::partial_sum(part.col_ptr.begin(), part.col_ptr.end(), part.col_ptr.begin());
  part.row_ind.resize(at(part.nonzeros()));
  part.values.resize(part.row_ind.size());
  std::vector<Offset> next(part.col_ptr.begin(), part.col_ptr.end() - 1);
  for_each([&](Index r, Index c, double value) {
    const Offset e = next[at(c)]++;
    part.row_ind[at(e)] = r;
    part.values[at(e)] = value * scale[at(r)] * scale[at(c)];
  });
  return part;
}

// 0: not positive definite.
double condition_of(const SparseMatrix& part) {
  if (part.cols == 0) return 0;
  Options options;
  options.kind = Kind::llt;
  options.device = "cpu";
  options.threads = 1;
  options.permutation.resize(at(part.cols));
  std::iota(options.permutation.begin(), options.permutation.end(), 0);
  Solver solver(std::move(options));
  if (!solver.analyze(part).status.ok() || !solver.factorize(part).status.ok()) return 0;
  const ConditionResult condition = solver.condition_estimate();
  return condition.status.ok() ? condition.estimate : 0;
}

}  // namespace

double guess_condition(const System& system, const Values& values, const analysis::AssemblyTree& tree) {
  if (system.kind != Kind::llt || system.numbers() != base::Numbers::real || system.border || values.empty()) return 0;
  const SubTree large = largest_sub_tree(tree, {0, tree.n}, std::min(kLargest, tree.n / kShare));
  if (large.size() < kSmallest) return 0;
  const SubTree small = largest_sub_tree(tree, large, large.size() / 4);
  if (small.size() < kSmallest / 8) return 0;
  const std::span<const Index> order(tree.order);
  const auto condition = [&](SubTree part) {
    return condition_of(part_of(system.prepared.a, values, order.subspan(at(part.begin), at(part.size()))));
  };
  const double of_large = condition(large), of_small = condition(small);
  if (of_large <= 0 || of_small <= 0) return 0;
  const double growth = std::max(0.0, std::log(of_large / of_small) / std::log(double(large.size()) / small.size()));
  return of_large * std::pow(double(tree.n) / large.size(), growth);
}

bool is_too_ill_for_single(const System& system, const Values& values, const analysis::AssemblyTree& tree,
                           const Context& context) {
  // From a condition of 5e7 on, factors of FP32 do not tell a matrix from a singular one. Parts are held all round: for
  // plates and shells the guess is a tenth to a hundredth of it; solid bodies and Poisson's equation come to 1e4.
  constexpr double kTooIll = 1e7;
  const double condition = context.options.analyze_values ? guess_condition(system, values, tree) : 0;
  if (condition < kTooIll) return false;
  context.log(fmt::format("auto precision: parts of the matrix let expect a condition of {:.0e}; FP64", condition));
  return true;
}

}  // namespace espalier::solver
