// The C interface on ranks, here threads. The truth is the solver of one process: the same bits.
#include <gtest/gtest.h>

#include <string>
#include <thread>
#include <vector>

#include "espalier/espalier.h"
#include "espalier/espalier.hpp"
#include "espalier/ranks.h"
#include "matrix/generators/generate.hpp"
#include "ranks/thread_ranks.hpp"
#include "reference/reference.hpp"

namespace espalier::ranks {
namespace {

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

}  // namespace
}  // namespace espalier::ranks
