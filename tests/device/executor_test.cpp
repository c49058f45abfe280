// Executors behind the backend seam: one body over backend, kind, precision, threads, tile width and pattern. The truth
// is the residual in long double, the dense solution, and what the textbook's backend (device/reference) finds; bits
// must not depend on threads or repetition.
#include "device/executor.hpp"

#include <gtest/gtest.h>

#include <Eigen/Dense>
#include <cmath>
#include <cstring>
#include <limits>
#include <map>

#include "device/backends.hpp"
#include "matrix/generators/generate.hpp"
#include "reference/reference.hpp"

namespace espalier::device {
namespace executor_test {

using reference::Values;

// A multiple of these many right-hand sides, or one, is what every backend takes.
template <class T>
constexpr Index kGroup = static_cast<Index>(64 / sizeof(T));

template <class T>
struct Factored {
  plan::Plan plan;
  std::unique_ptr<base::ThreadPool> pool;
  std::unique_ptr<Executor<T>> executor;
  std::vector<T> values;
  FactorOutcome outcome;
};

template <class T>
std::unique_ptr<Factored<T>> factored(const Backend& backend, const SparseMatrix& a, Kind kind, int threads,
                                      Index width, base::MemoryBudget* budget = nullptr) {
  auto f = std::make_unique<Factored<T>>();
  f->pool = std::make_unique<base::ThreadPool>(threads);
  f->plan = test::plan_for<T>(backend, a, kind, width);
  PivotRule rule;
  rule.tiny = 1e-30;
  f->executor = backend.make_executor({f->plan, kind, false, rule, *f->pool, budget}, Scalar<T>());
  f->values.assign(a.values.begin(), a.values.end());
  f->outcome = f->executor->factorize(f->values);
  return f;
}

bool good(const FactorOutcome& o) { return o.not_positive < 0 && o.failed.empty() && o.replaced.empty(); }

class ExecutorOf : public ::testing::TestWithParam<const Backend*> {
 protected:
  template <class T>
  void check_solutions(Kind kind);
  [[nodiscard]] static const Backend& backend() { return *GetParam(); }
};

// Solves for `columns` right-hand sides given and returned column by column in the matrix' own order.
template <class T>
std::vector<double> solved(Factored<T>& f, const std::vector<double>& b, Index columns, bool transpose) {
  const Index n = f.plan.tree.n;
  const Index width = columns == 1 ? 1 : (columns + kGroup<T> - 1) / kGroup<T> * kGroup<T>;
  std::vector<T> x(static_cast<std::size_t>(n) * static_cast<std::size_t>(width), T(0));
  for (Index k = 0; k < n; ++k)
    for (Index c = 0; c < columns; ++c)
      x[static_cast<std::size_t>(k * width + c)] =
          static_cast<T>(b[static_cast<std::size_t>(c * n + f.plan.tree.order[k])]);
  f.executor->solve(x.data(), width, transpose);
  std::vector<double> out(b.size());
  for (Index k = 0; k < n; ++k)
    for (Index c = 0; c < columns; ++c)
      out[static_cast<std::size_t>(c * n + f.plan.tree.order[k])] =
          static_cast<double>(x[static_cast<std::size_t>(k * width + c)]);
  return out;
}

SparseMatrix system_of(Kind kind, int number) {
  const Values values = kind == Kind::llt    ? Values::positive
                        : kind == Kind::ldlt ? Values::indefinite
                                             : Values::general;
  if (number < 3)
    return reference::random_system(number == 0 ? 1 : 90 * number + 7, 2 + 2 * number, values, 3 + number);
  std::vector<std::string> words{"elasticity", "4"};
  if (kind == Kind::lu) words[0] = "gyroscopic";
  return matrix::generate(matrix::parse_generator(words));
}

// The same pivots need not be taken, but where none failed, inertia and determinant are the matrix' own. FP32 rounds
// pivots by 6e-8 of the largest entry, so that its determinants are compared loosely.
template <class T>
void expect_as_in_the_textbook(const FactorOutcome& o, const SparseMatrix& a, Kind kind) {
  const Backend* textbook = registry().find("reference");
  ASSERT_NE(textbook, nullptr);
  const FactorOutcome truth = factored<T>(*textbook, a, kind, 1, 0)->outcome;
  EXPECT_EQ(truth.not_positive, o.not_positive);
  if (!good(truth) || !good(o)) return;
  EXPECT_EQ(o.negative, truth.negative);
  EXPECT_EQ(o.determinant_sign, truth.determinant_sign);
  const double eps = static_cast<double>(std::numeric_limits<T>::epsilon());
  EXPECT_NEAR(o.determinant_log, truth.determinant_log, 1e4 * a.rows * eps);
}

// The pivots are those of the tile or front: growth in between is bounded by the threshold only where no column failed.
template <class T>
void ExecutorOf::check_solutions(Kind kind) {
  const double eps = static_cast<double>(std::numeric_limits<T>::epsilon());
  int compared = 0;
  for (int number = 0; number < 4; ++number) {
    const SparseMatrix a = system_of(kind, number);
    const std::vector<double> b = reference::random_vector(9 * static_cast<std::int64_t>(a.rows), 4);
    for (const Index width : {8, 16, 48, 0}) {
      std::map<std::pair<bool, Index>, std::vector<double>> first;
      for (const int threads : {1, 2, 4}) {
        SCOPED_TRACE(testing::Message() << "system " << number << " width " << width << " threads " << threads);
        auto f = factored<T>(backend(), a, kind, threads, width);
        ASSERT_EQ(f->outcome.not_positive, -1);
        if (threads == 1) expect_as_in_the_textbook<T>(f->outcome, a, kind);
        for (int repeat = 0; repeat < 2; ++repeat) {
          for (const bool transpose : {false, true})
            for (const Index columns : {1, 9}) {
              const std::vector<double> part(b.begin(), b.begin() + static_cast<std::ptrdiff_t>(columns) * a.rows);
              const std::vector<double> x = solved(*f, part, columns, transpose);
              auto& known = first[{transpose, columns}];
              if (known.empty()) {
                known = x;
                const double error = reference::backward_error(a, part, x, columns, transpose);
                // No column failed: |L| <= 1/u = 100 in the few tiles between; else the factor promises nothing.
                if (f->outcome.failed.empty() && f->outcome.replaced.empty()) {
                  EXPECT_LE(error, 100 * std::sqrt(a.rows) * eps);
                  ++compared;
                }
                if (sizeof(T) == 8 && number == 1 && f->outcome.failed.empty()) {
                  const std::vector<double> truth = reference::solve(a, part, columns, transpose);
                  const double allowed = 100 * a.rows * eps * reference::condition(a);
                  for (std::size_t k = 0; k < x.size(); ++k) ASSERT_NEAR(x[k], truth[k], allowed);
                }
              }
              ASSERT_EQ(std::memcmp(x.data(), known.data(), x.size() * sizeof(double)), 0) << "repetition " << repeat;
            }
          f->outcome = f->executor->factorize(f->values);
        }
      }
    }
  }
  EXPECT_GE(compared, 24);
}

TEST_P(ExecutorOf, LltFp64) { check_solutions<double>(Kind::llt); }
TEST_P(ExecutorOf, LltFp32) { check_solutions<float>(Kind::llt); }
TEST_P(ExecutorOf, LdltFp64) { check_solutions<double>(Kind::ldlt); }
TEST_P(ExecutorOf, LdltFp32) { check_solutions<float>(Kind::ldlt); }
TEST_P(ExecutorOf, LuFp64) { check_solutions<double>(Kind::lu); }
TEST_P(ExecutorOf, LuFp32) { check_solutions<float>(Kind::lu); }

TEST_P(ExecutorOf, TheLowestPivotThatIsNotPositiveIsNamed) {
  for (const Index width : {8, 16, 0})
    for (const int threads : {1, 2, 4}) {
      SparseMatrix a = reference::random_system(150, 5, Values::positive, 6);
      auto f = factored<double>(backend(), a, Kind::llt, threads, width);
      for (const Index position : {0, 71, 149}) {
        const Index bad = f->plan.tree.order[position];
        std::vector<double> values = a.values;
        for (Offset q = a.col_ptr[bad]; q < a.col_ptr[bad + 1]; ++q)
          if (a.row_ind[q] == bad) values[q] *= -1;
        EXPECT_EQ(f->executor->factorize(values).not_positive, position);
      }
      EXPECT_EQ(f->executor->factorize(a.values).not_positive, -1);
    }
}

TEST_P(ExecutorOf, NotANumberEndsAndTheExecutorStaysUsable) {
  for (const Kind kind : {Kind::llt, Kind::ldlt, Kind::lu}) {
    const SparseMatrix a = system_of(kind, 2);
    for (const Index width : {16, 0}) {
      auto f = factored<double>(backend(), a, kind, 4, width);
      const std::vector<double> b = reference::random_vector(a.rows, 7);
      const std::vector<double> good = solved(*f, b, 1, false);
      std::vector<double> values(a.values.size(), std::numeric_limits<double>::quiet_NaN());
      (void)f->executor->factorize(values);
      (void)solved(*f, b, 1, false);
      EXPECT_TRUE(kind != Kind::llt || f->executor->factorize(values).not_positive == 0);
      (void)f->executor->factorize(f->values);
      EXPECT_EQ(solved(*f, b, 1, false), good);
    }
  }
}

TEST_P(ExecutorOf, InertiaAndDeterminantOfEveryTiling) {
  const SparseMatrix a = reference::random_system(160, 5, Values::indefinite, 8);
  const reference::Signs signs = reference::signs(a, 1e-13);
  const reference::Determinant truth = reference::determinant(a);
  for (const Index width : {8, 16, 48, 0})
    for (const Kind kind : {Kind::ldlt, Kind::lu}) {
      const SparseMatrix b = kind == Kind::lu ? reference::stored_as(a, Storage::general) : a;
      auto f = factored<double>(backend(), b, kind, 2, width);
      if (!f->outcome.failed.empty()) continue;
      if (kind == Kind::ldlt) {
        EXPECT_EQ(f->outcome.negative, signs.negative);
      }
      EXPECT_EQ(f->outcome.determinant_sign, truth.sign);
      EXPECT_NEAR(f->outcome.determinant_log, truth.log, 1e4 * 160 * std::numeric_limits<double>::epsilon());
    }
}

TEST_P(ExecutorOf, ASmallBudgetIsRefusedAndLeavesNothingBehind) {
  if (backend().limits().own_memory) GTEST_SKIP() << "it takes no memory of the host's";
  const SparseMatrix a = system_of(Kind::llt, 3);
  base::MemoryBudget enough("host memory");
  {
    auto f = factored<double>(backend(), a, Kind::llt, 2, 0, &enough);
    EXPECT_EQ(f->executor->peak_bytes(), enough.peak());
    EXPECT_GE(enough.held(), f->plan.nonzeros_factor * 8);
  }
  EXPECT_EQ(enough.held(), 0);
  base::MemoryBudget small("host memory", enough.peak() / 2);
  EXPECT_THROW((void)factored<double>(backend(), a, Kind::llt, 2, 0, &small), Error);
  EXPECT_EQ(small.held(), 0);
}

// Unknowns that are measured in another unit have small pivots wherever the elimination meets them. ldlt: the pivots of
// S A S are s^2 times those of A, which is positive or negative definite here; two further unknowns make a pair with
// the eigenvalues 1e-9 and -1e-9. lu: all of a column is small, whichever row its pivot comes from.
TEST_P(ExecutorOf, SmallPivotsThatAreKeptAreListed) {
  constexpr Index n = 160;
  const std::vector<Index> small = {3, 40, 41, 99, 158};
  const auto unit = [&](Index k) { return std::binary_search(small.begin(), small.end(), k) ? 1e-5 : 1.0; };
  for (const double sign : {1.0, -1.0})
    for (const Kind kind : {Kind::ldlt, Kind::lu})
      for (const Index width : {8, 0}) {
        SCOPED_TRACE(testing::Message() << "sign " << sign << (kind == Kind::lu ? " lu" : " ldlt") << ", " << width);
        const bool symmetric = kind == Kind::ldlt;
        const SparseMatrix lower = reference::random_system(n, 5, Values::positive, 12);
        const SparseMatrix a = symmetric ? lower : reference::stored_as(lower, Storage::general);
        std::vector<reference::Triple> entries;
        for (Index c = 0; c < n; ++c)
          for (Offset q = a.col_ptr[c]; q < a.col_ptr[c + 1]; ++q) {
            const double scale = unit(c) * (symmetric ? unit(a.row_ind[q]) : unit(c));
            entries.push_back({a.row_ind[q], c, sign * scale * a.values[q]});
          }
        if (symmetric) entries.push_back({n + 1, n, 1e-9});
        const SparseMatrix b = reference::from_triples(symmetric ? n + 2 : n, entries, a.storage);
        auto f = factored<double>(backend(), b, kind, 2, width);
        EXPECT_EQ(f->outcome.small.size(), 0U) << "nobody asked";
        PivotRule rule;
        rule.tiny = 1e-30;
        rule.suspect = 1e-6;
        f->executor->set_pivot_rule(rule);
        const FactorOutcome o = f->executor->factorize(f->values);
        ASSERT_TRUE(o.replaced.empty());
        ASSERT_EQ(o.small.size(), small.size() + (symmetric ? 2 : 0));
        if (symmetric) {
          EXPECT_EQ(o.small_negative, sign < 0 ? 6 : 1);
          continue;
        }
        std::vector<Index> found;
        for (const Index position : o.small) found.push_back(f->plan.tree.order[static_cast<std::size_t>(position)]);
        std::sort(found.begin(), found.end());
        EXPECT_EQ(found, small);
      }
}

// Q D Q^T with eigenvalues 1e-12 and 1e-11 beside others near 1, of both signs: the last pivots of L D L^T are not much
// larger than the rounding of the first ones' products. The error must stay that of a backward stable method.
TEST_P(ExecutorOf, TheLastPivotsMayBeTiny) {
  for (const Index n : {5, 18, 32, 50, 64, 90})
    for (std::uint64_t seed = 1; seed <= 8; ++seed) {
      SCOPED_TRACE(testing::Message() << n << " unknowns, seed " << seed);
      const std::vector<double> random = reference::random_vector(std::int64_t{n} * n + n, seed);
      const Eigen::MatrixXd q = Eigen::Map<const Eigen::MatrixXd>(random.data(), n, n).householderQr().householderQ();
      Eigen::VectorXd d = Eigen::Map<const Eigen::VectorXd>(random.data() + std::int64_t{n} * n, n);
      d[0] *= 1e-12;
      d[1] *= 1e-11;
      const Eigen::MatrixXd full = q * d.asDiagonal() * q.transpose();
      std::vector<reference::Triple> entries;
      for (Index c = 0; c < n; ++c)
        for (Index r = c; r < n; ++r) entries.push_back({r, c, full(r, c)});
      const SparseMatrix a = reference::from_triples(n, entries, Storage::symmetric_lower);
      auto f = factored<double>(backend(), a, Kind::ldlt, 1, 0);
      ASSERT_TRUE(f->outcome.replaced.empty());
      const std::vector<double> b = reference::random_vector(n, seed + 100);
      EXPECT_LE(reference::backward_error(a, b, solved(*f, b, 1, false), 1, false), 1e-14);
    }
}

// With a singular matrix, every backend replaces a pivot and says where.
TEST_P(ExecutorOf, AVanishingPivotIsReplacedAndNamed) {
  // Two unknowns that only see each other, and one of them not at all: [1 1; 1 1].
  SparseMatrix a = reference::from_triples(3, {{0, 0, 1}, {1, 0, 1}, {1, 1, 1}, {2, 2, 4}}, Storage::symmetric_lower);
  for (const Kind kind : {Kind::ldlt, Kind::lu}) {
    const SparseMatrix b = kind == Kind::lu ? reference::stored_as(a, Storage::general) : a;
    auto f = factored<double>(backend(), b, kind, 1, 0);
    PivotRule rule;
    rule.tiny = 1e-12;
    f->executor->set_pivot_rule(rule);
    const FactorOutcome o = f->executor->factorize(f->values);
    ASSERT_EQ(o.replaced.size(), 1U);
    const Index unknown = f->plan.tree.order[static_cast<std::size_t>(o.replaced.front())];
    EXPECT_LT(unknown, 2);
    EXPECT_EQ(o.negative, 0) << "the sign of a replaced pivot means nothing";
  }
}

INSTANTIATE_TEST_SUITE_P(Backends, ExecutorOf, ::testing::ValuesIn(test::backends_here()),
                         [](const auto& tested) { return test::name_of(tested.param); });

}  // namespace executor_test
}  // namespace espalier::device
