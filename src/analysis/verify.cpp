#include "analysis/verify.hpp"

#include <fmt/format.h>

#include <algorithm>

#include "base/at.hpp"

namespace espalier::analysis {

namespace {

std::string check_shape(const Graph& g, const AssemblyTree& t) {
  if (t.n != g.n || t.order.size() != at(g.n)) return fmt::format("n is {}, the graph has {}", t.n, g.n);
  std::vector<char> seen(at(g.n), 0);
  for (const Index v : t.order) {
    if (v < 0 || v >= g.n || seen[at(v)] != 0) return fmt::format("order is no permutation: {}", v);
    seen[at(v)] = 1;
  }
  const std::size_t fronts = t.parent.size();
  if (fronts > at(g.n)) return fmt::format("{} fronts for {} unknowns", fronts, g.n);
  if (t.first.size() != fronts + 1 || t.row_ptr.size() != fronts + 1) return "array sizes do not fit";
  if (t.first.front() != 0 || t.first.back() != g.n) return "the fronts do not cover all positions";
  if (t.row_ptr.front() != 0 || t.row_ptr.back() != static_cast<Offset>(t.rows.size())) return "row_ptr does not fit";
  for (Index f = 0; f < t.fronts(); ++f) {
    if (t.first[at(f) + 1] <= t.first[at(f)]) return fmt::format("front {} has no pivots", f);
    if (t.row_ptr[at(f) + 1] < t.row_ptr[at(f)]) return fmt::format("front {}: row_ptr falls", f);
    const Index p = t.parent[at(f)];
    if (p != -1 && (p <= f || p >= t.fronts())) return fmt::format("front {} has the parent {}", f, p);
    if (p == -1 && t.row_ptr[at(f) + 1] != t.row_ptr[at(f)]) return fmt::format("the root {} has rows below", f);
  }
  return {};
}

/// Sub-trees contiguous: the children of f, last first, end where the next begins.
std::string check_postorder(const AssemblyTree& t) {
  std::vector<Index> lowest(at(t.fronts()));
  std::vector<Index> expected(at(t.fronts()));  // the next lower child of f must be this front
  for (Index f = 0; f < t.fronts(); ++f) lowest[at(f)] = f;
  for (Index f = 0; f < t.fronts(); ++f)
    if (const Index p = t.parent[at(f)]; p >= 0) lowest[at(p)] = std::min(lowest[at(p)], lowest[at(f)]);
  for (Index f = 0; f < t.fronts(); ++f) expected[at(f)] = f - 1;
  for (Index f = t.fronts() - 1; f >= 0; --f)
    if (const Index p = t.parent[at(f)]; p >= 0) {
      if (expected[at(p)] != f) return fmt::format("front {} below {} is out of postorder", f, p);
      expected[at(p)] = lowest[at(f)] - 1;
    }
  return {};
}

std::string check_rows(const AssemblyTree& t, Index f) {
  const auto begin = t.rows.begin() + t.row_ptr[at(f)], end = t.rows.begin() + t.row_ptr[at(f) + 1];
  const Index p = t.parent[at(f)];
  Index previous = t.first[at(f) + 1] - 1;
  for (auto r = begin; r != end; ++r) {
    if (*r <= previous || *r >= t.n) return fmt::format("the rows of front {} do not rise above its pivots", f);
    previous = *r;
    if (*r < t.first[at(p) + 1]) {
      if (*r < t.first[at(p)]) return fmt::format("row {} of front {} belongs to no ancestor", *r, f);
    } else if (!std::binary_search(t.rows.begin() + t.row_ptr[at(p)], t.rows.begin() + t.row_ptr[at(p) + 1], *r)) {
      return fmt::format("row {} of front {} is missing in its parent {}", *r, f, p);
    }
  }
  return {};
}

std::string check_edges(const Graph& g, const AssemblyTree& t) {
  std::vector<Index> position(at(g.n)), front(at(g.n));
  for (Index f = 0; f < t.fronts(); ++f)
    for (Index k = t.first[at(f)]; k < t.first[at(f) + 1]; ++k) {
      position[at(t.order[at(k)])] = k;
      front[at(k)] = f;
    }
  for (Index v = 0; v < g.n; ++v)
    for (const Index u : g.neighbours(v)) {
      const Index low = position[at(v)], high = position[at(u)];
      if (high < low) continue;
      const Index f = front[at(low)];
      if (front[at(high)] == f) continue;
      if (!std::binary_search(t.rows.begin() + t.row_ptr[at(f)], t.rows.begin() + t.row_ptr[at(f) + 1], high))
        return fmt::format("the entry ({}, {}) has no row in front {}", u, v, f);
    }
  return {};
}

}  // namespace

std::string verify_tree(const Graph& graph, const AssemblyTree& tree) {
  std::string wrong = check_shape(graph, tree);
  if (wrong.empty()) wrong = check_postorder(tree);
  for (Index f = 0; f < tree.fronts() && wrong.empty(); ++f) wrong = check_rows(tree, f);
  if (wrong.empty()) wrong = check_edges(graph, tree);
  return wrong;
}

}  // namespace espalier::analysis
