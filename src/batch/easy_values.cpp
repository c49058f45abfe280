#include "batch/easy_values.hpp"

#include <algorithm>
#include <vector>

#include "base/at.hpp"

namespace espalier::batch {

bool take_easy_values(const solver::PreparedMatrix& p, std::span<double> values) {
  std::fill(values.begin(), values.end(), 0.0);
  const auto scale = [](const std::vector<double>& factors, Index k) { return factors.empty() ? 1.0 : factors[at(k)]; };
  for (Index c = 0; c < p.n(); ++c) {
    const Index row = p.row_of(c);
    const auto first = p.a.row_ind.begin() + p.a.col_ptr[at(c)], last = p.a.row_ind.begin() + p.a.col_ptr[at(c) + 1];
    const auto place = std::find(first, last, row);
    if (place == last) {
      std::fill(values.begin(), values.end(), 0.0);
      return false;
    }
    values[static_cast<std::size_t>(place - p.a.row_ind.begin())] =
        1 / (scale(p.row_scale, row) * scale(p.col_scale, c));
  }
  return true;
}

}  // namespace espalier::batch
