// The interface of MUMPS in libespalier_mumps.so, as hosts call it. Truths: known solutions, inertia by construction,
// the error codes of its guide, and the real library where it is installed.
#include <dmumps_c.h>
#include <unistd.h>

#include <climits>
#include <cmath>
#include <random>
#include <vector>

#include "hosts/kkt.hpp"
#include "hosts/library.hpp"

namespace espalier::test {
namespace {

struct Coordinates {
  int n = 0;
  std::vector<int> rows, columns;
  std::vector<double> values;
  void add(int row, int column, double value) {
    rows.push_back(row + 1);
    columns.push_back(column + 1);
    values.push_back(value);
  }
  [[nodiscard]] std::vector<double> times(const std::vector<double>& x, bool symmetric, bool transposed = false) const {
    std::vector<double> y(x.size(), 0.0);
    for (std::size_t k = 0; k < values.size(); ++k) {
      const int r = rows[k] - 1, c = columns[k] - 1;
      if (!transposed || symmetric) y[r] += values[k] * x[c];
      if (transposed || (symmetric && r != c)) y[c] += values[k] * x[r];
    }
    return y;
  }
};

// -1 4 -1 (lower triangle), or with 0.5 three to the right and all of it; each value given in two parts.
Coordinates chain(int n, bool symmetric, double diagonal = 4) {
  Coordinates a;
  a.n = n;
  for (int r = 0; r < n; ++r) {
    a.add(r, r, diagonal - 1);
    a.add(r, r, 1);
    if (r > 0) a.add(r, r - 1, -1);
    if (!symmetric && r + 3 < n) a.add(r, r + 3, 0.5);
  }
  return a;
}

std::vector<double> truth(int n) {
  std::vector<double> x(n);
  for (int k = 0; k < n; ++k) x[k] = 1 + k % 5;
  return x;
}

struct Host {
  Variable small{"ESPALIER_SMALL", "ours"};
  Library library{ESPALIER_MUMPS};
  void (*dmumps)(DMUMPS_STRUC_C*) = library.function<void(DMUMPS_STRUC_C*)>("dmumps_c");
  DMUMPS_STRUC_C id{};
  explicit Host(int sym) {
    id.sym = sym;
    id.par = 1;
    id.comm_fortran = -987654;
    EXPECT_EQ(call(-1), 0);
    id.icntl[0] = id.icntl[1] = id.icntl[2] = -1;
    id.icntl[3] = 0;
  }
  ~Host() { call(-2); }
  int call(int job) {
    id.job = job;
    dmumps(&id);
    return id.infog[0];
  }
  int call(int job, Coordinates& a) {
    id.n = a.n;
    id.nnz = static_cast<std::int64_t>(a.values.size());
    id.irn = a.rows.data();
    id.jcn = a.columns.data();
    id.a = a.values.data();
    return call(job);
  }
  int solve(std::vector<double>& x) {
    id.rhs = x.data();
    return call(3);
  }
};

TEST(Mumps, AllSymmetries) {
  for (const int sym : {0, 1, 2}) {
    Coordinates a = chain(60, sym != 0);
    Host host(sym);
    std::vector<double> x = a.times(truth(60), sym != 0);
    host.id.rhs = x.data();
    ASSERT_EQ(host.call(6, a), 0) << sym;
    for (int k = 0; k < 60; ++k) ASSERT_NEAR(x[k], truth(60)[k], 1e-13) << sym;
    EXPECT_GT(host.id.infog[8], 60);
    // Step by step, with new values, transposed, several right-hand sides with room between them.
    ASSERT_EQ(host.call(1, a), 0);
    ASSERT_EQ(host.call(2, a), 0);
    for (double& v : a.values) v *= 2;
    ASSERT_EQ(host.call(2, a), 0);
    if (sym == 0) host.id.icntl[8] = 0;
    const std::vector<double> b = a.times(truth(60), sym != 0, sym == 0);
    std::vector<double> two(130, 7.0);
    for (const int c : {0, 65}) std::copy(b.begin(), b.end(), two.begin() + c);
    host.id.nrhs = 2;
    host.id.lrhs = 65;
    ASSERT_EQ(host.solve(two), 0);
    for (int k = 0; k < 60; ++k) ASSERT_NEAR(two[k], truth(60)[k], 1e-13);
    for (int k = 0; k < 60; ++k) ASSERT_NEAR(two[k + 65], truth(60)[k], 1e-13);
    EXPECT_EQ(two[62], 7);
  }
}

TEST(Mumps, Inertia) {
  const Kkt saddle = kkt(200, 60, 3);
  Coordinates a;
  a.n = saddle.n;
  a.rows = saddle.rows;
  a.columns = saddle.columns();
  a.values = saddle.values;
  Host host(2);
  ASSERT_EQ(host.call(1, a), 0);
  ASSERT_EQ(host.call(2, a), 0);
  EXPECT_EQ(host.id.infog[11], saddle.negative);
  std::vector<double> x = saddle.times(truth(a.n)), b = x;
  ASSERT_EQ(host.solve(x), 0);
  EXPECT_LT(saddle.backward_error(x, b), 1e-12);
  // Two constraints that say the same.
  const Kkt twice = kkt(200, 60, 0, 1);
  a.n = twice.n;
  a.rows = twice.rows;
  a.columns = twice.columns();
  a.values = twice.values;
  EXPECT_EQ(host.call(4, a), -10);
  EXPECT_EQ(host.solve(x), -3) << "there is no factor";
  // Declared positive definite, and not.
  Coordinates negative = chain(30, true, -4);
  Host other(1);
  ASSERT_EQ(other.call(4, negative), 0);
  EXPECT_EQ(other.id.infog[11], 30);
  std::vector<double> y = negative.times(truth(30), true);
  ASSERT_EQ(other.solve(y), 0);
  EXPECT_NEAR(y[3], 4, 1e-12);
}

TEST(Mumps, SparseRightHandSidesInverseAndDeterminant) {
  Coordinates a;
  a.n = 2;  // [2 1; 5 1]: det -3, inverse [-1 1; 5 -2] / 3
  a.add(0, 0, 2);
  a.add(0, 1, 1);
  a.add(1, 0, 5);
  a.add(1, 1, 1);
  Host host(0);
  host.id.icntl[32] = 1;
  ASSERT_EQ(host.call(4, a), 0);
  EXPECT_NEAR(host.id.rinfog[11] * std::exp2(host.id.infog[33]), -3, 1e-14);
  int pointers[] = {1, 2, 4}, rows[] = {2, 1, 2};
  double values[] = {6, 3, 0}, x[4];
  host.id.icntl[19] = 1;
  host.id.nrhs = 2;
  host.id.lrhs = 2;
  host.id.nz_rhs = 3;
  host.id.irhs_ptr = pointers;
  host.id.irhs_sparse = rows;
  host.id.rhs_sparse = values;
  host.id.rhs = x;
  ASSERT_EQ(host.call(3), 0);
  const double expected[] = {2, -4, -1, 5};
  for (int k = 0; k < 4; ++k) EXPECT_NEAR(x[k], expected[k], 1e-14);
  host.id.icntl[19] = 0;
  host.id.icntl[29] = 1;
  ASSERT_EQ(host.call(3), 0);
  EXPECT_NEAR(values[0], 5.0 / 3, 1e-14);
  EXPECT_NEAR(values[1], 1.0 / 3, 1e-14);
  EXPECT_NEAR(values[2], -2.0 / 3, 1e-14);
}

TEST(Mumps, Mistakes) {
  Coordinates a = chain(12, false);
  std::vector<double> x(12, 1.0);
  Host host(0);
  host.id.rhs = x.data();
  EXPECT_EQ(host.call(3, a), -3) << "nothing is factorized";
  EXPECT_EQ(host.call(2, a), -3);
  EXPECT_EQ(host.call(17, a), -3);
  ASSERT_EQ(host.call(1, a), 0);
  host.id.a = nullptr;
  EXPECT_EQ(host.call(2), -22);
  EXPECT_EQ(host.id.infog[1], 4);
  ASSERT_EQ(host.call(2, a), 0);
  host.id.rhs = nullptr;
  EXPECT_EQ(host.call(3), -22);
  EXPECT_EQ(host.id.infog[1], 7);
  host.id.rhs = x.data();
  host.id.nrhs = 2;
  host.id.lrhs = 5;
  EXPECT_EQ(host.call(3), -26);
  host.id.nrhs = 1;
  host.id.icntl[20] = 1;
  EXPECT_LT(host.call(3), 0) << "a distributed solution";
  host.id.icntl[20] = 0;
  EXPECT_EQ(host.call(3), 0);
  // Entries that are none are left out, with a warning.
  Coordinates outside = a;
  outside.add(12, 0, 1);
  outside.add(-3, 2, 1);
  EXPECT_EQ(host.call(4, outside), 1);
  EXPECT_EQ(host.id.infog[1], 2);
  std::vector<double> b = a.times(truth(12), false);
  EXPECT_GE(host.solve(b), 0);
  EXPECT_NEAR(b[2], 3, 1e-13);
  host.dmumps(nullptr);
}

TEST(Mumps, SingularMatrices) {
  for (const int sym : {0, 2}) {
    Coordinates a;  // [1 2; 2 4]
    a.n = 2;
    a.add(0, 0, 1);
    a.add(1, 0, 2);
    if (sym == 0) a.add(0, 1, 2);
    a.add(1, 1, 4);
    Host host(sym);
    EXPECT_EQ(host.call(4, a), -10) << sym;
  }
}

// Elements, Schur complements and null pivots are not ours.
TEST(Mumps, TheRestIsTheRealLibrarys) {
  if (::dlopen("libdmumps_seq-" MUMPS_VERSION ".so", RTLD_LAZY) == nullptr &&
      ::dlopen("libdmumps_seq-5.5.so", RTLD_LAZY) == nullptr)
    GTEST_SKIP() << "libdmumps_seq is not installed";
  Coordinates a = chain(20, true);
  Host host(2);
  int schur_rows[] = {19, 20};
  double schur[4] = {};
  host.id.icntl[18] = 1;
  host.id.size_schur = 2;
  host.id.listvar_schur = schur_rows;
  host.id.schur = schur;
  ASSERT_EQ(host.call(4, a), 0);
  EXPECT_NEAR(schur[3], 4, 1e-14) << "nothing but row 19 couples with the last";
  EXPECT_LT(schur[0], 3.8);
  host.id.icntl[18] = 0;  // and back
  ASSERT_EQ(host.call(4, a), 0);
  std::vector<double> x = a.times(truth(20), true);
  ASSERT_EQ(host.solve(x), 0);
  EXPECT_NEAR(x[3], 4, 1e-13);
}

TEST(Mumps, SmallSystemsAreTheRealLibrarys) {
  if (::dlopen("libdmumps_seq-5.5.so", RTLD_LAZY) == nullptr) GTEST_SKIP() << "libdmumps_seq-5.5 is not installed";
  const std::string log = std::string(::testing::TempDir()) + "mumps_log_" + std::to_string(::getpid());
  const Variable logged("ESPALIER_LOG", log);
  for (const int sym : {0, 2}) {
    for (const int n : {40, 8000}) {
      Host host(sym);
      ::unsetenv("ESPALIER_SMALL");
      Coordinates a = chain(n, sym != 0);
      std::vector<double> x = a.times(truth(n), sym != 0);
      host.id.rhs = x.data();
      ASSERT_EQ(host.call(6, a), 0);
      for (int k = 0; k < n; ++k) ASSERT_NEAR(x[k], truth(n)[k], 1e-12);
      EXPECT_EQ(::access(log.c_str(), F_OK) == 0, sym == 2 || n == 8000) << sym << " " << n;
      ::unlink(log.c_str());
    }
  }
}

TEST(Mumps, AnyArguments) {
  std::mt19937 random(9);
  const Coordinates good = chain(10, false);
  const int ends[] = {INT_MIN, -1, 0, 1, 10, 11, INT_MAX};
  int solved = 0, refused = 0;
  for (int round = 0; round < 500; ++round) {
    Coordinates a = good;
    Host host(static_cast<int>(random() % 4 == 0 ? 2 : 0));
    if (random() % 2 == 0)
      a.rows[random() % a.rows.size()] = a.columns[random() % a.rows.size()] = ends[random() % std::size(ends)];
    if (random() % 3 == 0) a.values[random() % a.values.size()] = std::nan("");
    const int jobs[] = {1, 2, 3, 4, 5, 6};
    std::vector<double> x = good.times(truth(10), false);
    host.id.rhs = x.data();
    if (random() % 4 == 0) host.call(jobs[random() % 6], a);
    const bool whole = a.rows == good.rows && a.columns == good.columns && a.values == good.values && host.id.sym == 0;
    x = good.times(truth(10), false);
    host.id.rhs = x.data();
    const int error = host.call(6, a);
    if (whole) {
      ASSERT_EQ(error, 0);
      for (int k = 0; k < 10; ++k) ASSERT_NEAR(x[k], truth(10)[k], 1e-12);
    }
    (error == 0 ? solved : refused) += 1;  // entries left out are a warning
  }
  EXPECT_GT(solved, 100);
  EXPECT_GT(refused, 100);
}

TEST(Mumps, ShowsItsNameAlone) {
  const Library library(ESPALIER_MUMPS);
  EXPECT_NE(library.dynamic_section().find("NODELETE"), std::string::npos);
  EXPECT_EQ(library.names(), std::set<std::string>{"dmumps_c"});
}

}  // namespace
}  // namespace espalier::test
