#include <algorithm>
#include <cmath>

#include "analysis/matching.hpp"

namespace espalier::analysis {

namespace {

// Ruiz (2001): the maxima converge to 1 linearly with the factor 1/2 in the exponent; three sweeps leave them within
// max^(1/8), a factor of 10 for entries that differ by 1e8, and powers of two do not resolve more than a factor 2.
constexpr int kSweeps = 3;
// Where the maxima of the last sweep were still further apart than that, more follow: 2^2000 needs ten.
constexpr int kMostSweeps = 14;
constexpr double kTooFar = 0x1p32;
constexpr double kMostScale = 0x1p1000;

void maxima(const MatrixView& a, const std::vector<double>& r, const std::vector<double>& c, std::vector<double>& rows,
            std::vector<double>& cols) {
  std::fill(rows.begin(), rows.end(), 0);
  std::fill(cols.begin(), cols.end(), 0);
  for (std::size_t j = 0; j < cols.size(); ++j) {
    double most = 0;
    for (Offset k = a.col_ptr[j]; k < a.col_ptr[j + 1]; ++k) {
      const auto i = static_cast<std::size_t>(a.row_ind[static_cast<std::size_t>(k)]);
      const double value = std::abs(a.values[static_cast<std::size_t>(k)]) * r[i] * c[j];
      most = std::max(most, value);
      rows[i] = std::max(rows[i], value);
    }
    cols[j] = most;
  }
  if (!a.symmetric()) return;
  for (std::size_t j = 0; j < cols.size(); ++j) rows[j] = cols[j] = std::max(rows[j], cols[j]);
}

void divide_by_root(std::vector<double>& scale, const std::vector<double>& most) {
  for (std::size_t i = 0; i < scale.size(); ++i)
    if (most[i] > 0) scale[i] = std::clamp(scale[i] / std::sqrt(most[i]), 1 / kMostScale, kMostScale);
}

bool any_far(const std::vector<double>& most) {
  return std::any_of(most.begin(), most.end(), [](double m) { return m > kTooFar || (m < 1 / kTooFar && m > 0); });
}

void round_to_powers_of_two(std::vector<double>& scale) {
  for (double& s : scale) s = std::exp2(std::round(std::log2(s)));
}

}  // namespace

Scaling equilibrate(const MatrixView& a) {
  Scaling out{std::vector<double>(static_cast<std::size_t>(a.rows), 1),
              std::vector<double>(static_cast<std::size_t>(a.cols), 1)};
  std::vector<double> rows(out.row.size()), cols(out.col.size());
  for (int sweep = 0; sweep < kSweeps || (sweep < kMostSweeps && (any_far(rows) || any_far(cols))); ++sweep) {
    maxima(a, out.row, out.col, rows, cols);
    divide_by_root(out.row, rows);
    divide_by_root(out.col, cols);
  }
  round_to_powers_of_two(out.row);
  round_to_powers_of_two(out.col);
  return out;
}

}  // namespace espalier::analysis
