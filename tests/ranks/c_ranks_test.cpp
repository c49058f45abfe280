// The C interface on ranks, here threads. The truth is the solver of one process: the same bits.
#include <gtest/gtest.h>

#include <complex>
#include <cstddef>
#include <functional>
#include <string>
#include <thread>
#include <vector>

#include "complex_system.hpp"
#include "espalier/complex_solver.hpp"
#include "espalier/espalier.h"
#include "espalier/espalier.hpp"
#include "espalier/ranks.h"
#include "matrix/generators/generate.hpp"
#include "ranks/thread_ranks.hpp"
#include "reference/reference.hpp"

namespace espalier::ranks {
namespace c_ranks_test {

// A symmetric matrix of which both triangles are stored, so that its columns are its rows.
SparseMatrix both_triangles() {
  const SparseMatrix lower =
      matrix::generate(matrix::parse_generator(std::vector<std::string>{"elasticity", "4", "4", "3"}));
  std::vector<reference::Triple> all;
  for (Index c = 0; c < lower.cols; ++c)
    for (auto k = static_cast<std::size_t>(lower.col_ptr[c]); k < static_cast<std::size_t>(lower.col_ptr[c + 1]); ++k) {
      all.push_back({lower.row_ind[k], c, lower.values[k]});
      if (lower.row_ind[k] != c) all.push_back({c, lower.row_ind[k], lower.values[k]});
    }
  return reference::from_triples(lower.rows, all, Storage::general);
}

TEST(CRanks, RowsVectorsAndNodes) {
  const SparseMatrix a = both_triangles();
  const Index n = a.rows;
  const std::vector<double> b = reference::random_vector(n, 5);
  Options options;
  options.kind = Kind::lu;
  options.device = "cpu";
  options.threads = 1;
  Solver alone(options);
  ASSERT_TRUE(alone.analyze(a).status.ok());
  ASSERT_TRUE(alone.factorize(a).status.ok());
  std::vector<double> truth(b.size());
  ASSERT_TRUE(alone.solve(b, truth).status.ok());

  const ThreadRanks shared(3);
  std::vector<std::thread> threads;
  std::vector<std::vector<double>> found(3);
  for (int r = 0; r < 3; ++r)
    threads.emplace_back([&, r] {
      const Index begin = n * r / 3, end = n * (r + 1) / 3;
      espalier_solver* s = nullptr;
      ASSERT_EQ(espalier_create(&s), ESPALIER_OK);
      for (const auto& [key, value] : {std::pair("device", "cpu"), {"threads", "1"}, {"kind", "lu"}})
        ASSERT_EQ(espalier_set_option(s, key, value), ESPALIER_OK);
      EXPECT_EQ(espalier_set_nodes(s, 1), ESPALIER_MISUSE) << "there are no ranks yet";
      const espalier_rank_functions table = shared.table(r);
      ASSERT_EQ(espalier_use_ranks(s, &table, 20), ESPALIER_OK);
      EXPECT_EQ(espalier_set_nodes(s, 2), ESPALIER_MISUSE);
      EXPECT_EQ(espalier_set_nodes(s, 1), ESPALIER_OK);
      std::vector<std::int64_t> pointers, indices;  // from 1 on
      const Offset first = a.col_ptr[static_cast<std::size_t>(begin)], last = a.col_ptr[static_cast<std::size_t>(end)];
      for (Index c = begin; c <= end; ++c) pointers.push_back(a.col_ptr[static_cast<std::size_t>(c)] - first + 1);
      for (Offset k = first; k < last; ++k) indices.push_back(a.row_ind[static_cast<std::size_t>(k)] + 1);
      espalier_local_rows_i64 part{};
      part.size = sizeof part;
      part.n = n;
      part.first_row = begin + 1;
      part.rows = end - begin;
      part.pointers = pointers.data();
      part.indices = indices.data();
      part.values = a.values.data() + first;
      part.storage = ESPALIER_GENERAL;
      part.index_base = 1;
      ASSERT_EQ(espalier_analyze_rows_i64(s, &part, nullptr), ESPALIER_OK) << espalier_last_error(s);
      EXPECT_EQ(espalier_set_nodes(s, 0), ESPALIER_MISUSE) << "there is a solver";
      ASSERT_EQ(espalier_refactorize(s, part.values, last - first, nullptr), ESPALIER_OK) << espalier_last_error(s);
      std::vector<double> x(b.begin() + begin, b.begin() + end);
      EXPECT_EQ(espalier_solve(s, x.data(), x.data(), 1, ESPALIER_NO_TRANSPOSE, nullptr), ESPALIER_OK);
      found[static_cast<std::size_t>(r)] = x;
      // All rows on rank 1.
      ASSERT_EQ(espalier_set_rows(s, 0, r == 1 ? n : 0), ESPALIER_OK);
      std::vector<double> all(r == 1 ? b : std::vector<double>());
      EXPECT_EQ(espalier_solve(s, all.data(), all.data(), 1, ESPALIER_NO_TRANSPOSE, nullptr), ESPALIER_OK);
      if (r == 1) {
        EXPECT_EQ(all, truth);
      }
      espalier_destroy(s);
    });
  for (std::thread& t : threads) t.join();
  std::vector<double> x;
  for (const auto& piece : found) x.insert(x.end(), piece.begin(), piece.end());
  EXPECT_EQ(x, truth);
}

// A solver on one of the ranks, and the rows of a matrix that this rank has: columns of one whose rows they are.
class COnRank {
 public:
  COnRank(const ThreadRanks& shared, int rank) {
    EXPECT_EQ(espalier_create(&s_), ESPALIER_OK);
    EXPECT_EQ(espalier_set_option(s_, "device", "cpu"), ESPALIER_OK);
    EXPECT_EQ(espalier_set_option(s_, "threads", "1"), ESPALIER_OK);
    const espalier_rank_functions table = shared.table(rank);
    EXPECT_EQ(espalier_use_ranks(s_, &table, 20), ESPALIER_OK);
  }
  COnRank(const COnRank&) = delete;
  COnRank& operator=(const COnRank&) = delete;
  ~COnRank() { espalier_destroy(s_); }
  operator espalier_solver*() const { return s_; }  // NOLINT(google-explicit-constructor): it is one
  [[nodiscard]] std::string error() const { return espalier_last_error(s_); }

 private:
  espalier_solver* s_ = nullptr;
};

struct CRows {
  template <class Matrix>
  CRows(const Matrix& a, Index begin, Index end) {
    const Offset first = a.col_ptr[static_cast<std::size_t>(begin)];
    for (Index c = begin; c <= end; ++c)
      pointers.push_back(static_cast<std::int32_t>(a.col_ptr[static_cast<std::size_t>(c)] - first));
    part.size = sizeof part;
    part.n = a.rows;
    part.first_row = begin;
    part.rows = end - begin;
    part.pointers = pointers.data();
    part.indices = a.row_ind.data() + first;
    part.values = reinterpret_cast<const double*>(a.values.data() + first);
  }
  [[nodiscard]] std::int64_t entries() const { return pointers.back(); }

  std::vector<std::int32_t> pointers;
  espalier_local_rows_i32 part{};
};

void on_each(int count, const std::function<void(int rank)>& body) {
  std::vector<std::thread> threads;
  for (int r = 0; r < count; ++r) threads.emplace_back([&, r] { body(r); });
  for (std::thread& t : threads) t.join();
}

// Rows of the upper triangle are columns of the lower one, which is the truth; of a Hermitian matrix it is the
// conjugate.
TEST(CRanks, ComplexNumbersAndSavedAnalyses) {
  const SparseMatrix real = reference::random_system(200, 4, reference::Values::indefinite, 1);
  const Index n = real.rows;
  const std::vector<double> parts = reference::random_vector(2 * Offset{n}, 5);
  std::vector<std::complex<double>> b(static_cast<std::size_t>(n));
  for (std::size_t k = 0; k < b.size(); ++k) b[k] = {parts[2 * k], parts[2 * k + 1]};
  for (const Storage storage : {Storage::symmetric_lower, Storage::hermitian_lower}) {
    const bool hermitian = storage == Storage::hermitian_lower;
    const ComplexSparseMatrix upper = complex_of(real, storage);
    ComplexSparseMatrix lower = upper;
    for (std::complex<double>& v : lower.values) v = hermitian ? std::conj(v) : v;
    Options options;
    options.device = "cpu";
    ComplexSolver alone(options);
    ASSERT_TRUE(alone.analyze(lower).status.ok());
    const ComplexFactorResult truth = alone.factorize(lower);
    ASSERT_TRUE(truth.status.ok());
    std::vector<std::complex<double>> x_truth(b.size()), x(b);
    ASSERT_TRUE(alone.solve(b, x_truth, 1, Transpose::conjugate).status.ok());
    const std::string path = testing::TempDir() + "espalier_c_ranks";
    const ThreadRanks shared(3);
    on_each(3, [&](int r) {
      const Index begin = n * r / 3, end = n * (r + 1) / 3;
      CRows rows(upper, begin, end);
      rows.part.storage = hermitian ? ESPALIER_HERMITIAN_UPPER : ESPALIER_SYMMETRIC_UPPER;
      rows.part.numbers = ESPALIER_COMPLEX;
      const COnRank solver(shared, r);
      ASSERT_EQ(espalier_analyze_rows_i32(solver, &rows.part, nullptr), ESPALIER_OK) << solver.error();
      ASSERT_EQ(espalier_save_analysis(solver, path.c_str()), ESPALIER_OK) << solver.error();
      ASSERT_EQ(espalier_load_analysis_rows_i32(solver, path.c_str(), &rows.part, nullptr), ESPALIER_OK)
          << solver.error();
      espalier_factor_info info{};
      info.size = sizeof info;
      ASSERT_EQ(espalier_refactorize(solver, rows.part.values, rows.entries(), &info), ESPALIER_OK) << solver.error();
      EXPECT_EQ(info.determinant_log, truth.determinant_log);
      auto* mine = reinterpret_cast<double*>(x.data() + begin);
      EXPECT_EQ(espalier_solve(solver, mine, mine, 1, ESPALIER_CONJUGATE_TRANSPOSE, nullptr), ESPALIER_OK);
    });
    EXPECT_EQ(x, x_truth);
  }
}

// A wrong argument of one rank is misuse there, and told at once to those that are in the call.
TEST(CRanks, WrongArgumentsOfOneRank) {
  const SparseMatrix a = both_triangles();
  const Index n = a.rows;
  const ThreadRanks shared(2);
  on_each(2, [&](int r) {
    const CRows rows(a, r == 0 ? 0 : n / 2, r == 0 ? n / 2 : n);
    const COnRank solver(shared, r);
    const bool wrong = r == 1;
    const auto expect_told = [&](int status, const std::string& words) {
      EXPECT_EQ(status, wrong ? ESPALIER_MISUSE : ESPALIER_INVALID_INPUT) << words;
      EXPECT_NE(solver.error().find(words), std::string::npos) << solver.error();
    };
    espalier_local_rows_i32 bad = rows.part;
    expect_told(espalier_analyze_rows_i32(solver, wrong ? nullptr : &bad, nullptr), "the part is null");
    if (wrong) bad.numbers = 7;
    expect_told(espalier_analyze_rows_i32(solver, &bad, nullptr), "numbers is none");
    bad = rows.part;
    if (wrong) bad.storage = ESPALIER_HERMITIAN_LOWER;
    expect_told(espalier_analyze_rows_i32(solver, &bad, nullptr), "only a complex matrix is Hermitian");
    expect_told(espalier_load_analysis_rows_i32(solver, wrong ? nullptr : "none", &rows.part, nullptr),
                "the path is null");
    // Real numbers on one, complex ones on the other: all are told the same.
    bad = rows.part;
    if (wrong) bad.numbers = ESPALIER_COMPLEX;
    bad.values = nullptr;
    EXPECT_EQ(espalier_analyze_rows_i32(solver, &bad, nullptr), ESPALIER_INVALID_INPUT);
    EXPECT_NE(solver.error().find("disagree about"), std::string::npos) << solver.error();

    ASSERT_EQ(espalier_analyze_rows_i32(solver, &rows.part, nullptr), ESPALIER_OK) << solver.error();
    const std::int64_t count = rows.entries();
    for (const bool factorized : {false, true}) {
      SCOPED_TRACE(factorized);
      EXPECT_EQ(espalier_refactorize(solver, rows.part.values, wrong ? count - 1 : count, nullptr),
                ESPALIER_INVALID_INPUT);
      EXPECT_NE(solver.error().find("entries of this rank's part"), std::string::npos) << solver.error();
      EXPECT_EQ(espalier_refactorize(solver, wrong ? nullptr : rows.part.values, count, nullptr),
                ESPALIER_INVALID_INPUT);
      ASSERT_EQ(espalier_refactorize(solver, rows.part.values, count, nullptr), ESPALIER_OK) << solver.error();
    }
    ASSERT_EQ(espalier_refactorize(solver, rows.part.values, count, nullptr), ESPALIER_OK) << solver.error();
    std::vector<double> x(static_cast<std::size_t>(rows.part.rows), 1.0);
    expect_told(espalier_solve(solver, wrong ? nullptr : x.data(), x.data(), 1, ESPALIER_NO_TRANSPOSE, nullptr),
                "null");
    double estimate = 0;
    expect_told(espalier_condition_estimate(solver, wrong ? nullptr : &estimate), "the place for the estimate is null");
    expect_told(espalier_save_analysis(solver, wrong ? nullptr : "none"), "the path is null");
    EXPECT_EQ(espalier_solve(solver, x.data(), x.data(), 1, ESPALIER_NO_TRANSPOSE, nullptr), ESPALIER_OK)
        << solver.error();
  });
}

// Pointers that fall end the reading of their array, however long it is said to be; so does a table of functions that
// is too short.
TEST(CRanks, NoMoreIsReadThanCanBe) {
  const ThreadRanks shared(1);
  const COnRank solver(shared, 0);
  const std::vector<std::int32_t> pointers = {0, 2, 1}, indices = {0, 0};
  espalier_local_rows_i32 part{};
  part.size = sizeof part;
  part.n = INT32_MAX;
  part.rows = std::int64_t{1} << 30;
  part.pointers = pointers.data();
  part.indices = indices.data();
  EXPECT_EQ(espalier_analyze_rows_i32(solver, &part, nullptr), ESPALIER_MISUSE);
  EXPECT_NE(solver.error().find("the pointers fall"), std::string::npos) << solver.error();
  const std::vector<std::size_t> short_table = {sizeof(std::size_t)};
  EXPECT_EQ(espalier_use_ranks(solver, reinterpret_cast<const espalier_rank_functions*>(short_table.data()), 20),
            ESPALIER_MISUSE);
}

// A program that was compiled before there were complex numbers.
TEST(CRanks, APartWithoutNumbersIsReal) {
  const SparseMatrix a = both_triangles();
  CRows rows(a, 0, a.rows);
  rows.part.size = offsetof(espalier_local_rows_i32, numbers);
  rows.part.numbers = 77;  // what stands behind it
  const ThreadRanks shared(1);
  const COnRank solver(shared, 0);
  EXPECT_EQ(espalier_analyze_rows_i32(solver, &rows.part, nullptr), ESPALIER_OK) << solver.error();
}

}  // namespace c_ranks_test
}  // namespace espalier::ranks
