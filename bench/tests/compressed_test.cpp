// Truth: a dense matrix filled entry by entry from the definition of each storage.
#include "rivals/compressed.hpp"

#include <gtest/gtest.h>

#include <cmath>
#include <complex>
#include <random>

#include "rivals/real_equivalent.hpp"

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
      if ((storage == Storage::symmetric_lower || storage == Storage::hermitian_lower) && r < column) continue;
      if ((storage == Storage::symmetric_upper || storage == Storage::hermitian_upper) && r > column) continue;
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
      const bool by_row = shape == Shape::full_by_row || shape == Shape::upper_by_row;
      found[by_row ? major : minor][by_row ? minor : major] = compressed.values[k];
    }
    EXPECT_TRUE(diagonal) << "column " << major;
  }
  for (Index i = 0; i < kSize; ++i)
    for (Index j = 0; j < kSize; ++j) {
      const bool wanted = shape == Shape::lower_by_column ? i >= j : shape != Shape::upper_by_row || i <= j;
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

using Complex = std::complex<double>;

/// The matrix that complex compressed arrays stand for, with its other half where they hold one.
std::vector<std::vector<Complex>> dense_of(const CompressedMatrix& a, Shape shape, bool hermitian) {
  const bool by_row = shape == Shape::full_by_row || shape == Shape::upper_by_row;
  const bool half = shape == Shape::lower_by_column || shape == Shape::upper_by_row;
  std::vector<std::vector<Complex>> dense(kSize, std::vector<Complex>(kSize));
  for (Index major = 0; major < kSize; ++major)
    for (Offset k = a.pointers[major]; k < a.pointers[major + 1]; ++k) {
      const Index row = by_row ? major : a.indices[k], column = by_row ? a.indices[k] : major;
      const Complex value(a.values[2 * k], a.values[2 * k + 1]);
      dense[row][column] = value;
      if (half && row != column) dense[column][row] = hermitian ? std::conj(value) : value;
    }
  return dense;
}

TEST(CompressedMatrix, HoldsComplexNumbersInEveryShape) {
  for (const Storage storage : {Storage::general, Storage::symmetric_lower, Storage::symmetric_upper,
                                Storage::hermitian_lower, Storage::hermitian_upper}) {
    const bool hermitian = storage >= Storage::hermitian_lower, general = storage == Storage::general;
    SparseMatrix a = random_matrix(storage, 11);
    std::vector<Complex> values;
    std::vector<std::vector<Complex>> dense(kSize, std::vector<Complex>(kSize));
    for (Index column = 0; column < kSize; ++column)
      for (Offset k = a.col_ptr[column]; k < a.col_ptr[column + 1]; ++k) {
        const Index row = a.row_ind[k];
        values.emplace_back(a.values[k], hermitian && row == column ? 0 : std::sin(1.0 + static_cast<double>(k)));
        dense[row][column] += values.back();
        if (!general && row != column) dense[column][row] += hermitian ? std::conj(values.back()) : values.back();
      }
    const auto* first = reinterpret_cast<const double*>(values.data());
    a.values.assign(first, first + 2 * values.size());
    const SystemView view(a, hermitian ? Numbers::hermitian : Numbers::complex);
    for (const Shape shape : {Shape::lower_by_column, Shape::upper_by_row, Shape::full_by_column, Shape::full_by_row}) {
      if (general && (shape == Shape::lower_by_column || shape == Shape::upper_by_row)) continue;
      const auto found = dense_of(CompressedMatrix(view, shape, 0), shape, hermitian);
      for (Index i = 0; i < kSize; ++i)
        for (Index j = 0; j < kSize; ++j)
          EXPECT_LE(std::abs(found[i][j] - dense[i][j]), 1e-15) << "storage " << static_cast<int>(storage) << " shape "
                                                                << static_cast<int>(shape) << ' ' << i << ' ' << j;
    }
    // The real equivalent maps (re, im) as the matrix maps numbers.
    RealEquivalent equivalent(view);
    const MatrixView real = equivalent.with_values(a.values);
    for (Index column = 0; column < kSize; ++column) {
      std::vector<Complex> image(kSize);  // of the unit vector times 2 - 3i
      for (int part = 0; part < 2; ++part)
        for (Offset k = real.col_ptr[2 * column + part]; k < real.col_ptr[2 * column + part + 1]; ++k) {
          const double product = real.values[k] * (part == 0 ? 2 : -3);
          image[real.row_ind[k] / 2] += real.row_ind[k] % 2 == 0 ? Complex(product, 0) : Complex(0, product);
        }
      for (Index i = 0; i < kSize; ++i) EXPECT_LE(std::abs(image[i] - dense[i][column] * Complex(2, -3)), 1e-14);
    }
  }
}

TEST(CompressedMatrix, TakesOverHermitianArraysWithTheirConjugates) {
  SparseMatrix a{2, 2, {0, 2, 3}, {0, 1, 1}, {1, 0, 2, 5, 3, 0}, Storage::hermitian_lower};
  const SystemView view(a, Numbers::hermitian);
  const CompressedMatrix lower(view, Shape::lower_by_column, 0), upper(view, Shape::upper_by_row, 0);
  EXPECT_EQ(lower.map_bytes() + upper.map_bytes(), 0);
  EXPECT_EQ(lower.values, a.values);
  EXPECT_EQ(upper.values, (std::vector<double>{1, -0.0, 2, -5, 3, -0.0}));
}

}  // namespace
}  // namespace espalier::bench
