#include "solver/analysis/border.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <numeric>

#include "analysis/border.hpp"
#include "base/at.hpp"

namespace espalier::solver {

namespace {

double inverse_power_of_two(double x) { return x > 0 ? std::ldexp(1.0, -std::ilogb(x)) : 1.0; }

}  // namespace

void add_border(analysis::AssemblyTree& tree, const Border& border, const PreparedMatrix& p) {
  std::vector<Index> position(at(tree.n)), column_of_row(at(tree.n));
  for (Index k = 0; k < tree.n; ++k) position[at(tree.order[at(k)])] = k;
  for (Index c = 0; c < tree.n; ++c) column_of_row[at(p.row_of(c))] = c;
  std::vector<analysis::BorderEntry> links;
  links.reserve(border.entries.size());
  for (const Border::Entry& e : border.entries)
    links.push_back({position[at(e.upper ? column_of_row[at(e.inner)] : e.inner)], e.border});
  analysis::add_border(tree, border.size, links);
}

BorderedPattern with_border(const PreparedMatrix& p, const Border& border) {
  const MatrixView a = p.a;
  const Index n = a.cols;
  BorderedPattern made;
  made.a.rows = made.a.cols = n + border.size;
  made.a.storage = a.storage;
  auto& ptr = made.a.col_ptr;
  ptr.assign(at(n + border.size) + 1, 0);
  for (Index c = 0; c < n; ++c) ptr[at(c) + 1] = a.col_ptr[at(c) + 1] - a.col_ptr[at(c)];
  const auto column = [&](const Border::Entry& e) { return at(e.upper ? n + e.border : e.inner); };
  for (const Border::Entry& e : border.entries) ++ptr[column(e) + 1];
  std::partial_sum(ptr.begin(), ptr.end(), ptr.begin());
  made.a.row_ind.resize(at(ptr.back()));
  made.source.resize(made.a.row_ind.size());
  std::vector<Offset> next(ptr.begin(), ptr.end() - 1);
  for (Index c = 0; c < n; ++c)
    for (Offset q = a.col_ptr[at(c)]; q < a.col_ptr[at(c) + 1]; ++q) {
      const Offset to = next[at(c)]++;
      made.a.row_ind[to] = a.row_ind[at(q)];
      made.source[at(to)] = q;
    }
  for (std::size_t k = 0; k < border.entries.size(); ++k) {
    const Border::Entry& e = border.entries[k];
    const Offset to = next[column(e)]++;
    made.a.row_ind[to] = e.upper ? e.inner : n + e.border;
    made.source[at(to)] = a.nonzeros() + static_cast<Offset>(k);
  }
  return made;
}

template <class T>
BorderScales scale_border(const Border& border, const Scales& of_matrix, std::span<const double> values, T* scaled) {
  std::vector<double> row(at(border.size), 0), col(at(border.size), 0);
  bool symmetric = true;
  const auto half_scaled = [&](std::size_t k) {
    const Border::Entry& e = border.entries[k];
    return values[k] * factor_of(e.upper ? of_matrix.row : of_matrix.col, e.inner);
  };
  for (std::size_t k = 0; k < border.entries.size(); ++k) {
    const Border::Entry& e = border.entries[k];
    symmetric = symmetric && !e.upper;
    double& most = (e.upper ? col : row)[at(e.border)];
    most = std::max(most, std::abs(half_scaled(k)));
  }
  for (auto* most : {&row, &col}) std::transform(most->begin(), most->end(), most->begin(), inverse_power_of_two);
  if (symmetric) col = row;
  for (std::size_t k = 0; k < border.entries.size(); ++k) {
    const Border::Entry& e = border.entries[k];
    const double value = half_scaled(k) * (e.upper ? col : row)[at(e.border)];
    if (!std::isfinite(value))
      throw Error(
          StatusCode::invalid_input,
          fmt::format("the entry between unknown {} of the rest and {} of the list is {}, or leaves the range of "
                      "numbers when it is scaled",
                      e.inner, e.border, values[k]));
    scaled[k] = static_cast<T>(value);
  }
  return {std::move(row), std::move(col)};
}

template BorderScales scale_border(const Border&, const Scales&, std::span<const double>, double*);
template BorderScales scale_border(const Border&, const Scales&, std::span<const double>, float*);

}  // namespace espalier::solver
