// Refinement and the Krylov methods with preconditioners that are wrong by a known amount.
#include "solve/refinement.hpp"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <limits>
#include <utility>
#include <vector>

#include "reference/reference.hpp"
#include "solve/refinement_steps.hpp"
namespace espalier::solve {
namespace {

using reference::Values;
constexpr double kEps = std::numeric_limits<double>::epsilon();

// The inverse of `a` with relative errors of `size` in every component.
Preconditioner wrong_inverse(const SparseMatrix& a, bool transpose, double size) {
  const Index n = a.rows;
  std::vector<double> unit(static_cast<std::size_t>(n) * static_cast<std::size_t>(n), 0);
  for (Index k = 0; k < n; ++k) unit[static_cast<std::size_t>(k) * static_cast<std::size_t>(n + 1)] = 1;
  const std::vector<double> inverse = reference::solve(a, unit, n, transpose);
  const std::vector<double> noise = reference::random_vector(n, 99);
  return [=](const double* x, double* y, Index columns) {
    std::vector<double> out(static_cast<std::size_t>(n) * static_cast<std::size_t>(columns), 0);
    for (Index c = 0; c < columns; ++c)
      for (Index j = 0; j < n; ++j)
        for (Index i = 0; i < n; ++i)
          out[static_cast<std::size_t>(c * n + i)] += inverse[static_cast<std::size_t>(j * n + i)] * x[c * n + j];
    for (std::size_t k = 0; k < out.size(); ++k) y[k] = out[k] * (1 + size * noise[k % static_cast<std::size_t>(n)]);
  };
}

struct Refined {
  RefinementResult result;
  double error;
};

Refined refined(const SparseMatrix& a, double size, bool transpose, Index columns, RefinementOptions options) {
  base::ThreadPool pool(2);
  const ResidualOperator op(a, pool);
  const Preconditioner m = wrong_inverse(a, transpose, size);
  const std::vector<double> b = reference::random_vector(static_cast<std::int64_t>(a.rows) * columns, 8);
  std::vector<double> x(b.size());
  m(b.data(), x.data(), columns);
  const RefinementResult r = refine(op, m, {b.data(), x.data(), columns, transpose}, options);
  return {r, reference::backward_error(a, b, x, columns, transpose)};
}

TEST(Refinement, ReachesRoundingFromAWrongInverse) {
  for (const Values values : {Values::positive, Values::indefinite, Values::general})
    for (const bool transpose : {false, true})
      for (const Index columns : {1, 3, 33}) {
        const SparseMatrix a = reference::random_system(70, 5, values, 9);
        RefinementOptions o;
        o.steps = 40;
        const Refined run = refined(a, 1e-3, transpose, columns, o);
        EXPECT_LE(run.error, 4 * kEps);
        EXPECT_LE(run.result.error.componentwise, 70 * kEps);
        EXPECT_GE(run.result.steps, 3) << "an error of 1e-3 takes several steps";
        EXPECT_LE(run.result.steps, 12);
        EXPECT_EQ(run.result.krylov_steps, 0);
      }
}

TEST(Refinement, NoStepsLeaveTheSolutionAlone) {
  const SparseMatrix a = reference::random_system(40, 5, Values::positive, 10);
  RefinementOptions o;
  o.steps = 0;
  const Refined run = refined(a, 1e-3, false, 2, o);
  EXPECT_EQ(run.result.steps, 0);
  EXPECT_GT(run.error, 1e-7);
  EXPECT_NEAR(run.result.error.normwise, run.error, 1e-6 * run.error);
}

// Half of the solution and of the right-hand side is zero: what stands there is an error of 100 % in each component.
// Truth: what BackwardError's fields mean. Large normwise errors are brought down first, then componentwise ones.
TEST(Refinement, StepsAreJudgedByTheErrorThatMatters) {
  const auto judge = [](BackwardError before, BackwardError now) { return judge_step(before, now); };
  EXPECT_TRUE(judge({1e-3, 1}, {1e-4, 1}).better);
  EXPECT_FALSE(judge({1e-3, 1}, {1e-4, 1}).stalled);
  const double tiny = 1e-17;
  EXPECT_FALSE(judge({tiny, 1e-10}, {tiny / 4, 2e-10}).better) << "the componentwise error is worse";
  EXPECT_TRUE(judge({tiny, 1e-10}, {tiny / 4, 1e-10}).better);
  EXPECT_FALSE(judge({tiny, 1e-10}, {tiny, 1e-10}).better);
  EXPECT_TRUE(judge({tiny, 1e-10}, {tiny, 0.9e-10}).better);
  EXPECT_TRUE(judge({tiny, 1e-10}, {tiny, 0.9e-10}).stalled);
  EXPECT_FALSE(judge({tiny, 1e-10}, {tiny, 0.4e-10}).stalled);
}

TEST(Refinement, ZerosInTheSolutionDoNotEndIt) {
  const SparseMatrix one = reference::from_triples(
      6, {{0, 0, 1}, {1, 1, 1}, {2, 2, 1}, {3, 3, 1}, {4, 4, 1}, {5, 5, 1}}, Storage::symmetric_lower);
  base::ThreadPool pool(1);
  const ResidualOperator op(one, pool);
  const std::vector<double> b{1, -1, 0.5, 0, 0, 0}, noise = reference::random_vector(36, 7);
  const Preconditioner m = [&](const double* x, double* y, Index columns) {
    std::vector<double> out(static_cast<std::size_t>(6 * columns));
    for (Index c = 0; c < columns; ++c)
      for (Index i = 0; i < 6; ++i) {
        double sum = x[6 * c + i];
        for (Index j = 0; j < 6; ++j) sum += 1e-4 * noise[static_cast<std::size_t>(6 * i + j)] * x[6 * c + j];
        out[static_cast<std::size_t>(6 * c + i)] = sum;
      }
    std::copy(out.begin(), out.end(), y);
  };
  std::vector<double> x(6);
  m(b.data(), x.data(), 1);
  const RefinementResult r = refine(op, m, {b.data(), x.data()}, {});
  EXPECT_LE(reference::backward_error(one, b, x), kEps);
  EXPECT_LE(r.error.normwise, kEps);
  EXPECT_GE(r.steps, 3);
  EXPECT_LE(r.steps, 10);
}

TEST(Refinement, AHopelessPreconditionerNeverMakesThingsWorse) {
  const SparseMatrix a = reference::random_system(60, 5, Values::indefinite, 11);
  base::ThreadPool pool(1);
  const ResidualOperator op(a, pool);
  const std::vector<double> b = reference::random_vector(60, 12);
  for (const double factor : {-3.0, 1e300, std::numeric_limits<double>::quiet_NaN()}) {
    std::vector<double> x(60, 0.0);
    const double before = reference::backward_error(a, b, x);
    const RefinementResult r = refine(op,
                                      [&](const double* from, double* to, Index columns) {
                                        for (Index k = 0; k < 60 * columns; ++k) to[k] = factor * from[k];
                                      },
                                      {b.data(), x.data()}, {});
    EXPECT_LE(reference::backward_error(a, b, x), before);
    EXPECT_LE(r.steps, 10);
  }
}

TEST(Refinement, KrylovGoesOnWherePlainStepsStall) {
  // Errors of 0.9 in each component: plain steps gain little or nothing.
  for (const Values values : {Values::positive, Values::indefinite, Values::general}) {
    const SparseMatrix a = reference::random_system(60, 5, values, 13);
    RefinementOptions o;
    o.steps = 60;
    o.krylov = true;
    o.krylov_steps = 400;
    const Refined run = refined(a, 0.9, false, 1, o);
    EXPECT_LE(run.error, 16 * kEps);
    EXPECT_GT(run.result.krylov_steps, 0);
    RefinementOptions plain;
    plain.steps = 10;
    EXPECT_GT(refined(a, 0.9, false, 1, plain).error, run.error);
  }
}

// |A d - r| / |r|
double relative_residual(const SparseMatrix& a, const std::vector<double>& r, const std::vector<double>& d,
                         bool transpose) {
  const std::vector<double> rest = reference::residual(a, r.data(), d.data(), transpose);
  double above = 0, below = 0;
  for (std::size_t k = 0; k < r.size(); ++k) {
    above += rest[k] * rest[k];
    below += r[k] * r[k];
  }
  return std::sqrt(above / below);
}

const Preconditioner kIdentity60 = [](const double* x, double* y, Index columns) { std::copy_n(x, 60 * columns, y); };

using Columns = std::vector<KrylovColumn>;

TEST(Cg, ConvergesWithinNStepsAndStopsWhenNotPositive) {
  base::ThreadPool pool(1);
  const SparseMatrix a = reference::random_system(60, 5, Values::positive, 14);
  const ResidualOperator op(a, pool);
  const std::vector<double> r = reference::random_vector(60, 15);
  std::vector<double> d(60);
  Columns c{{{1e-10, 120}}};
  solve_cg(op, kIdentity60, r.data(), d.data(), c);
  EXPECT_LE(c[0].steps, 120);
  EXPECT_LE(relative_residual(a, r, d, false), 2e-10);
  const std::vector<double> zero(60, 0.0);
  c = {{{1e-10, 10}}};
  solve_cg(op, kIdentity60, zero.data(), d.data(), c);
  EXPECT_EQ(c[0].steps, 0);
  EXPECT_EQ(d, zero);
  const SparseMatrix indefinite = reference::random_system(60, 5, Values::indefinite, 16);
  c = {{{1e-10, 500}}};
  solve_cg(ResidualOperator(indefinite, pool), kIdentity60, r.data(), d.data(), c);
  EXPECT_LE(c[0].steps, 500);
  for (const double e : d) EXPECT_TRUE(std::isfinite(e));
}

TEST(Fgmres, ConvergesWithinItsBasis) {
  base::ThreadPool pool(1);
  for (const bool transpose : {false, true}) {
    const SparseMatrix a = reference::random_system(25, 5, Values::general, 17);
    const ResidualOperator op(a, pool);
    const std::vector<double> r = reference::random_vector(25, 18);
    std::vector<double> d(25);
    const Preconditioner identity = [](const double* x, double* y, Index columns) { std::copy_n(x, 25 * columns, y); };
    const auto steps = [&](const std::vector<double>& from, int most) {
      Columns c{{{1e-12, most}}};
      solve_fgmres(op, identity, from.data(), d.data(), transpose, c);
      return c[0].steps;
    };
    EXPECT_LE(steps(r, 30), 30);
    EXPECT_LE(relative_residual(a, r, d, transpose), 1e-10);  // n steps solve exactly, up to rounding
    const std::vector<double> zero(25, 0.0);
    EXPECT_EQ(steps(zero, 30), 0);
    EXPECT_EQ(d, zero);
    EXPECT_EQ(steps(r, 0), 0);
  }
}

// Right-hand sides that end at different steps, one of them zero: each as alone, to the bit, and no more calls of the
// preconditioner than the longest needs.
TEST(Lockstep, EachColumnHasTheBitsThatItHasAlone) {
  base::ThreadPool pool(2);
  constexpr Index n = 300;
  constexpr std::size_t count = 11;
  for (const Values values : {Values::positive, Values::general})
    for (const bool transpose : {false, true}) {
      const SparseMatrix a = reference::random_system(n, 5, values, 41);
      const ResidualOperator op(a, pool);
      const bool cg = values == Values::positive;
      std::vector<double> r = reference::random_vector(n * std::int64_t{count}, 42);
      std::fill_n(r.begin() + 4 * n, n, 0.0);
      int calls = 0;
      const Preconditioner m = [&](const double* x, double* y, Index columns) {
        ++calls;
        for (Index k = 0; k < n * columns; ++k) y[k] = x[k] * (1 + 0.2 * (k % n % 7));
      };
      const auto run = [&](std::size_t first, Columns& c) {
        std::vector<double> d(n * c.size());
        const double* from = r.data() + first * n;
        if (cg)
          solve_cg(op, m, from, d.data(), c);
        else
          solve_fgmres(op, m, from, d.data(), transpose, c);
        return d;
      };
      Columns all;
      for (std::size_t k = 0; k < count; ++k)
        all.push_back({{std::pow(10.0, -1.0 - static_cast<double>(k * 5 % 8)), 20}});
      all[7].end.most_steps = 0;
      all[8].end.most_steps = 3;
      const std::vector<double> together = run(0, all);
      const int calls_together = std::exchange(calls, 0);
      int most = 0, sum = 0;
      for (std::size_t k = 0; k < count; ++k) {
        Columns one{{all[k].end}};
        const std::vector<double> d = run(k, one);
        EXPECT_EQ(one[0].steps, all[k].steps) << k;
        EXPECT_TRUE(std::equal(d.begin(), d.end(), together.begin() + static_cast<std::ptrdiff_t>(k * n))) << k;
        most = std::max(most, one[0].steps);
        sum += one[0].steps;
      }
      EXPECT_GT(sum, 3 * most) << "else columns are not many";
      EXPECT_LE(calls_together, most + 1);
      EXPECT_EQ(all[7].steps, 0);
      EXPECT_EQ(all[8].steps, 3);
    }
}

// A space in which many vectors have no place.
class SmallSpace final : public ResidualSpace {
 public:
  SmallSpace(const ResidualOperator& a, Index most) : a_(a), most_(most) {}
  [[nodiscard]] Index size() const override { return a_.size(); }
  void compute(std::span<ResidualColumn> columns, bool transpose) const override { a_.compute(columns, transpose); }
  void copy(const double* from, double* to) const override { a_.copy(from, to); }
  bool add(const double* from, double* to) const override { return a_.add(from, to); }
  void multiply(const double* x, double* y, bool transpose) const override { a_.multiply(x, y, transpose); }
  void combine(double a, const double* x, double b, double* y) const override { a_.combine(a, x, b, y); }
  [[nodiscard]] double dot(const double* a, const double* b) const override { return a_.dot(a, b); }
  [[nodiscard]] Vectors vectors(Index slot, Index columns) const override {
    if (slot >= kKrylovSlot && columns > most_) throw Error(StatusCode::out_of_memory, "no room");
    return a_.vectors(slot, columns);
  }

 private:
  const ResidualOperator& a_;
  Index most_;
};

TEST(Lockstep, WithoutRoomForManyColumnsTheyGoOneByOne) {
  base::ThreadPool pool(1);
  for (const Values values : {Values::positive, Values::general}) {
    const SparseMatrix a = reference::random_system(60, 5, values, 13);
    const ResidualOperator op(a, pool);
    const Preconditioner m = wrong_inverse(a, false, 0.9);
    const std::vector<double> b = reference::random_vector(60 * 5, 8);
    RefinementOptions o;
    o.steps = 60;
    o.krylov = true;
    o.krylov_steps = 400;
    o.positive_definite = values == Values::positive;
    const auto solved = [&](const ResidualSpace& space) {
      std::vector<double> x(b.size());
      m(b.data(), x.data(), 5);
      const RefinementResult r = refine(space, m, {b.data(), x.data(), 5}, o);
      EXPECT_GT(r.krylov_steps, 0);
      return x;
    };
    EXPECT_EQ(solved(SmallSpace(op, 1)), solved(op));
    EXPECT_THROW(solved(SmallSpace(op, 0)), Error);
  }
}

// Columns in one part of the unknowns refine at once, those in the other need Krylov methods, side by side.
TEST(Lockstep, ColumnsThatNeedOtherMethodsKeepApart) {
  base::ThreadPool pool(2);
  constexpr Index n = 60;
  for (const Values values : {Values::positive, Values::general}) {
    const SparseMatrix a = reference::random_system(n, 5, values, 13);
    std::vector<reference::Triple> both;
    const MatrixView view = a;
    for (Index c = 0; c < n; ++c)
      for (Offset q = view.col_ptr[static_cast<std::size_t>(c)]; q < view.col_ptr[static_cast<std::size_t>(c) + 1]; ++q)
        for (const Index part : {0, n})
          both.push_back(
              {view.row_ind[static_cast<std::size_t>(q)] + part, c + part, view.values[static_cast<std::size_t>(q)]});
    const SparseMatrix twice = reference::from_triples(2 * n, both, a.storage);
    const ResidualOperator op(twice, pool);
    const Preconditioner good = wrong_inverse(a, false, 1e-3), bad = wrong_inverse(a, false, 0.9);
    const Preconditioner m = [&](const double* x, double* y, Index columns) {
      for (Index c = 0; c < columns; ++c) {
        good(x + Offset{2 * n} * c, y + Offset{2 * n} * c, 1);
        bad(x + Offset{2 * n} * c + n, y + Offset{2 * n} * c + n, 1);
      }
    };
    const std::vector<int> parts{0, 1, 1, 0, 1, 0, 0, 1};
    std::vector<double> b(2 * n * parts.size(), 0.0);
    for (std::size_t k = 0; k < parts.size(); ++k) {
      const std::vector<double> some = reference::random_vector(n, 20 + k);
      std::copy(some.begin(), some.end(), b.begin() + static_cast<std::ptrdiff_t>(2 * n * k) + n * parts[k]);
    }
    RefinementOptions o;
    o.steps = 60;
    o.krylov = true;
    o.positive_definite = values == Values::positive;
    for (const int most : {400, 25}) {
      o.krylov_steps = most;
      const auto solve = [&](std::size_t first, Index columns, std::vector<double>& x) {
        x.assign(static_cast<std::size_t>(2 * n * columns), 0.0);
        const double* from = b.data() + 2 * n * first;
        m(from, x.data(), columns);
        return refine(op, m, {from, x.data(), columns}, o);
      };
      std::vector<double> together, one;
      (void)solve(0, static_cast<Index>(parts.size()), together);
      for (std::size_t k = 0; k < parts.size(); ++k) {
        const RefinementResult r = solve(k, 1, one);
        EXPECT_TRUE(std::equal(one.begin(), one.end(), together.begin() + static_cast<std::ptrdiff_t>(2 * n * k))) << k;
        EXPECT_EQ(r.krylov_steps > 0, parts[k] == 1) << k;
        EXPECT_LE(r.krylov_steps, most) << k;
      }
    }
  }
}

}  // namespace
}  // namespace espalier::solve
