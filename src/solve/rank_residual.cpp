#include "solve/rank_residual.hpp"

#include <new>
#include <vector>

namespace espalier::solve {

namespace {

// The first row of a rank's part.
Index first_row(Index rows, int rank, int ranks) { return static_cast<Index>(Offset{rows} * rank / ranks); }

// Where one rank alone has no room, it must not go another way than the others: that ends the call on all.
template <class Body>
void without_choice(const Body& body) {
  try {
    body();
  } catch (const Error& e) {
    if (e.status().code == StatusCode::out_of_memory) throw std::bad_alloc();
    throw;
  }
}

}  // namespace

RankResidual::RankResidual(const ResidualOperator& whole, ranks::Link& link, bool shared)
    : whole_(whole),
      link_(link),
      rows_(whole.rows()),
      shared_(shared),
      part_(whole.of_rows(first_row(rows_, link.rank(), link.size()), first_row(rows_, link.rank() + 1, link.size()))) {
}

RankResidual::Range RankResidual::range_of(int rank) const {
  const Offset parts = rows_ > 0 ? whole_.size() / rows_ : 1;  // doubles in a number
  const Index first = first_row(rows_, rank, link_.size());
  return {parts * first, parts * (first_row(rows_, rank + 1, link_.size()) - first)};
}

// The rows of the others.
void RankResidual::gather(std::span<double* const> vectors) const {
  const Range mine = range_of(link_.rank());
  std::vector<double> rows;
  rows.reserve(vectors.size() * static_cast<std::size_t>(mine.count));
  for (const double* v : vectors) rows.insert(rows.end(), v + mine.first, v + mine.first + mine.count);
  const auto all = link_.all_gather(std::as_bytes(std::span<const double>(rows)));
  for (int r = 0; r < link_.size(); ++r) {
    if (r == link_.rank()) continue;
    const Range range = range_of(r);
    const auto& bytes = all[static_cast<std::size_t>(r)];
    ranks::Reader reader(bytes.data(), bytes.size());
    for (double* v : vectors) reader.get(v + range.first, static_cast<std::size_t>(range.count));
  }
}

void RankResidual::compute(std::span<ResidualColumn> columns, bool transpose) const {
  if (!shared_) return without_choice([&] { whole_.compute(columns, transpose); });
  std::vector<RowErrors> errors(columns.size());
  without_choice([&] { part_.compute_rows(columns, errors, transpose); });
  const auto all = link_.all_gather_of(std::span<const RowErrors>(errors));
  std::vector<double*> residuals;
  for (std::size_t k = 0; k < columns.size(); ++k) {
    for (const std::vector<RowErrors>& others : all) errors[k].add(others.at(k));
    columns[k].error = whole_.judge(errors[k], transpose);
    if (columns[k].r != nullptr) residuals.push_back(columns[k].r);
  }
  if (!residuals.empty()) gather(residuals);
}

void RankResidual::multiply(const double* x, double* y, bool transpose) const {
  if (!shared_) return whole_.multiply(x, y, transpose);
  part_.multiply(x, y, transpose);
  gather(std::span<double* const>(&y, 1));
}

void RankResidual::multiply_columns(const double* x, double* y, Index columns, bool transpose) const {
  if (!shared_) return without_choice([&] { whole_.multiply_columns(x, y, columns, transpose); });
  without_choice([&] { part_.multiply_columns(x, y, columns, transpose); });
  std::vector<double*> products;
  for (Index k = 0; k < columns; ++k) products.push_back(y + Offset{k} * size());
  gather(products);
}

ResidualSpace::Vectors RankResidual::vectors(Index slot, Index columns) const {
  Vectors made;
  link_.expect_all([&] { made = whole_.vectors(slot, columns); });
  return made;
}

}  // namespace espalier::solve
