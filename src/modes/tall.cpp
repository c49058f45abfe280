#include "modes/tall.hpp"

#include <limits>
#include <optional>
#include <vector>

#include "dense/dense.hpp"

namespace espalier::modes {

namespace {

// Rows of a range: a block of 8 columns of it stays in the first cache while the columns of the other factor go by.
constexpr std::int64_t kTallRows = 1024;

using Block = Eigen::Map<const Dense, 0, Eigen::OuterStride<>>;
using Target = Eigen::Map<Dense, 0, Eigen::OuterStride<>>;

Block rows_of(const double* v, Index n, Index columns, std::int64_t begin, std::int64_t end) {
  return {v + begin, end - begin, columns, Eigen::OuterStride<>(n)};
}

Target target_rows(double* v, Index n, Index columns, std::int64_t begin, std::int64_t end) {
  return {v + begin, end - begin, columns, Eigen::OuterStride<>(n)};
}

// The generator SplitMix64 (G. Steele, D. Lea, C. Flood, "Fast splittable pseudorandom number generators", 2014).
double random_at(std::uint64_t place) {
  std::uint64_t z = place * 0x9E3779B97F4A7C15ULL;
  z = (z ^ (z >> 30U)) * 0xBF58476D1CE4E5B9ULL;
  z = (z ^ (z >> 27U)) * 0x94D049BB133111EBULL;
  z ^= z >> 31U;
  return static_cast<double>(z >> 11U) * 0x1.0p-52 - 1;
}

// The sum of part(begin, end) over all ranges of rows: few partial sums, each of some ranges.
template <class AddRange>
Dense sum_of_ranges(base::ThreadPool& pool, Index n, Index rows, Index cols, const AddRange& part) {
  constexpr std::int64_t kMostSums = 16;
  const std::int64_t ranges = (n + kTallRows - 1) / kTallRows;
  const std::int64_t each = std::max<std::int64_t>(1, (ranges + kMostSums - 1) / kMostSums);
  std::vector<Dense> sums(static_cast<std::size_t>((ranges + each - 1) / each));
  pool.for_each_range(ranges, each, [&](std::int64_t first, std::int64_t last) {
    Dense sum = Dense::Zero(rows, cols);
    for (std::int64_t r = first; r < last; ++r)
      part(r * kTallRows, std::min<std::int64_t>(n, (r + 1) * kTallRows), sum);
    sums[static_cast<std::size_t>(first / each)] = std::move(sum);
  });
  Dense total = Dense::Zero(rows, cols);
  for (const Dense& sum : sums) total += sum;
  return total;
}

// S with S^T G S = I: L^-T of G = L L^T. Of columns that depend on each other G is not definite; its eigenvectors then
// give as many directions as there are, and rounding for the others, which the second pass makes orthonormal.
Dense to_orthonormal(const Dense& g) {
  if (const std::optional<Dense> l = dense::cholesky(g))
    return dense::solve_transposed_lower(*l, Dense::Identity(g.rows(), g.cols()));
  const dense::Spectrum eigen = dense::symmetric_eigen(g);
  const double least = std::numeric_limits<double>::epsilon() * eigen.values.cwiseAbs().maxCoeff();
  return eigen.vectors * eigen.values.cwiseMax(least).cwiseSqrt().cwiseInverse().asDiagonal();
}

}  // namespace

Dense gram(base::ThreadPool& pool, Index n, const double* v, Index p, const double* w, Index b) {
  return sum_of_ranges(pool, n, p, b, [&](std::int64_t begin, std::int64_t end, Dense& sum) {
    sum.noalias() += rows_of(v, n, p, begin, end).transpose() * rows_of(w, n, b, begin, end);
  });
}

Eigen::VectorXd weighted_squares(base::ThreadPool& pool, Index n, const double* d, const double* w, Index b) {
  return sum_of_ranges(pool, n, b, 1, [&](std::int64_t begin, std::int64_t end, Dense& sum) {
    sum += rows_of(w, n, b, begin, end).cwiseAbs2().transpose() * rows_of(d, n, 1, begin, end);
  });
}

void subtract(base::ThreadPool& pool, Index n, const double* v, const Dense& h, double* w) {
  if (h.size() == 0) return;
  pool.for_each_range(n, kTallRows, [&](std::int64_t begin, std::int64_t end) {
    target_rows(w, n, static_cast<Index>(h.cols()), begin, end).noalias() -=
        rows_of(v, n, static_cast<Index>(h.rows()), begin, end) * h;
  });
}

void combine(base::ThreadPool& pool, Index n, const double* v, const Dense& s, double* out) {
  if (s.cols() == 0) return;
  pool.for_each_range(n, kTallRows, [&](std::int64_t begin, std::int64_t end) {
    const Dense made = rows_of(v, n, static_cast<Index>(s.rows()), begin, end) * s;
    target_rows(out, n, static_cast<Index>(s.cols()), begin, end) = made;
  });
}

// By Cholesky, twice: once leaves eps times the square of the columns' condition (Y. Yamamoto, Y. Nakatsukasa, Y.
// Yanagisawa, T. Fukaya, "Roundoff error analysis of the CholeskyQR2 algorithm", ETNA 44, 2015).
void orthonormalize(base::ThreadPool& pool, const Apply& b, Tall& v, Tall& work) {
  const Index n = v.rows(), count = v.columns();
  Dense g(count, count);
  for (int pass = 0; pass < 2; ++pass) {
    for (Index c = 0; c < count; c += work.columns()) {
      const Index width = std::min(work.columns(), count - c);
      b(v.col(c), work.col(0), width);
      g.middleCols(c, width) = gram(pool, n, v.col(0), count, work.col(0), width);
    }
    const Dense to_q = to_orthonormal((g + g.transpose()) / 2);
    combine(pool, n, v.col(0), to_q, v.col(0));
  }
}

void randomize(base::ThreadPool& pool, Index n, double* w, Index b, std::uint64_t seed) {
  pool.for_each_range(n, kTallRows, [&](std::int64_t begin, std::int64_t end) {
    for (Index j = 0; j < b; ++j)
      for (std::int64_t i = begin; i < end; ++i)
        w[static_cast<std::int64_t>(n) * j + i] =
            random_at((seed << 40U) + static_cast<std::uint64_t>(i) * 4096U + static_cast<std::uint64_t>(j) + 1U);
  });
}

}  // namespace espalier::modes
