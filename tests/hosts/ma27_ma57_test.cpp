// The Fortran interfaces of MA57 and MA27 in libespalier_hsl.so, as a host calls them. Truths: the inertia of saddle
// points by construction, backward errors, the documented flags. What these interfaces lack, a function that frees,
// must not show.
#include <algorithm>
#include <climits>
#include <limits>
#include <random>

#include "hosts/kkt.hpp"
#include "hosts/library.hpp"

namespace espalier::test {
namespace {

using Integers = std::vector<int>;
using Reals = std::vector<double>;

std::vector<double> right_hand_side(const Kkt& a) {
  Reals x(a.n);
  for (int k = 0; k < a.n; ++k) x[k] = 1 + k % 7;
  return a.times(x);
}

// A host of MA57, with its arrays.
struct Ma57 {
  Library library{ESPALIER_HSL};
  int n, entries, length, fact_length = 0, ifact_length = 0;
  Integers rows, columns, keep, iwork, ifact, icntl = Integers(20), info = Integers(40, -7);
  Reals fact, cntl = Reals(5), rinfo = Reals(20);

  explicit Ma57(const Kkt& a)
      : n(a.n),
        entries(a.entries()),
        length(5 * n + entries + std::max(n, entries) + 42),
        rows(a.rows),
        columns(a.columns()),
        keep(length),
        iwork(5 * n) {
    library.function<void(double*, int*)>("ma57id_")(cntl.data(), icntl.data());
  }
  int analyse() {
    library.function<void(int*, int*, int*, int*, int*, int*, int*, int*, int*, double*)>("ma57ad_")(
        &n, &entries, rows.data(), columns.data(), &length, keep.data(), iwork.data(), icntl.data(), info.data(),
        rinfo.data());
    fact_length = info[8];
    ifact_length = info[9];
    fact.assign(std::max(fact_length, 0), 0);
    ifact.assign(std::max(ifact_length, 0), 0);
    return info[0];
  }
  int factorize(Reals values) {
    library
        .function<void(int*, int*, double*, double*, int*, int*, int*, int*, int*, int*, int*, double*, int*, double*)>(
            "ma57bd_")(&n, &entries, values.data(), fact.data(), &fact_length, ifact.data(), &ifact_length, &length,
                       keep.data(), iwork.data(), icntl.data(), cntl.data(), info.data(), rinfo.data());
    return info[0];
  }
  [[nodiscard]] int negative() const { return info[23]; }
  [[nodiscard]] int rank() const { return info[24]; }
  int solve(double* x, int count = 1, int stride = 0, int job = 1) {
    if (stride == 0) stride = n;
    Reals work(static_cast<std::size_t>(n) * std::max(count, 1));
    int work_length = static_cast<int>(work.size());
    library.function<void(int*, int*, double*, int*, int*, int*, int*, double*, int*, double*, int*, int*, int*, int*)>(
        "ma57cd_")(&job, &n, fact.data(), &fact_length, ifact.data(), &ifact_length, &count, x, &stride, work.data(),
                   &work_length, iwork.data(), icntl.data(), info.data());
    return info[0];
  }
  double error(const Kkt& a) {
    const Reals b = right_hand_side(a);
    Reals x = b;
    EXPECT_EQ(solve(x.data()), 0);
    return a.backward_error(x, b);
  }
  static constexpr int kSingular = 4;
};

// A host of MA27.
struct Ma27 {
  Library library{ESPALIER_HSL};
  int n, entries, reals = 0, integers = 0, steps = 0, front = 0, flag = 0;
  Integers rows, columns, keep, iw, iw1, icntl = Integers(30), info = Integers(20, -7);
  Reals a, cntl = Reals(5);

  explicit Ma27(const Kkt& k)
      : n(k.n), entries(k.entries()), rows(k.rows), columns(k.columns()), keep(3 * n), iw1(2 * n) {
    library.function<void(int*, double*)>("ma27id_")(icntl.data(), cntl.data());
  }
  int analyse() {
    integers = 2 * (2 * entries + 3 * n + 1);
    iw.assign(integers, 0);
    double operations = -1;
    library.function<void(int*, int*, int*, int*, int*, int*, int*, int*, int*, int*, int*, double*, int*, double*)>(
        "ma27ad_")(&n, &entries, rows.data(), columns.data(), iw.data(), &integers, keep.data(), iw1.data(), &steps,
                   &flag, icntl.data(), cntl.data(), info.data(), &operations);
    reals = info[4];
    integers = info[5];
    a.assign(std::max(reals, 0), 0);
    iw.assign(std::max(integers, 0), 0);
    return info[0];
  }
  int factorize(const Reals& values) {
    if (a.size() < values.size()) a.resize(values.size());
    std::copy(values.begin(), values.end(), a.begin());
    library
        .function<void(int*, int*, int*, int*, double*, int*, int*, int*, int*, int*, int*, int*, int*, double*, int*)>(
            "ma27bd_")(&n, &entries, rows.data(), columns.data(), a.data(), &reals, iw.data(), &integers, keep.data(),
                       &steps, &front, iw1.data(), icntl.data(), cntl.data(), info.data());
    return info[0];
  }
  [[nodiscard]] int negative() const { return info[14]; }
  [[nodiscard]] int rank() const { return info[0] == kSingular ? info[1] : n; }
  int solve(double* x) {
    Reals w(front);
    Integers of_steps(steps);
    library.function<void(int*, double*, int*, int*, int*, double*, int*, double*, int*, int*, int*, int*)>("ma27cd_")(
        &n, a.data(), &reals, iw.data(), &integers, w.data(), &front, x, of_steps.data(), &steps, icntl.data(),
        info.data());
    return info[0];
  }
  double error(const Kkt& of) {
    const Reals b = right_hand_side(of);
    Reals x = b;
    EXPECT_EQ(solve(x.data()), 0);
    return of.backward_error(x, b);
  }
  static constexpr int kSingular = 3;
};

template <class Host>
class Handleless : public ::testing::Test {};
using Hosts = ::testing::Types<Ma57, Ma27>;
TYPED_TEST_SUITE(Handleless, Hosts);

TYPED_TEST(Handleless, InertiaAndSolutionOfSaddlePoints) {
  for (const double spread : {0.0, 6.0}) {
    for (const int n : {1, 2, 40, 700}) {
      Kkt a = kkt(n, n / 3, spread);
      TypeParam host(a);
      ASSERT_EQ(host.analyse(), 0);
      ASSERT_EQ(host.factorize(a.values), 0) << n;
      EXPECT_EQ(host.negative(), a.negative);
      EXPECT_LT(host.error(a), 1e-12) << n;
      for (double& v : a.values) v *= -1;
      ASSERT_EQ(host.factorize(a.values), 0);
      EXPECT_EQ(host.negative(), a.n - a.negative);
      EXPECT_LT(host.error(a), 1e-12);
    }
  }
}

TYPED_TEST(Handleless, SingularIsAWarning) {
  const Kkt a = kkt(40, 10, 0, 2);
  TypeParam host(a);
  ASSERT_EQ(host.analyse(), 0);
  EXPECT_EQ(host.factorize(a.values), TypeParam::kSingular);
  EXPECT_EQ(host.rank(), a.n - 2);
  EXPECT_EQ(host.negative(), a.negative);
}

// [I A^T; A 0] with more rows of A than columns, as Ipopt's least squares start: structurally singular. The bound of a
// zero pivot that these interfaces set, 1e-20, tells none of the zeros that rounding leaves.
Kkt least_squares(int columns, int rows) {
  Kkt a;
  a.n = columns + rows;
  a.negative = columns;
  std::mt19937 random(static_cast<unsigned>(rows));
  std::uniform_real_distribution<double> value(-1, 1);
  for (int c = 0; c < columns; ++c) {
    a.rows.push_back(c + 1);
    a.values.push_back(1);
    for (int r = 0; r < rows; ++r) {
      if (r % columns != c && (r + 3) % columns != c) continue;
      a.rows.push_back(columns + r + 1);
      a.values.push_back(r == c ? 4 : value(random));
    }
    a.pointers.push_back(a.entries() + 1);
  }
  a.pointers.resize(static_cast<std::size_t>(a.n) + 1, a.entries() + 1);
  return a;
}

TYPED_TEST(Handleless, StructurallySingularIsAWarningWithTheRank) {
  for (const auto& [columns, rows] : {std::pair(1, 3), std::pair(10, 25), std::pair(60, 300)}) {
    const Kkt a = least_squares(columns, rows);
    TypeParam host(a);
    ASSERT_EQ(host.analyse(), 0);
    EXPECT_EQ(host.factorize(a.values), TypeParam::kSingular);
    EXPECT_EQ(host.rank(), 2 * columns);
    EXPECT_EQ(host.negative(), columns);
    EXPECT_LT(host.error(a), 1e-10);
  }
}

// Coordinates in any order, of either triangle, repeated, and some that are none.
TYPED_TEST(Handleless, CoordinatesOfAnySort) {
  Kkt a = kkt(30, 9);
  Kkt given = a;
  Integers columns = a.columns();
  std::vector<std::size_t> order(a.rows.size());
  for (std::size_t k = 0; k < order.size(); ++k) order[k] = k;
  std::shuffle(order.begin(), order.end(), std::mt19937(5));
  given.rows.clear();
  given.values.clear();
  Integers given_columns;
  const auto add = [&](int row, int column, double value) {
    given.rows.push_back(row);
    given_columns.push_back(column);
    given.values.push_back(value);
  };
  for (const std::size_t k : order) {
    const bool turned = k % 2 == 0;
    add(turned ? columns[k] : a.rows[k], turned ? a.rows[k] : columns[k], 0.25 * a.values[k]);
    add(a.rows[k], columns[k], 0.75 * a.values[k]);
  }
  TypeParam clean(given);
  clean.columns = given_columns;
  ASSERT_EQ(clean.analyse(), 0);
  ASSERT_EQ(clean.factorize(given.values), 0);
  EXPECT_LT(clean.error(a), 1e-13);
  add(0, 3, 99);
  add(4, INT_MAX, 99);
  add(INT_MIN, 3, 99);
  TypeParam host(given);
  host.columns = given_columns;
  ASSERT_EQ(host.analyse(), 1) << "a warning: some are left out";
  ASSERT_EQ(host.factorize(given.values), 0);
  EXPECT_EQ(host.negative(), a.negative);
  EXPECT_LT(host.error(a), 1e-13);
}

// Each host's factor is there when it solves, however many came between and whatever left the cache.
TYPED_TEST(Handleless, FactorsLeaveTheCacheUnnoticed) {
  for (const char* budget : {"0", "1000"}) {
    const Variable cache("ESPALIER_HSL_CACHE", budget);
    std::vector<Kkt> matrices;
    std::vector<TypeParam> hosts;
    for (int k = 0; k < 40; ++k) {
      matrices.push_back(kkt(30, 10, k % 3));  // the same pattern for all
      for (double& v : matrices.back().values) v *= 1 + 0.1 * k;
      hosts.emplace_back(matrices.back());
    }
    for (int k = 0; k < 40; ++k) {
      ASSERT_EQ(hosts[k].analyse(), 0);
      ASSERT_EQ(hosts[k].factorize(matrices[k].values), 0);
    }
    for (int k = 0; k < 40; ++k) EXPECT_LT(hosts[k].error(matrices[k]), 1e-12) << k;
  }
}

// A host may copy its arrays, factorize other values, and go back to the copy.
TYPED_TEST(Handleless, CopiedArraysKeepTheirFactor) {
  const Kkt a = kkt(50, 20);
  Kkt b = a;
  for (double& v : b.values) v *= -3;
  TypeParam host(a);
  ASSERT_EQ(host.analyse(), 0);
  ASSERT_EQ(host.factorize(a.values), 0);
  TypeParam copy = host;
  ASSERT_EQ(host.factorize(b.values), 0);
  for (int round = 0; round < 2; ++round) {
    EXPECT_LT(copy.error(a), 1e-13);
    EXPECT_LT(host.error(b), 1e-13);
  }
}

// Memory that comes back from an earlier problem, with another pattern of the same size.
TYPED_TEST(Handleless, LeftOversInTheArrays) {
  Kkt a = kkt(50, 20);
  TypeParam host(a);
  ASSERT_EQ(host.analyse(), 0);
  ASSERT_EQ(host.factorize(a.values), 0);
  Kkt b = a;  // the unknowns in the opposite order
  TypeParam other(b);
  for (int& r : other.rows) r = a.n + 1 - r;
  for (int& c : other.columns) c = a.n + 1 - c;
  ASSERT_EQ(other.analyse(), 0);
  if constexpr (std::is_same_v<TypeParam, Ma57>) other.ifact = host.ifact;
  if constexpr (std::is_same_v<TypeParam, Ma27>) other.iw = host.iw;
  ASSERT_EQ(other.factorize(a.values), 0);
  Reals x = right_hand_side(a), reversed(x.rbegin(), x.rend());
  ASSERT_EQ(other.solve(reversed.data()), 0);
  EXPECT_LT(a.backward_error({reversed.rbegin(), reversed.rend()}, x), 1e-13);
}

TYPED_TEST(Handleless, MistakesAreFlags) {
  const Kkt a = kkt(12, 4);
  TypeParam host(a);
  Reals x(a.n, 1.0);
  host.n = 0;
  EXPECT_EQ(host.analyse(), -1);
  host.n = a.n;
  host.entries = -1;
  EXPECT_EQ(host.analyse(), -2);
  host.entries = INT_MAX;
  EXPECT_LT(host.factorize(a.values), 0);
  host.entries = a.entries();
  ASSERT_EQ(host.analyse(), 0);
  EXPECT_LT(host.solve(x.data()), 0) << "before the factorization";
  Reals nan = a.values;
  nan[3] = std::numeric_limits<double>::quiet_NaN();
  EXPECT_LT(host.factorize(nan), 0);
  EXPECT_LT(host.solve(x.data()), 0) << "there is no factor";
  ASSERT_EQ(host.factorize(a.values), 0);
  EXPECT_EQ(host.solve(x.data()), 0);
  host.n = a.n - 1;
  EXPECT_LT(host.solve(x.data()), 0) << "of another matrix";
}

TEST(Ma57, MistakesAreFlags) {
  const Kkt a = kkt(12, 4);
  Ma57 host(a);
  host.length = 10;
  EXPECT_EQ(host.analyse(), -15);
  host.length = static_cast<int>(host.keep.size());
  ASSERT_EQ(host.analyse(), 0);
  Reals x(2 * a.n);
  const int fact = host.fact_length, ifact = host.ifact_length;
  host.fact_length = fact - 1;
  EXPECT_EQ(host.factorize(a.values), -3);
  EXPECT_EQ(host.info[16], fact);
  host.fact_length = fact;
  host.ifact_length = ifact - 1;
  EXPECT_EQ(host.factorize(a.values), -4);
  EXPECT_EQ(host.info[17], ifact);
  host.ifact_length = ifact;
  host.icntl[6] = 4;
  EXPECT_EQ(host.factorize(a.values), -10);
  host.icntl[6] = 3;
  EXPECT_EQ(host.factorize(a.values), -6) << "it has eigenvalues of both signs";
  host.icntl[6] = 1;
  ASSERT_EQ(host.factorize(a.values), 0);
  EXPECT_EQ(host.solve(x.data(), 1, 0, 2), -12);
  EXPECT_EQ(host.solve(x.data(), 0), -16);
  EXPECT_EQ(host.solve(x.data(), 2, a.n - 1), -11);
  // The arrays move to longer ones.
  Integers longer(ifact + 5);
  int which = 1, longer_length = ifact + 5, unused = 0;
  const auto enlarge =
      host.library.function<void(int*, int*, int*, double*, int*, double*, int*, int*, int*, int*, int*, int*)>(
          "ma57ed_");
  enlarge(&host.n, &which, host.keep.data(), host.fact.data(), &host.fact_length, nullptr, &unused, host.ifact.data(),
          &host.ifact_length, longer.data(), &longer_length, host.info.data());
  EXPECT_EQ(host.info[0], 0);
  host.ifact = longer;
  host.ifact_length = longer_length;
  EXPECT_LT(host.error(a), 1e-13);
}

TEST(Ma27, SmallArraysAreToldWhatTheyNeed) {
  const Kkt a = kkt(12, 4);
  Ma27 host(a);
  ASSERT_EQ(host.analyse(), 0);
  const int reals = host.reals, integers = host.integers;
  host.reals = reals - 1;
  EXPECT_EQ(host.factorize(a.values), -4);
  EXPECT_EQ(host.info[1], reals);
  host.reals = reals;
  host.integers = integers - 1;
  EXPECT_EQ(host.factorize(a.values), -3);
  EXPECT_EQ(host.info[1], integers);
  host.integers = integers;
  ASSERT_EQ(host.factorize(a.values), 0);
  EXPECT_LT(host.error(a), 1e-13);
}

TEST(Ma57, NoArgumentsAtAll) {
  const Library library(ESPALIER_HSL);
  Integers info(40);
  library.function<void(void*, void*)>("ma57id_")(nullptr, nullptr);
  using Ten = void(void*, void*, void*, void*, void*, void*, void*, void*, int*, void*);
  library.function<Ten>("ma57ad_")(nullptr, nullptr, nullptr, nullptr, nullptr, nullptr, nullptr, nullptr, info.data(),
                                   nullptr);
  EXPECT_LT(info[0], 0);
  library.function<Ten>("ma57ad_")(nullptr, nullptr, nullptr, nullptr, nullptr, nullptr, nullptr, nullptr, nullptr,
                                   nullptr);
}

}  // namespace
}  // namespace espalier::test
