#include "solver/solution/substitution.hpp"

#include <cmath>
#include <complex>

#include "base/at.hpp"

namespace espalier::solver {

namespace {

double size_of(std::span<const double> values, Index parts, Offset q) {
  const auto at = static_cast<std::size_t>(parts * q);
  return parts == 1 ? std::abs(values[at]) : std::hypot(values[at], values[at + 1]);
}

}  // namespace

std::optional<Substitution> Substitution::find(const PreparedMatrix& prepared, std::span<const double> values,
                                               const matrix::RowIndex& rows) {
  const auto& a = prepared.a;
  const Index parts = base::parts_of(prepared.numbers);
  Substitution found(prepared, values);
  std::vector<Index> open(at(a.cols), 0);  // entries of a column in rows that have no pivot yet
  std::vector<char> taken(at(a.rows), 0);
  for (Index c = 0; c < a.cols; ++c)
    for (Offset q = a.col_ptr[c]; q < a.col_ptr[c + 1]; ++q) open[at(c)] += size_of(values, parts, q) > 0 ? 1 : 0;
  std::vector<Index> ready;
  for (Index c = 0; c < a.cols; ++c)
    if (open[at(c)] == 1) ready.push_back(c);
  while (!ready.empty()) {
    const Index c = ready.back();
    ready.pop_back();
    if (open[at(c)] != 1) continue;
    Offset q = a.col_ptr[c];
    while (taken[at(a.row_ind[q])] != 0 || !(size_of(values, parts, q) > 0)) ++q;
    if (!std::isfinite(size_of(values, parts, q))) return {};
    const Index r = a.row_ind[q];
    found.pivots_.push_back({r, c, q});
    taken[at(r)] = 1;
    for (Offset k = rows.ptr[at(r)]; k < rows.ptr[at(r) + 1]; ++k) {
      const Index other = rows.col[k];
      if (size_of(values, parts, rows.source[k]) > 0 && --open[at(other)] == 1) ready.push_back(other);
    }
  }
  if (found.pivots_.size() != at(a.cols)) return {};
  return found;
}

template <class Value>
void Substitution::solve_column(const Value* b, Value* x, bool transpose) const {
  const auto& a = prepared_->a;
  const auto* values = reinterpret_cast<const Value*>(values_.data());
  std::vector<Value> left(b, b + a.cols);
  const auto others = [&](const Pivot& p, auto&& use) {
    for (Offset q = a.col_ptr[p.col]; q < a.col_ptr[p.col + 1]; ++q)
      if (q != p.entry && values[q] != Value(0)) use(a.row_ind[q], values[q]);
  };
  if (transpose) {
    for (const Pivot& p : pivots_) {
      Value sum = left[at(p.col)];
      others(p, [&](Index row, Value v) { sum -= v * x[row]; });
      x[p.row] = sum / values[p.entry];
    }
    return;
  }
  for (auto p = pivots_.rbegin(); p != pivots_.rend(); ++p) {
    const Value solved = left[at(p->row)] / values[p->entry];
    others(*p, [&](Index row, Value v) { left[at(row)] -= v * solved; });
    x[p->col] = solved;
  }
}

void Substitution::solve(const double* b, double* x, Index columns, bool transpose) const {
  const Offset doubles = Offset{base::parts_of(prepared_->numbers)} * prepared_->n();
  for (Index c = 0; c < columns; ++c, b += doubles, x += doubles) {
    if (prepared_->numbers == base::Numbers::real)
      solve_column(b, x, transpose);
    else
      solve_column(base::as_complex(b), base::as_complex(x), transpose);
  }
}

}  // namespace espalier::solver
