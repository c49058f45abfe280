#include "changes/base.hpp"

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <numeric>
#include <utility>

#include "base/at.hpp"

namespace espalier::changes {

Base::Base(solver::Session& session, std::vector<char> alive) : session_(&session), alive_(std::move(alive)) {}

Index Base::dead() const { return static_cast<Index>(std::count(alive_.begin(), alive_.end(), 0)); }

double Base::entry(Index row, Index column) const {
  double found = 0;
  for_each_in_column(column, [&](Index r, double v) { found += r == row ? v : 0; });
  return found;
}

const std::vector<double>& Base::row_sums(bool turned) {
  std::vector<double>& made = row_sums_[turned ? 1 : 0];
  if (!made.empty() || order() == 0) return made;
  (void)values();  // from a device, if they are there alone
  std::vector<double> sums(at(order()), 0.0);
  session_->pool.for_each_range(order(), 1024, [&](std::int64_t begin, std::int64_t end) {
    for (auto i = begin; i < end; ++i)
      for_each_in_row(static_cast<Index>(i), turned,
                      [&](Index, double v) { sums[static_cast<std::size_t>(i)] += std::abs(v); });
  });
  made = std::move(sums);
  return made;
}

const std::vector<Index>& Base::largest_rows(bool turned) {
  constexpr std::size_t kMost = 8192;
  std::vector<Index>& made = largest_rows_[turned ? 1 : 0];
  if (!made.empty()) return made;
  const std::vector<double>& sums = row_sums(turned);
  std::vector<Index> rows(at(order()));
  std::iota(rows.begin(), rows.end(), 0);
  const auto first = [&](Index a, Index b) { return sums[at(a)] != sums[at(b)] ? sums[at(a)] > sums[at(b)] : a < b; };
  if (rows.size() > kMost) {
    std::nth_element(rows.begin(), rows.begin() + kMost, rows.end(), first);
    rows.resize(kMost);
  }
  std::sort(rows.begin(), rows.end(), first);
  made = std::move(rows);
  return made;
}

const device::ResidualSpace& Base::space() const {
  if (const device::DeviceLinearSystem* d = device(); d != nullptr) return *d;
  return session_->factor->residual();
}

double* Base::vectors(Index slot, Index columns) {
  if (!on_host()) return device()->vectors(slot, columns).data;
  if (slots_.size() <= at(slot)) slots_.resize(at(slot) + 1);
  slots_[at(slot)].resize(at(order()) * at(columns));
  return slots_[at(slot)].data();
}

void Base::send(double* to, const double* from, Index columns) const {
  const Offset count = Offset{order()} * columns;
  if (on_host())
    std::copy_n(from, count, to);
  else
    device()->send(to, from, count);
}

void Base::fetch(double* to, const double* from, Index columns) const {
  const Offset count = Offset{order()} * columns;
  if (on_host())
    std::copy_n(from, count, to);
  else
    device()->fetch(to, from, count);
}

void Base::substitute(const double* b, double* x, Index columns, bool turned) {
  if (on_host())
    session_->factor->solve(b, x, columns, turned);
  else
    device()->substitute(b, x, columns, turned);
}

}  // namespace espalier::changes
