// Truth: a dense matrix filled entry by entry from the definition of each storage.
#include "rivals/compressed.hpp"

#include <gtest/gtest.h>

#include <random>

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

TEST(CompressedMatrix, TakesOverWhatIsInShapeWithoutAMap) {
  SparseMatrix a = random_matrix(Storage::symmetric_lower, 3);
  CompressedMatrix sorted(a, Shape::lower_by_column, 0);
  EXPECT_GT(sorted.map_bytes(), 0);
  a.col_ptr = sorted.pointers;
  a.row_ind.assign(sorted.indices.begin(), sorted.indices.end());
  a.values = sorted.values;
  CompressedMatrix again(a, Shape::lower_by_column, 1);
  EXPECT_EQ(again.map_bytes(), 0);
  EXPECT_EQ(again.values, sorted.values);
  for (std::size_t k = 0; k < again.indices.size(); ++k) EXPECT_EQ(again.indices[k], sorted.indices[k] + 1);
  for (std::size_t k = 0; k < again.pointers.size(); ++k) EXPECT_EQ(again.pointers[k], sorted.pointers[k] + 1);
  again.fill(std::vector<double>(a.values.size(), 4));
  EXPECT_EQ(again.values, std::vector<double>(a.values.size(), 4));
}

INSTANTIATE_TEST_SUITE_P(All, Compressed,
                         ::testing::Combine(::testing::Values(Storage::general, Storage::symmetric_lower,
                                                              Storage::symmetric_upper, Storage::symmetric_both),
                                            ::testing::Values(Shape::lower_by_column, Shape::full_by_column,
                                                              Shape::full_by_row),
                                            ::testing::Values(0, 1)));

}  // namespace
}  // namespace espalier::bench
