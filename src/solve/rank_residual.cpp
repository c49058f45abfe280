#include "solve/rank_residual.hpp"

#include <algorithm>
#include <new>
#include <vector>

namespace espalier::solve {

namespace {

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

OwnRows own_rows(Index rows, int rank, int ranks) {
  const auto begin = [&](int r) { return static_cast<Index>(Offset{rows} * r / ranks); };
  return {begin(rank), begin(rank + 1)};
}

RankResidual::RankResidual(const ResidualOperator& mine, ranks::Communicator& link, bool shared)
    : mine_(mine), link_(link), shared_(shared) {}

RankResidual::Range RankResidual::range_of(int rank) const {
  const Offset parts = mine_.rows() > 0 ? mine_.size() / mine_.rows() : 1;  // doubles in a number
  const OwnRows rows = own_rows(mine_.rows(), rank, link_.size());
  return {parts * rows.first, parts * (rows.end - rows.first)};
}

double RankResidual::norm(bool transpose) const {
  double most = mine_.norm(transpose);
  if (!shared_) return most;
  for (const auto& of_rank : link_.all_gather_of(std::span<const double>(&most, 1)))
    most = std::max(most, of_rank.at(0));
  return most;
}

// The rows of the others.
void RankResidual::gather_all(std::span<double* const> vectors) const {
  const Range mine = range_of(link_.rank());
  std::vector<double> rows;
  rows.reserve(vectors.size() * at(mine.count));
  for (const double* v : vectors) rows.insert(rows.end(), v + mine.first, v + mine.first + mine.count);
  const auto all = link_.all_gather(std::as_bytes(std::span<const double>(rows)));
  for (int r = 0; r < link_.size(); ++r) {
    if (r == link_.rank()) continue;
    const Range range = range_of(r);
    const auto& bytes = all[at(r)];
    ranks::Reader reader(bytes.data(), bytes.size());
    for (double* v : vectors) reader.get(v + range.first, at(range.count));
  }
}

void RankResidual::compute(std::span<ResidualColumn> columns, bool transpose) const {
  if (!shared_) return without_choice([&] { mine_.compute(columns, transpose); });
  struct RankErrors {
    RowErrors errors;
    double norm = 0;
  };
  std::vector<RowErrors> errors(columns.size());
  without_choice([&] { mine_.compute_rows(columns, errors, transpose); });
  std::vector<RankErrors> parts;
  for (const RowErrors& e : errors) parts.push_back({e, mine_.norm(transpose)});
  const auto all = link_.all_gather_of(std::span<const RankErrors>(parts));
  std::vector<double*> residuals;
  for (std::size_t k = 0; k < columns.size(); ++k) {
    RankErrors whole;
    for (const std::vector<RankErrors>& of_rank : all) {
      whole.errors.add(of_rank.at(k).errors);
      whole.norm = std::max(whole.norm, of_rank.at(k).norm);
    }
    columns[k].error = ResidualOperator::judge(whole.errors, whole.norm);
    if (columns[k].r != nullptr) residuals.push_back(columns[k].r);
  }
  if (!residuals.empty()) gather_all(residuals);
}

void RankResidual::multiply(const double* x, double* y, bool transpose) const {
  if (!shared_) return mine_.multiply(x, y, transpose);
  mine_.multiply(x, y, transpose);
  gather_all(std::span<double* const>(&y, 1));
}

void RankResidual::multiply_columns(const double* x, double* y, Index columns, bool transpose) const {
  if (!shared_) return without_choice([&] { mine_.multiply_columns(x, y, columns, transpose); });
  without_choice([&] { mine_.multiply_columns(x, y, columns, transpose); });
  std::vector<double*> products;
  for (Index k = 0; k < columns; ++k) products.push_back(y + Offset{k} * size());
  gather_all(products);
}

ResidualSpace::Vectors RankResidual::vectors(Index slot, Index columns) const {
  Vectors made;
  link_.expect_all([&] { made = mine_.vectors(slot, columns); });
  return made;
}

}  // namespace espalier::solve
