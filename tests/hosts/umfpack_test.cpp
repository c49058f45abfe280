// The interface of UMFPACK in libespalier_umfpack.so, as hosts call it. Truths: known solutions, a determinant in
// closed form, the error codes of UMFPACK 5.7 for the same calls, and its own objects where it is installed.
#include <sys/wait.h>
#include <unistd.h>

#include <algorithm>
#include <climits>
#include <cmath>
#include <cstdint>
#include <random>
#include <vector>

#include "hosts/library.hpp"

namespace espalier::test {
namespace {

constexpr int kA = 0, kAt = 1, kLowerFactor = 4, kRcond = 67;

// By columns: 4 on the diagonal, -1 above, 0.5 three below.
template <class Int>
struct Columns {
  std::vector<Int> pointers{0}, indices;
  std::vector<double> values;
  explicit Columns(Int n) {
    for (Int c = 0; c < n; ++c) {
      if (c > 0) add(c - 1, -1);
      add(c, 4);
      if (c + 3 < n) add(c + 3, 0.5);
      pointers.push_back(static_cast<Int>(indices.size()));
    }
  }
  void add(Int row, double value) {
    indices.push_back(row);
    values.push_back(value);
  }
  [[nodiscard]] Int n() const { return static_cast<Int>(pointers.size()) - 1; }
  [[nodiscard]] std::vector<double> times(const std::vector<double>& x, bool transposed) const {
    std::vector<double> y(x.size(), 0.0);
    for (Int c = 0; c < n(); ++c)
      for (Int k = pointers[c]; k < pointers[c + 1]; ++k)
        (transposed ? y[c] : y[indices[k]]) += values[k] * x[transposed ? indices[k] : c];
    return y;
  }
};

std::vector<double> truth(std::size_t n) {
  std::vector<double> x(n);
  for (std::size_t k = 0; k < n; ++k) x[k] = 1 + static_cast<double>(k % 5);
  return x;
}

template <class Int>
struct Host {
  Variable small{"ESPALIER_SMALL", "ours"};
  Library library{ESPALIER_UMFPACK};
  void *symbolic = nullptr, *numeric = nullptr;
  double info[90] = {};

  template <class Function>
  Function* function(const char* what) const {
    return library.function<Function>((std::string(sizeof(Int) == 4 ? "umfpack_di_" : "umfpack_dl_") + what).c_str());
  }
  Int analyze(const Columns<Int>& a) {
    return analyze(a.n(), a.n(), a.pointers.data(), a.indices.data(), a.values.data());
  }
  Int analyze(Int n, Int m, const Int* p, const Int* i, const double* v) {
    return function<Int(Int, Int, const Int*, const Int*, const double*, void**, const double*, double*)>("symbolic")(
        n, m, p, i, v, &symbolic, nullptr, info);
  }
  Int factorize(const Columns<Int>& a) {
    return factorize(a.pointers.data(), a.indices.data(), a.values.data(), symbolic);
  }
  Int factorize(const Int* p, const Int* i, const double* v, void* with) {
    return function<Int(const Int*, const Int*, const double*, void*, void**, const double*, double*)>("numeric")(
        p, i, v, with, &numeric, nullptr, info);
  }
  Int solve(Int system, const Columns<Int>& a, double* x, const double* b) {
    return function<Int(Int, const Int*, const Int*, const double*, double*, const double*, void*, const double*,
                        double*)>("solve")(system, a.pointers.data(), a.indices.data(), a.values.data(), x, b, numeric,
                                           nullptr, info);
  }
  void end_symbolic() { function<void(void**)>("free_symbolic")(&symbolic); }
  void end_numeric() { function<void(void**)>("free_numeric")(&numeric); }
  // Objects of ours, if any, are gone; what the fuzz has made of the pointers is not asked.
  ~Host() {
    if (symbolic != nullptr) end_symbolic();
    if (numeric != nullptr) end_numeric();
  }
};

bool real_library_is_there() { return ::dlopen("libumfpack.so.5", RTLD_LAZY) != nullptr; }

template <class Int>
void solve_both_ways() {
  const Columns<Int> a(70);
  Host<Int> host;
  ASSERT_EQ(host.analyze(a), 0);
  ASSERT_EQ(host.factorize(a), 0);
  EXPECT_GT(host.info[kRcond], 0.01);
  EXPECT_LE(host.info[kRcond], 1);
  host.end_symbolic();  // as hosts do, before they solve
  EXPECT_EQ(host.symbolic, nullptr);
  for (const Int system : {kA, kAt}) {
    const std::vector<double> b = a.times(truth(70), system == kAt);
    std::vector<double> x(70);
    ASSERT_EQ(host.solve(system, a, x.data(), b.data()), 0);
    for (int k = 0; k < 70; ++k) ASSERT_NEAR(x[k], truth(70)[k], 1e-13) << k;
  }
  host.end_numeric();
  EXPECT_EQ(host.numeric, nullptr);
  host.end_numeric();
}

TEST(Umfpack, BothIntegers) {
  solve_both_ways<std::int32_t>();
  solve_both_ways<std::int64_t>();
}

// Several factors of one Symbolic live beside each other.
TEST(Umfpack, FactorsOfOnePattern) {
  Columns<std::int64_t> a(40);
  Host<std::int64_t> host;
  ASSERT_EQ(host.analyze(a), 0);
  std::vector<void*> factors;
  for (int m = 1; m <= 3; ++m) {
    Columns<std::int64_t> scaled = a;
    for (double& v : scaled.values) v *= m;
    ASSERT_EQ(host.factorize(scaled), 0);
    factors.push_back(host.numeric);
  }
  const std::vector<double> b = a.times(truth(40), false);
  for (int m = 3; m >= 1; --m) {
    host.numeric = factors[m - 1];
    std::vector<double> x(40);
    ASSERT_EQ(host.solve(kA, a, x.data(), b.data()), 0);
    for (int k = 0; k < 40; ++k) ASSERT_NEAR(x[k] * m, truth(40)[k], 1e-12);
    host.end_numeric();
  }
}

// Rows of 1e-9 and 1e9 in turn: the order of the first values serves, their scaling does not.
TEST(Umfpack, OtherValues) {
  Columns<std::int32_t> a(50);
  Host<std::int32_t> host;
  ASSERT_EQ(host.analyze(a), 0);
  ASSERT_EQ(host.factorize(a), 0);
  host.end_numeric();
  for (std::size_t k = 0; k < a.values.size(); ++k) a.values[k] *= a.indices[k] % 2 == 0 ? 1e-9 : 1e9;
  ASSERT_GE(host.factorize(a), 0);
  const std::vector<double> b = a.times(truth(50), false);
  std::vector<double> x(50);
  ASSERT_GE(host.solve(kA, a, x.data(), b.data()), 0);
  for (int k = 0; k < 50; ++k) ASSERT_NEAR(x[k], truth(50)[k], 1e-12);
}

TEST(Umfpack, Determinant) {
  Columns<std::int64_t> a(0);  // [2 1; 5 1]: -3
  a.pointers = {0, 2, 4};
  a.indices = {0, 1, 0, 1};
  a.values = {2, 5, 1, 1};
  Host<std::int64_t> host;
  ASSERT_EQ(host.analyze(a), 0);
  ASSERT_EQ(host.factorize(a), 0);
  double mantissa = 0, exponent = 0;
  const auto determinant = host.function<std::int64_t(double*, double*, void*, double*)>("get_determinant");
  ASSERT_EQ(determinant(&mantissa, nullptr, host.numeric, nullptr), 0);
  EXPECT_NEAR(mantissa, -3, 1e-14);
  ASSERT_EQ(determinant(&mantissa, &exponent, host.numeric, nullptr), 0);
  EXPECT_NEAR(mantissa * std::pow(10, exponent), -3, 1e-14);
}

TEST(Umfpack, Mistakes) {
  const Columns<std::int32_t> a(12);
  const auto* p = a.pointers.data();
  const auto* i = a.indices.data();
  const auto* v = a.values.data();
  Host<std::int32_t> host;
  EXPECT_EQ(host.analyze(0, 0, p, i, v), -6);
  EXPECT_EQ(host.analyze(-3, -3, p, i, v), -6);
  EXPECT_EQ(host.analyze(12, 12, nullptr, i, v), -5);
  EXPECT_EQ(host.analyze(12, 12, p, nullptr, v), -5);
  for (const int row : {-1, 12, INT_MAX, INT_MIN, 1}) {
    Columns<std::int32_t> bad = a;
    bad.indices[4] = row == 1 ? bad.indices[3] : row;  // the last: the same row twice
    EXPECT_EQ(host.analyze(bad), -8) << row;
  }
  Columns<std::int32_t> falling = a;
  falling.pointers[4] = 1;
  EXPECT_EQ(host.analyze(falling), -8);
  EXPECT_EQ(host.factorize(p, i, v, nullptr), -4);
  ASSERT_EQ(host.analyze(a), 0);
  EXPECT_EQ(host.factorize(p, i, nullptr, host.symbolic), -5);
  Columns<std::int32_t> other = a;
  other.indices[2] = 5;
  EXPECT_EQ(host.factorize(other), -11);
  ASSERT_EQ(host.factorize(a), 0);
  double x[12], b[12] = {};
  EXPECT_EQ(host.solve(kA, a, nullptr, b), -5);
  EXPECT_EQ(host.solve(kA, a, x, nullptr), -5);
  EXPECT_EQ(host.solve(15, a, x, b), -13);
  EXPECT_EQ(host.solve(-1, a, x, b), -13);
  host.end_numeric();
  EXPECT_EQ(host.solve(kA, a, x, b), -3);
}

TEST(Umfpack, SingularMatrices) {
  Columns<std::int64_t> a(0);  // [1 2; 2 4]
  a.pointers = {0, 2, 4};
  a.indices = {0, 1, 0, 1};
  a.values = {1, 2, 2, 4};
  Host<std::int64_t> host;
  ASSERT_EQ(host.analyze(a), 0);
  EXPECT_EQ(host.factorize(a), 1) << "a warning, and an object";
  EXPECT_LT(host.info[kRcond], 1e-16);
  EXPECT_NE(host.numeric, nullptr);
  double x[2] = {7, 7};
  const double b[2] = {1, 2};
  EXPECT_EQ(host.solve(kA, a, x, b), 1);
  Columns<std::int64_t> empty(0);  // a column of nothing
  empty.pointers = {0, 2, 2};
  empty.indices = {0, 1};
  empty.values = {1, 2};
  Host<std::int64_t> other;
  ASSERT_EQ(other.analyze(empty), 0);
  EXPECT_EQ(other.factorize(empty), 1);
}

// What we do not do is done by the real library, with the same objects in the host's hands.
TEST(Umfpack, TheRestIsTheRealLibrarys) {
  if (!real_library_is_there()) GTEST_SKIP() << "libumfpack.so.5 is not installed";
  const Columns<std::int32_t> a(30);
  for (int round = 0; round < 3; ++round) {  // from the second one on the real library works from the beginning
    Host<std::int32_t> host;
    ASSERT_EQ(host.analyze(a), 0);
    ASSERT_EQ(host.factorize(a), 0);
    int lower = 0, upper = 0, n = 0, m = 0, diagonal = 0;
    ASSERT_EQ((host.function<int(int*, int*, int*, int*, int*, void*)>("get_lunz")(&lower, &upper, &n, &m, &diagonal,
                                                                                   host.numeric)),
              0);
    EXPECT_EQ(n, 30);
    EXPECT_EQ(diagonal, 30);
    std::vector<int> lp(31), lj(lower), up(31), ui(upper), p(30), q(30);
    std::vector<double> lx(lower), ux(upper), d(30), scale(30);
    int reciprocal = 0;
    using Get = int(int*, int*, double*, int*, int*, double*, int*, int*, double*, int*, double*, void*);
    ASSERT_EQ(host.function<Get>("get_numeric")(lp.data(), lj.data(), lx.data(), up.data(), ui.data(), ux.data(),
                                                p.data(), q.data(), d.data(), &reciprocal, scale.data(), host.numeric),
              0);
    // |det A| is that of U over the scale factors.
    double log_det = 0;
    for (int k = 0; k < 30; ++k) log_det += std::log(std::abs(d[k])) + (reciprocal ? -1 : 1) * std::log(scale[k]);
    double mantissa = 0, exponent = 0;
    ASSERT_EQ((host.function<int(double*, double*, void*, double*)>("get_determinant")(&mantissa, &exponent,
                                                                                       host.numeric, nullptr)),
              0);
    EXPECT_NEAR(log_det, std::log(std::abs(mantissa)) + exponent * std::log(10), 1e-12);
    // P R A Q = L U: forward substitution alone, checked by L y = P b with L of the arrays.
    std::vector<double> b = truth(30), y(30);
    ASSERT_EQ(host.solve(kLowerFactor, a, y.data(), b.data()), 0);
    for (int r = 0; r < 30; ++r) {
      double sum = 0;
      for (int k = lp[r]; k < lp[r + 1]; ++k) sum += lx[k] * y[lj[k]];
      ASSERT_NEAR(sum, b[r], 1e-12);
    }
  }
  // Matrices that are not square.
  Host<std::int32_t> wide;
  const int pointers[] = {0, 1, 2, 3}, rows[] = {0, 1, 0};
  const double values[] = {1, 2, 3};
  ASSERT_EQ(wide.analyze(2, 3, pointers, rows, values), 0);
  EXPECT_EQ(wide.factorize(pointers, rows, values, wide.symbolic), 0);
}

TEST(Umfpack, AnyArguments) {
  std::mt19937 random(5);
  const Columns<std::int32_t> good(10);
  const int ends[] = {INT_MIN, -1, 0, 1, 9, 10, INT_MAX - 1};
  int solved = 0, refused = 0;
  for (int round = 0; round < 2000; ++round) {
    Columns<std::int32_t> a = good;
    for (int k = static_cast<int>(random() % 3); k > 0; --k) {
      auto& list = random() % 3 == 0 ? a.pointers : a.indices;
      const std::size_t at = random() % list.size();
      if (&list == &a.pointers && at + 1 == list.size()) continue;  // as long as the arrays are
      list[at] = ends[random() % std::size(ends)];
    }
    if (random() % 10 == 0) a.values[random() % a.values.size()] = std::nan("");
    Host<std::int32_t> host;
    std::vector<double> x(10), b = a.values == good.values ? good.times(truth(10), false) : truth(10);
    int status = host.analyze(a);
    if (status == 0) status = host.factorize(a);
    if (status == 0) status = host.solve(kA, a, x.data(), b.data());
    const bool whole = a.pointers == good.pointers && a.indices == good.indices && a.values == good.values;
    if (whole) {
      ASSERT_EQ(status, 0);
      for (int k = 0; k < 10; ++k) ASSERT_NEAR(x[k], truth(10)[k], 1e-12);
    }
    (status == 0 ? solved : refused) += 1;
  }
  EXPECT_GT(solved, 200);
  EXPECT_GT(refused, 200);
}

// The child goes on with the parent's factor, and makes one of its own.
TEST(Umfpack, ProgramsThatFork) {
  const Columns<std::int32_t> a(3000);
  Host<std::int32_t> host;
  ASSERT_EQ(host.analyze(a), 0);
  ASSERT_EQ(host.factorize(a), 0);
  const std::vector<double> b = a.times(truth(3000), false);
  const auto right = [&] {
    std::vector<double> x(3000);
    if (host.solve(kA, a, x.data(), b.data()) != 0) return false;
    double worst = 0;
    for (int k = 0; k < 3000; ++k) worst = std::max(worst, std::abs(x[k] - (1 + k % 5)));
    return worst < 1e-11;
  };
  const pid_t child = ::fork();
  ASSERT_GE(child, 0);
  if (child == 0) ::_exit(right() && host.factorize(a) == 0 && right() ? 0 : 1);
  int status = 1;
  ASSERT_EQ(::waitpid(child, &status, 0), child);
  EXPECT_EQ(status, 0);
  EXPECT_TRUE(right());
}

// The host's objects are then the real library's; a larger pattern becomes ours when it has come often enough.
TEST(Umfpack, SmallSystemsAreTheRealLibrarys) {
  if (!real_library_is_there()) GTEST_SKIP() << "libumfpack.so.5 is not installed";
  const std::string log = std::string(::testing::TempDir()) + "umfpack_log_" + std::to_string(::getpid());
  const Variable logged("ESPALIER_LOG", log);
  for (const int n : {100, 6000}) {
    const Columns<std::int32_t> a(n);
    Host<std::int32_t> host;
    ::unsetenv("ESPALIER_SMALL");
    ASSERT_EQ(host.analyze(a), 0);
    for (int round = 0; round < 500 && ::access(log.c_str(), F_OK) != 0; ++round) {
      if (round > 0) host.end_numeric();
      ASSERT_EQ(host.factorize(a), 0);
      std::vector<double> x(n), b = a.times(truth(n), false);
      ASSERT_EQ(host.solve(kA, a, x.data(), b.data()), 0);
      for (int k = 0; k < n; ++k) ASSERT_NEAR(x[k], truth(n)[k], 1e-12);
    }
    EXPECT_EQ(::access(log.c_str(), F_OK) == 0, n == 6000) << "who has factorized " << n;
  }
  ::unlink(log.c_str());
}

TEST(Umfpack, ShowsItsNamesAlone) {
  const Library library(ESPALIER_UMFPACK);
  EXPECT_NE(library.dynamic_section().find("NODELETE"), std::string::npos);
  EXPECT_GT(library.names().size(), 20u);
  for (const std::string& name : library.names())
    EXPECT_TRUE(name.starts_with("umfpack_di_") || name.starts_with("umfpack_dl_")) << name;
}

}  // namespace
}  // namespace espalier::test
