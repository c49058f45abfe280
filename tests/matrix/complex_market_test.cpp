// Complex Matrix Market files. Truth: entries written by hand, and files that are written and read back.
#include <gtest/gtest.h>

#include <random>

#include "matrix/matrix_market.hpp"
#include "matrix/read.hpp"

namespace espalier::matrix {
namespace complex_market_test {

using Value = std::complex<double>;

ComplexSparseMatrix parse(const std::string& text) { return parse_complex_matrix_market(text, "t.mtx"); }

void expect_error(const std::string& text, const std::vector<std::string>& words) {
  try {
    (void)parse(text);
    ADD_FAILURE() << "accepted: " << text;
  } catch (const Error& e) {
    EXPECT_EQ(e.status().code, StatusCode::invalid_input);
    for (const std::string& word : words) EXPECT_NE(std::string(e.what()).find(word), std::string::npos) << e.what();
  }
}

TEST(ComplexMarket, ReadsEverySymmetry) {
  const ComplexSparseMatrix general =
      parse("%%MatrixMarket matrix coordinate complex general\n2 2 3\n1 1 1 2\n2 1 3 -4\n1 2 5 0\n");
  EXPECT_EQ(general.storage, Storage::general);
  EXPECT_EQ(general.values, (std::vector<Value>{{1, 2}, {3, -4}, {5, 0}}));
  const ComplexSparseMatrix symmetric =
      parse("%%MatrixMarket matrix coordinate complex symmetric\n2 2 2\n1 1 1 2\n1 2 3 4\n");
  EXPECT_EQ(symmetric.storage, Storage::symmetric_lower);
  EXPECT_EQ(symmetric.values, (std::vector<Value>{{1, 2}, {3, 4}}));
  const ComplexSparseMatrix hermitian =
      parse("%%MatrixMarket matrix coordinate complex hermitian\n2 2 2\n1 1 1 0\n1 2 3 4\n");
  EXPECT_EQ(hermitian.storage, Storage::hermitian_lower);
  EXPECT_EQ(hermitian.values, (std::vector<Value>{{1, 0}, {3, -4}}));  // of the lower triangle
  const ComplexSparseMatrix skew = parse("%%MatrixMarket matrix coordinate complex skew-symmetric\n2 2 1\n2 1 3 4\n");
  EXPECT_EQ(skew.storage, Storage::general);
  EXPECT_EQ(skew.values, (std::vector<Value>{{3, 4}, {-3, -4}}));
  const ComplexSparseMatrix array = parse("%%MatrixMarket matrix array complex hermitian\n2 2\n1 0\n3 4\n5 0\n");
  EXPECT_EQ(array.storage, Storage::hermitian_lower);
  EXPECT_EQ(array.values, (std::vector<Value>{{1, 0}, {3, 4}, {5, 0}}));
  const ComplexSparseMatrix both =
      parse("%%MatrixMarket matrix coordinate complex hermitian\n2 2 3\n1 1 1 0\n1 2 3 4\n2 1 3 -4\n");
  EXPECT_EQ(both.values, (std::vector<Value>{{1, 0}, {3, -4}}));
  const ComplexSparseMatrix real = parse("%%MatrixMarket matrix coordinate real general\n1 1 1\n1 1 7\n");
  EXPECT_EQ(real.values, (std::vector<Value>{{7, 0}}));
}

TEST(ComplexMarket, RefusesWithTheLine) {
  expect_error("%%MatrixMarket matrix coordinate complex hermitian\n2 2 2\n1 1 1 0\n2 2 1 1e-9\n",
               {"t.mtx:4:", "hermitian", "(2, 2)"});
  expect_error("%%MatrixMarket matrix array complex hermitian\n1 1\n1 1\n", {"hermitian", "(1, 1)"});
  expect_error("%%MatrixMarket matrix coordinate complex hermitian\n2 2 2\n1 2 3 4\n2 1 3 4\n", {"t.mtx:3:", "mirror"});
  expect_error("%%MatrixMarket matrix coordinate complex general\n1 1 1\n1 1 1\n", {"t.mtx:3:", "value"});
  expect_error("%%MatrixMarket matrix coordinate complex general\n1 1 1\n1 1 1 nan\n", {"t.mtx:3:"});
  expect_error("%%MatrixMarket matrix coordinate complex general\n1 1 1\n1 1 inf 1\n", {"t.mtx:3:"});
  expect_error("%%MatrixMarket matrix coordinate real hermitian\n1 1 1\n1 1 1\n", {"t.mtx:1:", "symmetric"});
  expect_error("%%MatrixMarket matrix array complex general\n2 1\n1.25 1.25\n2.125\n", {"3 of the 4"});
}

TEST(ComplexMarket, WritesWhatItReads) {
  std::mt19937 random(1);
  std::normal_distribution<double> normal;
  for (const Storage storage :
       {Storage::general, Storage::symmetric_lower, Storage::hermitian_lower, Storage::hermitian_upper}) {
    ComplexSparseMatrix a{3, 3, {0, 1, 2, 4}, {0, 1, 0, 2}, {}, storage};
    if (storage != Storage::general && storage != Storage::hermitian_upper)
      a = {3, 3, {0, 2, 3, 4}, {0, 2, 1, 2}, {}, storage};
    for (std::size_t q = 0; q < 4; ++q)
      a.values.emplace_back(normal(random), q == (a.row_ind[1] == 2 ? 1U : 2U) ? normal(random) : 0);
    const std::string path = ::testing::TempDir() + "complex_market.mtx";
    write_matrix_market(path, a);
    const AnyMatrix any = read_any_matrix(path);
    const auto* back = std::get_if<ComplexSparseMatrix>(&any);
    ASSERT_NE(back, nullptr);
    if (storage == Storage::hermitian_upper) {  // comes back as the other triangle
      EXPECT_EQ(back->storage, Storage::hermitian_lower);
      EXPECT_EQ(back->values, (std::vector<Value>{a.values[0], std::conj(a.values[2]), a.values[1], a.values[3]}));
    } else {
      EXPECT_EQ(back->storage, storage);
      EXPECT_EQ(back->values, a.values);
    }
    EXPECT_THROW((void)read_matrix(path), Error);
    write_matrix_market_vectors(path, 2, 2, std::span<const Value>(a.values));
    const ComplexVectors v = read_complex_vectors(path);
    EXPECT_EQ(v.values, a.values);
    EXPECT_TRUE(std::holds_alternative<ComplexVectors>(read_any_vectors(path)));
  }
}

}  // namespace complex_market_test
}  // namespace espalier::matrix
