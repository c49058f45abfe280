#include "common/host_pattern.hpp"

#include <algorithm>
#include <numeric>

namespace espalier::hosts {

HostPattern HostPattern::from_columns(int n, const int* pointers, const int* rows, int base, bool clean) {
  HostPattern p;
  p.given_ = pointers[n] - base;
  p.pointers_.reserve(static_cast<std::size_t>(n) + 1);
  p.rows_.reserve(static_cast<std::size_t>(p.given_));
  p.pointers_.push_back(0);
  if (clean) p.place_.reserve(static_cast<std::size_t>(p.given_));
  for (int column = 0; column < n; ++column) {
    for (int k = pointers[column] - base; k < pointers[column + 1] - base; ++k) {
      const std::int64_t row = std::int64_t{rows[k]} - base;  // any number
      const bool belongs = row >= column && row < n;
      if (clean) p.place_.push_back(belongs ? static_cast<int>(p.rows_.size()) : -1);
      if (belongs || !clean) p.rows_.push_back(rows[k] < base ? -1 : rows[k] - base);
    }
    p.pointers_.push_back(static_cast<int>(p.rows_.size()));
  }
  if (p.left_out() == 0) p.place_.clear();
  return p;
}

HostPattern HostPattern::from_coordinates(int n, int count, const int* rows, const int* columns, bool symmetric) {
  HostPattern p;
  p.symmetric_ = symmetric;
  p.given_ = count;
  p.pointers_.assign(static_cast<std::size_t>(n) + 1, 0);
  p.place_.assign(static_cast<std::size_t>(count), -1);
  const auto inside = [&](int k) { return rows[k] >= 1 && rows[k] <= n && columns[k] >= 1 && columns[k] <= n; };
  for (int k = 0; k < count; ++k)
    if (inside(k)) ++p.pointers_[static_cast<std::size_t>(symmetric ? std::min(rows[k], columns[k]) : columns[k])];
  std::partial_sum(p.pointers_.begin(), p.pointers_.end(), p.pointers_.begin());
  p.rows_.resize(static_cast<std::size_t>(p.pointers_.back()));
  std::vector<int> next(p.pointers_.begin(), p.pointers_.end() - 1);
  for (int k = 0; k < count; ++k) {
    if (!inside(k)) continue;
    const bool flip = symmetric && rows[k] < columns[k];
    const int column = flip ? rows[k] : columns[k], row = flip ? columns[k] : rows[k];
    const int place = next[static_cast<std::size_t>(column - 1)]++;
    p.rows_[static_cast<std::size_t>(place)] = row - 1;
    p.place_[static_cast<std::size_t>(k)] = place;
  }
  return p;
}

espalier_matrix_i32 HostPattern::matrix(const double* values) const {
  espalier_matrix_i32 a{};
  a.size = sizeof a;
  a.rows = a.cols = n();
  a.nonzeros = entries();
  a.pointers = pointers_.data();
  a.indices = rows_.data();
  a.values = values;
  a.layout = ESPALIER_CSC;
  a.storage = symmetric_ ? ESPALIER_SYMMETRIC_LOWER : ESPALIER_GENERAL;
  return a;
}

const double* HostPattern::gather(const double* given, std::vector<double>& buffer) const {
  if (place_.empty()) return given;
  buffer.resize(rows_.size());
  for (std::size_t k = 0; k < place_.size(); ++k)
    if (place_[k] >= 0) buffer[static_cast<std::size_t>(place_[k])] = given[k];
  return buffer.data();
}

std::int64_t HostPattern::bytes() const {
  return static_cast<std::int64_t>((pointers_.size() + rows_.size() + place_.size()) * sizeof(int));
}

}  // namespace espalier::hosts
