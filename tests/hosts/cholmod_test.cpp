// The interface of CHOLMOD in libespalier_cholmod.so, as hosts call it. Truths: known solutions, and what the real
// library (which must be there: ours does the numeric part alone) answers to the same calls.
#include <suitesparse/SuiteSparse_config.h>
//
#include <suitesparse/cholmod_core.h>

#include <climits>
#include <cmath>
#include <random>
#include <vector>

#include "hosts/library.hpp"

namespace espalier::test {
namespace {

using Long = SuiteSparse_long;
constexpr int kWhole = 0, kForward = 4;  // CHOLMOD_A, CHOLMOD_L

// The Laplacian on a grid of m^3, one triangle by columns, `shift` on the diagonal.
struct Grid {
  std::vector<Long> pointers{0}, indices;
  std::vector<double> values;
  std::size_t n;
  bool upper;
  explicit Grid(int m, double shift = 0.5, bool the_upper = true)
      : n(static_cast<std::size_t>(m) * m * m), upper(the_upper) {
    const Long size = static_cast<Long>(n);
    for (Long c = 0; c < size; ++c) {
      const Long x = c % m, y = c / m % m, z = c / (m * m);
      const auto add = [&](bool inside, Long row) {
        if (!inside || (upper ? row > c : row < c)) return;
        indices.push_back(row);
        values.push_back(row == c ? 6 + shift : -1);
      };
      add(z > 0, c - m * m);
      add(y > 0, c - m);
      add(x > 0, c - 1);
      add(true, c);
      add(x + 1 < m, c + 1);
      add(y + 1 < m, c + m);
      add(z + 1 < m, c + m * m);
      pointers.push_back(static_cast<Long>(indices.size()));
    }
  }
  cholmod_sparse sparse() {
    cholmod_sparse a{};
    a.nrow = a.ncol = n;
    a.nzmax = indices.size();
    a.p = pointers.data();
    a.i = indices.data();
    a.x = values.data();
    a.stype = upper ? 1 : -1;
    a.itype = CHOLMOD_LONG;
    a.xtype = CHOLMOD_REAL;
    a.dtype = CHOLMOD_DOUBLE;
    a.sorted = a.packed = 1;
    return a;
  }
  [[nodiscard]] std::vector<double> times(const std::vector<double>& x) const {
    std::vector<double> y(n, 0.0);
    for (std::size_t c = 0; c < n; ++c)
      for (Long k = pointers[c]; k < pointers[c + 1]; ++k) {
        y[indices[k]] += values[k] * x[c];
        if (indices[k] != static_cast<Long>(c)) y[c] += values[k] * x[indices[k]];
      }
    return y;
  }
};

std::vector<double> truth(std::size_t n) {
  std::vector<double> x(n);
  for (std::size_t k = 0; k < n; ++k) x[k] = 1 + static_cast<double>(k % 5);
  return x;
}

cholmod_dense dense(std::vector<double>& values, std::size_t n) {
  cholmod_dense b{};
  b.nrow = b.d = n;
  b.ncol = values.size() / n;
  b.nzmax = values.size();
  b.x = values.data();
  b.xtype = CHOLMOD_REAL;
  b.dtype = CHOLMOD_DOUBLE;
  return b;
}

constexpr int kLarge = 14;  // a factorization of 20 Mflop

class Cholmod : public ::testing::Test {
 protected:
  void SetUp() override {
    if (::dlopen("libcholmod.so.3", RTLD_NOW | RTLD_GLOBAL) == nullptr)
      GTEST_SKIP() << "libcholmod.so.3 is not installed";
    real<int(cholmod_common*)>("cholmod_l_start")(&common);
    common.print = 0;
    ::setenv("ESPALIER_SMALL", "ours", 1);
    log = std::string(::testing::TempDir()) + "cholmod_log_" + std::to_string(::getpid());
    ::setenv("ESPALIER_LOG", log.c_str(), 1);
    ::unlink(log.c_str());
  }
  void TearDown() override {
    if (log.empty()) return;
    if (factor != nullptr) ours<int(cholmod_factor**, cholmod_common*)>("cholmod_l_free_factor")(&factor, &common);
    real<int(cholmod_common*)>("cholmod_l_finish")(&common);
    EXPECT_EQ(common.malloc_count, 0u) << "what was allocated is not freed";
    ::unsetenv("ESPALIER_LOG");
    ::unsetenv("ESPALIER_SMALL");
    ::unlink(log.c_str());
  }
  template <class Function>
  Function* ours(const char* name) {
    return library.function<Function>(name);
  }
  template <class Function>
  Function* real(const char* name) {
    return reinterpret_cast<Function*>(::dlsym(::dlopen("libcholmod.so.3", RTLD_NOW | RTLD_NOLOAD), name));
  }
  [[nodiscard]] bool analyze(cholmod_sparse a) {
    factor = ours<cholmod_factor*(cholmod_sparse*, cholmod_common*)>("cholmod_l_analyze")(&a, &common);
    return factor != nullptr;
  }
  int factorize(cholmod_sparse a) {
    return ours<int(cholmod_sparse*, cholmod_factor*, cholmod_common*)>("cholmod_l_factorize")(&a, factor, &common);
  }
  cholmod_dense* solve(cholmod_dense b, int system = kWhole) {
    return ours<cholmod_dense*(int, cholmod_factor*, cholmod_dense*, cholmod_common*)>("cholmod_l_solve")(
        system, factor, &b, &common);
  }
  void free(cholmod_dense*& x) { real<int(cholmod_dense**, cholmod_common*)>("cholmod_l_free_dense")(&x, &common); }
  double rcond() { return ours<double(cholmod_factor*, cholmod_common*)>("cholmod_l_rcond")(factor, &common); }
  // Factorizations that ours has made.
  [[nodiscard]] int count() const {
    int lines = 0;
    if (std::FILE* file = std::fopen(log.c_str(), "r")) {
      for (int c; (c = std::fgetc(file)) != EOF;) lines += c == '\n' ? 1 : 0;
      std::fclose(file);
    }
    return lines;
  }
  void expect_solution(Grid& a, std::size_t columns = 1) {
    std::vector<double> b;
    for (std::size_t k = 0; k < columns; ++k) {
      const std::vector<double> one = a.times(truth(a.n));
      b.insert(b.end(), one.begin(), one.end());
    }
    cholmod_dense* x = solve(dense(b, a.n));
    ASSERT_NE(x, nullptr);
    for (std::size_t k = 0; k < b.size(); ++k)
      ASSERT_NEAR(static_cast<double*>(x->x)[k], truth(a.n)[k % a.n], 1e-11) << k;
    free(x);
  }

  Library library{ESPALIER_CHOLMOD};
  cholmod_common common{};
  cholmod_factor* factor = nullptr;
  std::string log;
};

TEST_F(Cholmod, EitherTriangleAndNewValues) {
  for (const bool upper : {true, false}) {
    Grid a(kLarge, 0.5, upper);
    ASSERT_TRUE(analyze(a.sparse()));
    EXPECT_EQ(common.nmethods, 0) << "the host's settings stay";
    ASSERT_EQ(factorize(a.sparse()), 1);
    EXPECT_EQ(common.status, CHOLMOD_OK);
    EXPECT_EQ(factor->minor, a.n);
    EXPECT_GT(rcond(), 0.01);
    expect_solution(a, 3);
    for (double& v : a.values) v *= 2;
    ASSERT_EQ(factorize(a.sparse()), 1);
    expect_solution(a);
    ours<int(cholmod_factor**, cholmod_common*)>("cholmod_l_free_factor")(&factor, &common);
    EXPECT_EQ(factor, nullptr);
  }
  EXPECT_EQ(count(), 4) << "ours has factorized";
}

// Columns with room between them, entries in no order, and entries of the other triangle, which are none.
TEST_F(Cholmod, UnpackedMatrices) {
  Grid a(kLarge);
  std::vector<Long> pointers{0}, indices, lengths;
  std::vector<double> values;
  for (std::size_t c = 0; c < a.n; ++c) {
    lengths.push_back(a.pointers[c + 1] - a.pointers[c]);
    for (Long k = a.pointers[c + 1] - 1; k >= a.pointers[c]; --k) {
      indices.push_back(a.indices[k]);
      values.push_back(a.values[k]);
    }
    if (c + 1 < a.n) {
      lengths.back() += 1;
      indices.push_back(static_cast<Long>(a.n) - 1);
      values.push_back(1e6);
    }
    indices.push_back(-77);
    values.push_back(std::nan(""));
    pointers.push_back(static_cast<Long>(indices.size()));
  }
  cholmod_sparse m = a.sparse();
  m.p = pointers.data();
  m.i = indices.data();
  m.x = values.data();
  m.nz = lengths.data();
  m.nzmax = indices.size();
  m.sorted = m.packed = 0;
  ASSERT_TRUE(analyze(m));
  ASSERT_EQ(factorize(m), 1);
  expect_solution(a);
  EXPECT_EQ(count(), 1);
}

TEST_F(Cholmod, SmallOnesAreTheRealLibrarys) {
  ::unsetenv("ESPALIER_SMALL");
  Grid a(4);
  ASSERT_TRUE(analyze(a.sparse()));
  for (int round = 0; round < 20; ++round) {
    ASSERT_EQ(factorize(a.sparse()), 1);
    expect_solution(a);
  }
  EXPECT_EQ(count(), 0);
}

// Once the real library has spent enough on a pattern, ours goes on; a large one is ours at once.
TEST_F(Cholmod, PatternsThatComeAgainBecomeOurs) {
  ::unsetenv("ESPALIER_SMALL");
  Grid a(kLarge);
  ASSERT_TRUE(analyze(a.sparse()));
  ASSERT_EQ(factorize(a.sparse()), 1);
  expect_solution(a);
  EXPECT_EQ(count(), 0);
  for (int round = 0; round < 200 && count() == 0; ++round) ASSERT_EQ(factorize(a.sparse()), 1);
  EXPECT_EQ(count(), 1);
  expect_solution(a);
  ours<int(cholmod_factor**, cholmod_common*)>("cholmod_l_free_factor")(&factor, &common);
  Grid large(30);
  ASSERT_TRUE(analyze(large.sparse()));
  ASSERT_EQ(factorize(large.sparse()), 1);
  EXPECT_EQ(count(), 2);
  expect_solution(large);
}

// A host that wants more than solutions finds the factor as the real library makes it.
TEST_F(Cholmod, FactorsHandedOut) {
  Grid a(kLarge);
  ASSERT_TRUE(analyze(a.sparse()));
  ASSERT_EQ(factorize(a.sparse()), 1);
  std::vector<double> b = truth(a.n);
  cholmod_dense* y = solve(dense(b, a.n), kForward);  // L y = b in the factor's order
  ASSERT_NE(y, nullptr);
  EXPECT_EQ(factor->xtype, CHOLMOD_REAL);
  auto* copy = ours<cholmod_factor*(cholmod_factor*, cholmod_common*)>("cholmod_l_copy_factor")(factor, &common);
  auto* lower = ours<cholmod_sparse*(cholmod_factor*, cholmod_common*)>("cholmod_l_factor_to_sparse")(copy, &common);
  ASSERT_NE(lower, nullptr);
  std::vector<double> product(a.n, 0.0);
  const auto* p = static_cast<Long*>(lower->p);
  const bool unit = factor->is_ll == 0;  // the diagonal is D
  for (std::size_t c = 0; c < a.n; ++c)
    for (Long k = p[c]; k < p[c + 1]; ++k) {
      const Long row = static_cast<Long*>(lower->i)[k];
      const double v = unit && row == static_cast<Long>(c) ? 1 : static_cast<double*>(lower->x)[k];
      product[row] += v * static_cast<double*>(y->x)[c];
    }
  for (std::size_t k = 0; k < a.n; ++k) ASSERT_NEAR(product[k], b[k], 1e-12);
  real<int(cholmod_sparse**, cholmod_common*)>("cholmod_l_free_sparse")(&lower, &common);
  ours<int(cholmod_factor**, cholmod_common*)>("cholmod_l_free_factor")(&copy, &common);
  free(y);
  expect_solution(a);
}

TEST_F(Cholmod, SparseRightHandSides) {
  Grid a(kLarge);
  ASSERT_TRUE(analyze(a.sparse()));
  ASSERT_EQ(factorize(a.sparse()), 1);
  Long pointers[] = {0, 1}, row = 5;
  double value = 2;
  cholmod_sparse b{};
  b.nrow = a.n;
  b.ncol = b.nzmax = 1;
  b.p = pointers;
  b.i = &row;
  b.x = &value;
  b.itype = CHOLMOD_LONG;
  b.xtype = CHOLMOD_REAL;
  b.packed = b.sorted = 1;
  auto* x = ours<cholmod_sparse*(int, cholmod_factor*, cholmod_sparse*, cholmod_common*)>("cholmod_l_spsolve")(
      kWhole, factor, &b, &common);
  ASSERT_NE(x, nullptr);
  std::vector<double> full(a.n, 0.0);
  for (Long k = 0; k < static_cast<Long*>(x->p)[1]; ++k)
    full[static_cast<Long*>(x->i)[k]] = static_cast<double*>(x->x)[k];
  const std::vector<double> product = a.times(full);
  for (std::size_t k = 0; k < a.n; ++k) ASSERT_NEAR(product[k], k == 5 ? 2 : 0, 1e-12);
  real<int(cholmod_sparse**, cholmod_common*)>("cholmod_l_free_sparse")(&x, &common);
}

// What is not positive definite ends as the real library says.
TEST_F(Cholmod, IndefiniteMatrices) {
  Grid a(kLarge, -4);
  ASSERT_TRUE(analyze(a.sparse()));
  factorize(a.sparse());
  const int status = common.status;
  const std::size_t minor = factor->minor;
  cholmod_sparse m = a.sparse();
  auto* other = real<cholmod_factor*(cholmod_sparse*, cholmod_common*)>("cholmod_l_analyze")(&m, &common);
  real<int(cholmod_sparse*, cholmod_factor*, cholmod_common*)>("cholmod_l_factorize")(&m, other, &common);
  EXPECT_EQ(status, common.status);
  EXPECT_EQ(minor == a.n, other->minor == a.n);
  EXPECT_LT(minor, a.n);
  real<int(cholmod_factor**, cholmod_common*)>("cholmod_l_free_factor")(&other, &common);
  // The same factor serves a definite one afterwards.
  Grid good(kLarge);
  common.status = CHOLMOD_OK;
  ASSERT_EQ(factorize(good.sparse()), 1);
  EXPECT_EQ(factor->minor, a.n);
  expect_solution(good);
}

TEST_F(Cholmod, Mistakes) {
  Grid a(kLarge);
  EXPECT_EQ((ours<cholmod_factor*(cholmod_sparse*, cholmod_common*)>("cholmod_l_analyze")(nullptr, &common)), nullptr);
  EXPECT_EQ((ours<cholmod_factor*(cholmod_sparse*, cholmod_common*)>("cholmod_l_analyze")(nullptr, nullptr)), nullptr);
  EXPECT_EQ(factorize(a.sparse()), 0) << "no factor";
  ASSERT_TRUE(analyze(a.sparse()));
  std::vector<double> b = truth(a.n);
  EXPECT_EQ((ours<cholmod_dense*(int, cholmod_factor*, cholmod_dense*, cholmod_common*)>("cholmod_l_solve")(
                kWhole, factor, nullptr, &common)),
            nullptr);
  ASSERT_EQ(factorize(a.sparse()), 1);
  EXPECT_EQ(solve(dense(b, 10)), nullptr) << "another length";
  EXPECT_EQ(solve(dense(b, a.n), 99), nullptr);
  ours<int(cholmod_factor**, cholmod_common*)>("cholmod_l_free_factor")(nullptr, &common);
}

TEST_F(Cholmod, AnyMatrix) {
  std::mt19937 random(3);
  Grid good(kLarge);
  int solved = 0, refused = 0;
  for (int round = 0; round < 60; ++round) {
    Grid a = good;
    cholmod_sparse m = a.sparse();
    const int what = static_cast<int>(random() % 6);
    if (what == 0) m.stype = static_cast<int>(random() % 3) - 1;
    if (what == 1) m.xtype = static_cast<int>(random() % 4);
    if (what == 2) m.itype = static_cast<int>(random() % 3);
    if (what == 3) m.x = nullptr;
    if (what == 4) a.values[random() % a.values.size()] = std::nan("");
    ASSERT_TRUE(analyze(good.sparse()));
    const bool whole = what == 5 || (what == 0 && m.stype == 1) || (what == 1 && m.xtype == CHOLMOD_REAL) ||
                       (what == 2 && m.itype == CHOLMOD_LONG);
    if (what != 4 && !whole && m.itype != CHOLMOD_LONG) m.xtype = CHOLMOD_PATTERN;  // the real one would read integers
    const int done = factorize(m);
    if (whole) {
      ASSERT_EQ(done, 1) << what;
      expect_solution(good);
    }
    (done == 1 && common.status == CHOLMOD_OK ? solved : refused) += 1;
    ours<int(cholmod_factor**, cholmod_common*)>("cholmod_l_free_factor")(&factor, &common);
    common.status = CHOLMOD_OK;
  }
  EXPECT_GT(solved, 10);
  EXPECT_GT(refused, 10);
}

TEST(CholmodLibrary, ShowsItsNamesAlone) {
  const Library library(ESPALIER_CHOLMOD);
  EXPECT_NE(library.dynamic_section().find("NODELETE"), std::string::npos);
  EXPECT_EQ(library.dynamic_section().find("libcholmod"), std::string::npos) << "the real one is the host's";
  for (const std::string& name : library.names()) EXPECT_TRUE(name.starts_with("cholmod_")) << name;
}

}  // namespace
}  // namespace espalier::test
