// Truth: a dense matrix filled entry by entry from the definition of each storage.
#include "rivals/compressed.hpp"

#include <gtest/gtest.h>

#include <random>

#include "rivals/residual.hpp"

namespace espalier::bench {
namespace {

constexpr Index kSize = 17;

/// A random pattern with duplicates, unsorted rows, and some columns without a diagonal entry.
SparseMatrix random_matrix(Storage storage, unsigned seed) {
  std::mt19937 generator(seed);
  std::uniform_int_distribution<Index> row(0, kSize - 1);
  std::uniform_real_distribution<double> value(-1, 1);
  SparseMatrix a;
  a.rows = a.cols = kSize;
  a.storage = storage;
  a.col_ptr.push_back(0);
  for (Index column = 0; column < kSize; ++column) {
    for (int k = 0; k < 6; ++k) {
      const Index r = row(generator);
      if (storage == Storage::symmetric_lower && r < column) continue;
      if (storage == Storage::symmetric_upper && r > column) continue;
      a.row_ind.push_back(r);
      a.values.push_back(value(generator));
    }
    a.col_ptr.push_back(static_cast<Offset>(a.row_ind.size()));
  }
  return a;
}

using Dense = std::vector<std::vector<double>>;

Dense dense_of(const SparseMatrix& a) {
  Dense dense(kSize, std::vector<double>(kSize, 0));
  for (Index column = 0; column < kSize; ++column)
    for (Offset k = a.col_ptr[column]; k < a.col_ptr[column + 1]; ++k) {
      dense[a.row_ind[k]][column] += a.values[k];
      const bool one_triangle = a.storage == Storage::symmetric_lower || a.storage == Storage::symmetric_upper;
      if (one_triangle && a.row_ind[k] != column) dense[column][a.row_ind[k]] += a.values[k];
    }
  return dense;
}

class Compressed : public ::testing::TestWithParam<std::tuple<Storage, Shape, int>> {};

TEST_P(Compressed, HoldsTheEntriesOfItsShape) {
  const auto [storage, shape, base] = GetParam();
  const SparseMatrix a = random_matrix(storage, 7);
  const Dense dense = dense_of(a);
  CompressedMatrix compressed(a, shape, base);
  std::vector<double> twice = a.values;
  for (double& v : twice) v *= 2;
  compressed.fill(twice);
  Dense found(kSize, std::vector<double>(kSize, 0));
  for (Index major = 0; major < kSize; ++major) {
    Index last = -1;
    bool diagonal = false;
    for (Offset k = compressed.pointers[major] - base; k < compressed.pointers[major + 1] - base; ++k) {
      const Index minor = compressed.indices[k] - base;
      EXPECT_GT(minor, last) << "ascending and without duplicates";
      last = minor;
      diagonal |= minor == major;
      found[shape == Shape::full_by_row ? major : minor][shape == Shape::full_by_row ? minor : major] =
          compressed.values[k];
    }
    EXPECT_TRUE(diagonal) << "column " << major;
  }
  for (Index i = 0; i < kSize; ++i)
    for (Index j = 0; j < kSize; ++j) {
      const bool wanted = shape != Shape::lower_by_column || i >= j;
      EXPECT_NEAR(found[i][j], wanted ? 2 * dense[i][j] : 0, 1e-15) << i << ' ' << j;
    }
}

INSTANTIATE_TEST_SUITE_P(All, Compressed,
                         ::testing::Combine(::testing::Values(Storage::general, Storage::symmetric_lower,
                                                              Storage::symmetric_upper, Storage::symmetric_both),
                                            ::testing::Values(Shape::lower_by_column, Shape::full_by_column,
                                                              Shape::full_by_row),
                                            ::testing::Values(0, 1)));

// Truth: b - A x and |A| |x| + |b| by dense sums.
TEST(Residual, AgreesWithDenseSums) {
  for (const Storage storage : {Storage::general, Storage::symmetric_lower, Storage::symmetric_upper}) {
    const SparseMatrix a = random_matrix(storage, 11);
    const Dense dense = dense_of(a);
    std::vector<double> x(kSize), b(kSize);
    for (Index i = 0; i < kSize; ++i) x[i] = std::sin(i + 1.0), b[i] = std::cos(3.0 * i);
    double worst = 0, componentwise = 0, norm_a = 0, norm_x = 0, norm_b = 0;
    for (Index i = 0; i < kSize; ++i) {
      double residual = b[i], scale = std::abs(b[i]), row = 0;
      for (Index j = 0; j < kSize; ++j) {
        residual -= dense[i][j] * x[j];
        scale += std::abs(dense[i][j] * x[j]);
        row += std::abs(dense[i][j]);
      }
      worst = std::max(worst, std::abs(residual));
      componentwise = std::max(componentwise, std::abs(residual) / scale);
      norm_a = std::max(norm_a, row), norm_x = std::max(norm_x, std::abs(x[i])),
      norm_b = std::max(norm_b, std::abs(b[i]));
    }
    const BackwardError error = backward_error(a, false, x, b, 1);
    // Duplicates of opposite sign make the entrywise norm of the sparse sum larger: an upper bound of the dense one.
    EXPECT_LE(error.normwise, worst / (norm_a * norm_x + norm_b) * (1 + 1e-12));
    EXPECT_GE(error.normwise, 0.5 * worst / (norm_a * norm_x + norm_b));
    EXPECT_LE(error.componentwise, componentwise * (1 + 1e-12));
    EXPECT_GE(error.componentwise, 0.3 * componentwise);
  }
}

}  // namespace
}  // namespace espalier::bench
