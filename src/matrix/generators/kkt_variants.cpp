#include <algorithm>
#include <cmath>

#include "matrix/generators/families.hpp"
#include "matrix/transform.hpp"
#include "matrix/triplets.hpp"

namespace espalier::matrix {

namespace {

constexpr int kLargestPower = 20;  // 2^-20 .. 2^20: 12 decades

int power_of(std::uint64_t seed, Index unknown) {
  const auto draw = random_below(seed, static_cast<std::uint64_t>(unknown), 2 * kLargestPower + 1);
  return static_cast<int>(draw) - kLargestPower;
}

double weight(std::uint64_t bits) {
  constexpr double kWeights[] = {0.5, 1, 2, -0.5, -1, -2};
  return kWeights[bits % 6];
}

}  // namespace

void scale_badly(SparseMatrix& a, std::uint64_t seed) {
  for (Index j = 0; j < a.cols; ++j)
    for (Offset p = a.col_ptr[at(j)]; p < a.col_ptr[at(j) + 1]; ++p) {
      double& v = a.values[at(p)];
      v = std::ldexp(v, power_of(seed, j) + power_of(seed, a.row_ind[at(p)]));
    }
}

SparseMatrix append_redundant_rows(const SparseMatrix& a, Index constraints, Index redundant, std::uint64_t seed) {
  std::vector<Index> row(a.row_ind), col(a.row_ind.size());
  std::vector<double> value(a.values);
  for (Index j = 0; j < a.cols; ++j) std::fill(col.begin() + a.col_ptr[at(j)], col.begin() + a.col_ptr[at(j) + 1], j);
  const SparseMatrix by_rows = transpose(a);
  const auto count = static_cast<std::uint64_t>(constraints);
  for (Index r = 0; r < redundant; ++r) {
    const auto draw = static_cast<std::uint64_t>(r) * 4;
    const std::uint64_t p = random_below(seed, draw, count);
    const std::uint64_t q = (p + 1 + random_below(seed, draw + 1, count - 1)) % count;  // another one
    const double weights[] = {weight(random_bits(seed, draw + 2)), weight(random_bits(seed, draw + 3))};
    const std::uint64_t rows[] = {p, q};
    for (int part = 0; part < 2; ++part) {
      const std::size_t source = at(a.rows - constraints) + rows[part];
      for (Offset k = by_rows.col_ptr[source]; k < by_rows.col_ptr[source + 1]; ++k) {
        row.push_back(a.rows + r);
        col.push_back(by_rows.row_ind[at(k)]);
        value.push_back(weights[part] * by_rows.values[at(k)]);
      }
    }
  }
  const Index n = a.rows + redundant;
  return to_csc({n, n, row, col, value, Storage::symmetric_lower});
}

}  // namespace espalier::matrix
