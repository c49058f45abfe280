#include "schur/partition.hpp"

#include <fmt/format.h>

#include <utility>

#include "base/at.hpp"

namespace espalier::schur {

Partition::Partition(const MatrixView& a, std::span<const Index> unknowns, bool unsymmetric)
    : unsymmetric_(unsymmetric) {
  take_list(unknowns, a.cols);
  split(a);
}

void Partition::take_list(std::span<const Index> unknowns, Index n) {
  if (unknowns.empty())
    throw Error(StatusCode::invalid_input, "the list of unknowns is empty; a Schur complement needs at least one");
  constexpr Index kFree = -1;
  place_.assign(at(n), kFree);
  for (std::size_t k = 0; k < unknowns.size(); ++k) {
    const Index v = unknowns[k];
    if (v < 0 || v >= n)
      throw Error(StatusCode::invalid_input,
                  fmt::format("entry {} of the list of unknowns is {}; they run from 0 to {}", k, v, n - 1), v);
    if (place_[at(v)] != kFree)
      throw Error(
          StatusCode::invalid_input,
          fmt::format("unknown {} stands twice in the list, as entries {} and {}; give each once", v, place_[at(v)], k),
          v);
    place_[at(v)] = static_cast<Index>(k);
  }
  unknowns_.assign(unknowns.begin(), unknowns.end());
  for (Index v = 0; v < n; ++v)
    if (place_[at(v)] == kFree) {
      place_[at(v)] = ~static_cast<Index>(rest_.size());
      rest_.push_back(v);
    }
}

// Numbers of the rest rise like those of A, so that a triangle stays a triangle.
void Partition::split(const MatrixView& a) {
  solver::Border border;
  border.size = size();
  matrix_.rows = matrix_.cols = static_cast<Index>(rest_.size());
  matrix_.storage = a.storage;
  matrix_.col_ptr.push_back(0);
  const bool one_triangle = a.storage == Storage::symmetric_lower || a.storage == Storage::symmetric_upper;
  for (Index c = 0; c < a.cols; ++c) {
    const Index col = place_[at(c)];
    for (Offset q = a.col_ptr[at(c)]; q < a.col_ptr[at(c) + 1]; ++q) {
      const Index row = place_[at(a.row_ind[at(q)])];
      if (row < 0 && col < 0) {
        matrix_.row_ind.push_back(~row);
        matrix_source_.push_back(q);
      } else if (row >= 0 && col >= 0) {
        listed_.push_back({row, col, q});
        if (one_triangle && row != col) listed_.push_back({col, row, q});
      } else {
        add_coupling(a, row, col, q, border);
      }
    }
    if (col < 0) matrix_.col_ptr.push_back(static_cast<Offset>(matrix_.row_ind.size()));
  }
  border_ = std::make_shared<const solver::Border>(std::move(border));
}

void Partition::add_coupling(const MatrixView& a, Index row, Index col, Offset source, solver::Border& border) {
  const bool lower = row >= 0;  // of A_sr
  const solver::Border::Entry entry{lower ? ~col : ~row, lower ? row : col, !lower};
  const auto add = [&](bool upper) {
    border.entries.push_back({entry.inner, entry.border, upper});
    border_source_.push_back(source);
  };
  const bool both_stored = a.storage == Storage::general || a.storage == Storage::symmetric_both;
  if (unsymmetric_) {
    add(entry.upper);
    if (!both_stored) add(!entry.upper);
  } else if (lower || !both_stored) {
    add(false);
  }
}

std::vector<Index> Partition::rest_of(std::span<const Index> order) const {
  std::vector<Index> rest;
  for (const Index v : order)
    if (v < 0 || v >= n())
      rest.push_back(v);  // for whoever checks the order
    else if (place_[at(v)] < 0)
      rest.push_back(~place_[at(v)]);
  return rest;
}

std::vector<double> Partition::pick(const std::vector<Offset>& source, std::span<const double> values) {
  std::vector<double> picked(source.size());
  for (std::size_t k = 0; k < source.size(); ++k) picked[k] = values[at(source[k])];
  return picked;
}

void Partition::add_listed(std::span<const double> values, std::span<double> s) const {
  for (const Listed& e : listed_) s[at(e.col) * at(size()) + at(e.row)] += values[at(e.source)];
}

// Entries of A_sr (lower) or A_rs of op(A): use(number, inner, border).
template <class Use>
void Partition::visit_coupling(bool lower, bool transpose, Use&& use) const {
  const auto& entries = border_->entries;
  for (std::size_t k = 0; k < entries.size(); ++k)
    if (!unsymmetric_ || entries[k].upper == (lower == transpose)) use(k, entries[k].inner, entries[k].border);
}

void Partition::subtract_lower(std::span<const double> coupling, const double* x, double* y, bool transpose) const {
  visit_coupling(true, transpose,
                 [&](std::size_t k, Index inner, Index border) { y[border] -= coupling[k] * x[inner]; });
}

void Partition::subtract_upper(std::span<const double> coupling, const double* x, double* y, bool transpose) const {
  visit_coupling(false, transpose,
                 [&](std::size_t k, Index inner, Index border) { y[inner] -= coupling[k] * x[border]; });
}

}  // namespace espalier::schur
