// Residuals and products whose rows ranks share, and refinement with them. The truth is one process: the same bits.
#include <gtest/gtest.h>

#include <complex>
#include <cstring>
#include <string>
#include <vector>

#include "matrix/generators/generate.hpp"
#include "on_threads.hpp"
#include "reference/reference.hpp"
#include "solve/rank_residual.hpp"
#include "solve/refinement.hpp"
#include "solver/ranks/on_all_ranks.hpp"

namespace espalier::ranks {
namespace residual_ranks_test {

using reference::random_vector;
using reference::Values;

// What is computed with one operator.
struct Found {
  std::vector<double> numbers;
  void add(const std::vector<double>& v) { numbers.insert(numbers.end(), v.begin(), v.end()); }
};

constexpr Index kColumns = 9;  // full passes, and a rest

Found all_of(const solve::ResidualSpace& a, bool transpose) {
  const auto n = static_cast<std::size_t>(a.size());
  const std::vector<double> x = random_vector(Offset{kColumns} * a.size(), 2);
  const std::vector<double> b = random_vector(Offset{kColumns} * a.size(), 3);
  std::vector<double> r(x.size(), 0.0), y(x.size()), z(n);
  std::vector<solve::ResidualColumn> columns;
  for (std::size_t k = 0; k < kColumns; ++k)
    columns.push_back({&b[k * n], &x[k * n], k == 2 ? nullptr : &r[k * n], {}});
  a.compute(columns, transpose);
  a.multiply_columns(x.data(), y.data(), kColumns, transpose);
  a.multiply(b.data(), z.data(), transpose);
  Found found;
  found.add(r);
  found.add(y);
  found.add(z);
  for (const auto& c : columns) found.add({c.error.normwise, c.error.componentwise});
  found.add({a.dot(x.data(), b.data())});
  return found;
}

void expect_bits_of_one(const SparseMatrix& a, base::Numbers numbers, std::span<const double> values) {
  const auto operator_of = [&](base::ThreadPool& pool) {
    solve::ResidualOperator op(a, solve::ResidualOperator::rows_of(a, pool), pool, numbers);
    op.set_values(values);
    return op;
  };
  for (const bool transpose : {false, true}) {
    base::ThreadPool pool(2);
    const Found truth = all_of(operator_of(pool), transpose);
    for (const int count : {2, 3, 7})
      on_threads(count, {}, [&](const Ranks& ranks) {
        base::ThreadPool own(1);
        // With the index of its own rows alone.
        const solve::OwnRows rows = solve::own_rows(a.rows, ranks.rank(), ranks.size());
        const auto index = solve::ResidualOperator::rows_of(a, own);
        auto mine =
            solve::ResidualOperator(
                a, std::make_shared<const matrix::RowIndex>(matrix::rows_of_index(*index, rows.first, rows.end)), own,
                numbers)
                .of_rows(rows.first, rows.end);
        mine.set_values(values);
        Found found;
        const Status status = solver::on_all_ranks(*ranks.link(), [&] {
          found = all_of(solve::RankResidual(mine, *ranks.link()), transpose);
          return Status{};
        });
        EXPECT_TRUE(status.ok()) << status.message;
        ASSERT_EQ(found.numbers.size(), truth.numbers.size());
        EXPECT_EQ(std::memcmp(found.numbers.data(), truth.numbers.data(), 8 * truth.numbers.size()), 0) << count;
      });
  }
}

TEST(ResidualRanks, HasTheBitsOfOne) {
  for (const Index n : {1, 3, 5000})
    for (const Values values : {Values::positive, Values::general}) {
      const SparseMatrix a = reference::random_system(n, 6, values, 1);
      expect_bits_of_one(a, base::Numbers::real, a.values);
    }
  SparseMatrix a = reference::random_system(3000, 5, Values::indefinite, 1);
  expect_bits_of_one(reference::stored_as(a, Storage::symmetric_both, true), base::Numbers::real,
                     reference::stored_as(a, Storage::symmetric_both, true).values);
  const std::vector<double> both = random_vector(2 * a.nonzeros(), 5);
  a.values.clear();
  expect_bits_of_one(a, base::Numbers::complex, both);
}

// CG and FGMRES in lockstep, with a rough factor: what refinement does, steps and all.
TEST(ResidualRanks, KrylovMethodsHaveTheBitsOfOne) {
  const SparseMatrix a = matrix::generate(matrix::parse_generator(std::vector<std::string>{"poisson", "14"}));
  const auto n = static_cast<std::size_t>(a.rows);
  const std::vector<double> b = random_vector(Offset{a.rows} * kColumns, 4);
  const solve::Preconditioner rough = [&](const double* x, double* y, Index columns) {
    for (std::size_t k = 0; k < n * static_cast<std::size_t>(columns); ++k) y[k] = x[k] / 6;
  };
  for (const bool definite : {false, true}) {
    solve::RefinementOptions options;
    options.krylov = true;
    options.positive_definite = definite;
    options.steps = 4;
    options.krylov_steps = 50;
    const auto refined = [&](const solve::ResidualSpace& space) {
      std::vector<double> x(b.size(), 0.0);
      const auto r = solve::refine(space, rough, {b.data(), x.data(), kColumns, false}, options);
      EXPECT_GT(r.krylov_steps, 10);
      x.insert(x.end(), {r.error.normwise, r.error.componentwise, 1.0 * r.steps, 1.0 * r.krylov_steps});
      return x;
    };
    base::ThreadPool pool(2);
    const std::vector<double> truth = refined(solve::ResidualOperator(a, pool));
    on_threads(3, {}, [&](const Ranks& ranks) {
      base::ThreadPool own(1);
      const solve::OwnRows rows = solve::own_rows(a.rows, ranks.rank(), ranks.size());
      const solve::ResidualOperator mine = solve::ResidualOperator(a, own).of_rows(rows.first, rows.end);
      const Status status = solver::on_all_ranks(*ranks.link(), [&] {
        const std::vector<double> x = refined(solve::RankResidual(mine, *ranks.link()));
        EXPECT_EQ(x, truth);
        return Status{};
      });
      EXPECT_TRUE(status.ok()) << status.message;
    });
  }
}

}  // namespace residual_ranks_test
}  // namespace espalier::ranks
