// The interfaces of PARDISO in libespalier_mkl_pardiso.so and libespalier_panua.so, as hosts call them. Truths: known
// solutions, inertia by construction, and the error codes that MKL 2026.2 gave for the same calls (noted where ours
// differ: MKL reads memory that is not there, or answers with what is no solution).
#include <algorithm>
#include <climits>
#include <cmath>
#include <limits>
#include <random>
#include <type_traits>

#include "hosts/kkt.hpp"
#include "hosts/library.hpp"

namespace espalier::test {
namespace {

// Compressed rows.
struct Rows {
  std::vector<int> pointers{0}, indices;
  std::vector<double> values;
  [[nodiscard]] int n() const { return static_cast<int>(pointers.size()) - 1; }
  void end_row() { pointers.push_back(static_cast<int>(indices.size())); }
  void add(int column, double value) {
    indices.push_back(column);
    values.push_back(value);
  }
  // A x, or A^T x; `symmetric`: these are the entries above the diagonal.
  [[nodiscard]] std::vector<double> times(const std::vector<double>& x, bool transposed, bool symmetric) const {
    std::vector<double> y(x.size(), 0.0);
    for (int r = 0; r < n(); ++r)
      for (int k = pointers[r]; k < pointers[r + 1]; ++k) {
        const int c = indices[k];
        if (!transposed || symmetric) y[r] += values[k] * x[c];
        if ((transposed && !symmetric) || (symmetric && r != c)) y[c] += values[k] * x[r];
      }
    return y;
  }
};

Rows unsymmetric(int n) {
  Rows a;
  for (int r = 0; r < n; ++r) {
    if (r > 0) a.add(r - 1, -1);
    a.add(r, 4);
    if (r + 3 < n) a.add(r + 3, 0.5);
    a.end_row();
  }
  return a;
}

// The upper triangle of -1 4 -1, or of -1 (+-4) -1 with `negative` rows of minus four.
Rows chain(int n, int negative = 0) {
  Rows a;
  for (int r = 0; r < n; ++r) {
    a.add(r, r < negative ? -4 : 4);
    if (r + 1 < n) a.add(r + 1, -1);
    a.end_row();
  }
  return a;
}

Rows upper_rows(const Kkt& lower) {  // the columns of a lower triangle are the rows of the upper one
  Rows a;
  for (const int p : lower.pointers)
    if (p > 1) a.pointers.push_back(p - 1);
  for (const int r : lower.rows) a.indices.push_back(r - 1);
  a.values = lower.values;
  return a;
}

// A host of MKL's interface with integers of this type.
template <class Int>
struct Mkl {
  using Pardiso = void(void**, const Int*, const Int*, const Int*, const Int*, const Int*, const void*, const Int*,
                       const Int*, Int*, const Int*, Int*, const Int*, void*, void*, Int*);
  Library library{ESPALIER_MKL_PARDISO};
  Pardiso* pardiso = library.function<Pardiso>(sizeof(Int) == 4 ? "pardiso" : "pardiso_64");
  void* pt[64] = {};
  Int iparm[64] = {}, type, maxfct = 1, mnum = 1;
  std::vector<Int> pointers, indices;

  explicit Mkl(Int the_type) : type(the_type) {
    int words[64];
    const int plain = static_cast<int>(type);
    library.function<void(void**, const int*, int*)>("pardisoinit")(pt, &plain, words);
    std::copy(words, words + 64, iparm);
  }
  ~Mkl() { call(-1, {}, nullptr, nullptr, 1); }
  // Indices from the base that iparm says.
  Int call(Int phase, const Rows& a, void* b, void* x, Int columns = 1) {
    const Int base = iparm[0] != 0 && iparm[34] != 0 ? 0 : 1;
    pointers.assign(a.pointers.begin(), a.pointers.end());
    indices.assign(a.indices.begin(), a.indices.end());
    for (Int& p : pointers) p += base;
    for (Int& i : indices) i += base;
    const Int n = a.n(), quiet = 0;
    Int error = 77;
    pardiso(pt, &maxfct, &mnum, &type, &phase, &n, values_of(a), pointers.data(), indices.data(), nullptr, &columns,
            iparm, &quiet, b, x, &error);
    return error;
  }
  const void* values_of(const Rows& a) {
    if (iparm[27] == 0) return a.values.data();
    floats.assign(a.values.begin(), a.values.end());
    return floats.data();
  }
  std::vector<float> floats;
};

using Mkl32 = Mkl<int>;
using Mkl64 = Mkl<long long>;

std::vector<double> truth(int n) {
  std::vector<double> x(n);
  for (int k = 0; k < n; ++k) x[k] = 1 + k % 5;
  return x;
}

template <class Host>
void expect_solution(Host& host, const Rows& a, int phase, double tolerance = 1e-13) {
  const bool symmetric = host.type == 2 || host.type == -2;
  std::vector<double> x(a.n(), -1.0), b = a.times(truth(a.n()), host.iparm[11] != 0, symmetric);
  ASSERT_EQ(host.call(phase, a, b.data(), x.data()), 0);
  for (int k = 0; k < a.n(); ++k) ASSERT_NEAR(x[k], truth(a.n())[k], tolerance * 5) << k;
}

TEST(MklPardiso, AllTypesAndPhases) {
  for (const int type : {1, 2, -2, 11}) {
    const bool symmetric = type == 2 || type == -2;
    for (const int zero_based : {0, 1}) {
      const Rows a = symmetric ? chain(60, type == -2 ? 20 : 0) : unsymmetric(60);
      Mkl32 host(type);
      host.iparm[34] = zero_based;
      expect_solution(host, a, 13);
      expect_solution(host, a, 33);
      Rows twice = a;
      for (double& v : twice.values) v *= 2;
      expect_solution(host, twice, 23);
      ASSERT_EQ(host.call(11, a, nullptr, nullptr), 0);
      ASSERT_EQ(host.call(22, a, nullptr, nullptr), 0);
      expect_solution(host, a, 33);
      ASSERT_EQ(host.call(12, a, nullptr, nullptr), 0);
      host.iparm[11] = 2;
      expect_solution(host, a, 33);
      EXPECT_EQ(host.call(0, a, nullptr, nullptr), 0);
      EXPECT_EQ(host.pt[0], nullptr);
      EXPECT_EQ(host.call(-1, a, nullptr, nullptr), 0);
    }
  }
}

TEST(MklPardiso, LongIntegers) {
  Mkl64 host(11);
  expect_solution(host, unsymmetric(40), 13);
  EXPECT_GT(host.iparm[17], 0);
}

TEST(MklPardiso, WordsOfIparm) {
  // Zero in the first: all are filled in, indices are 1-based.
  Mkl32 host(-2);
  std::fill_n(host.iparm, 64, 0);
  const Rows a = chain(30, 12);
  expect_solution(host, a, 13);
  EXPECT_EQ(host.iparm[0], 1);
  EXPECT_EQ(host.iparm[9], 8);
  EXPECT_EQ(host.iparm[21], 18);
  EXPECT_EQ(host.iparm[22], 12);
  EXPECT_EQ(host.iparm[13], 0);
  EXPECT_GT(host.iparm[17], 30) << "entries of the factor, asked for by -1";
  EXPECT_GE(host.iparm[14], 1);
  // The solution goes into the right-hand side, too.
  host.iparm[5] = 1;
  std::vector<double> b = a.times(truth(30), false, true), x(30);
  ASSERT_EQ(host.call(33, a, b.data(), x.data()), 0);
  EXPECT_EQ(b, x);
  EXPECT_NEAR(b[3], 4, 1e-13);
  // Steps of refinement are those of this call.
  host.iparm[7] = 0;
  ASSERT_EQ(host.call(33, a, b.data(), x.data()), 0);
  EXPECT_EQ(host.iparm[6], 0);
}

TEST(MklPardiso, SeveralRightHandSidesAndFloats) {
  const Rows a = unsymmetric(50);
  const std::vector<double> one = a.times(truth(50), false, false);
  Mkl32 host(11);
  host.iparm[27] = 1;
  std::vector<float> b(one.begin(), one.end()), x(150, -1.0F);
  b.insert(b.end(), b.begin(), b.begin() + 50);
  b.insert(b.end(), b.begin(), b.begin() + 50);
  ASSERT_EQ(host.call(13, a, b.data(), x.data(), 3), 0);
  for (int k = 0; k < 150; ++k) EXPECT_NEAR(x[k], truth(50)[k % 50], 1e-5);
}

TEST(MklPardiso, SeveralFactorsOfOnePattern) {
  Mkl32 host(2);
  host.maxfct = 3;
  std::vector<Rows> matrices(3, chain(25));
  for (int m = 0; m < 3; ++m)
    for (double& v : matrices[m].values) v *= m + 1;
  ASSERT_EQ(host.call(11, matrices[0], nullptr, nullptr), 0);
  for (int m = 0; m < 3; ++m) {
    host.mnum = m + 1;
    ASSERT_EQ(host.call(22, matrices[m], nullptr, nullptr), 0);
  }
  for (int m = 2; m >= 0; --m) {
    host.mnum = m + 1;
    expect_solution(host, matrices[m], 33);
  }
  host.mnum = 4;
  EXPECT_EQ(host.call(33, matrices[0], nullptr, nullptr), -1);
}

// Clarabel asks for the analysis with zeros in place of values.
TEST(MklPardiso, AnalysisBeforeThereAreValues) {
  for (const int type : {-2, 11}) {
    const Kkt saddle = kkt(200, 60, 3);
    const Rows a = type == -2 ? upper_rows(saddle) : unsymmetric(200);
    Rows zeros = a;
    std::fill(zeros.values.begin(), zeros.values.end(), 0.0);
    Mkl32 host(type);
    ASSERT_EQ(host.call(11, zeros, nullptr, nullptr), 0);
    ASSERT_EQ(host.call(22, a, nullptr, nullptr), 0);
    expect_solution(host, a, 33, 1e-9);
    if (type == -2) {
      EXPECT_EQ(host.iparm[22], saddle.negative);
    }
  }
}

TEST(MklPardiso, Mistakes) {
  const Rows a = chain(12);
  std::vector<double> b(24, 1.0), x(24);
  const auto error = [&](int type, int phase, const Rows& matrix, int columns = 1, auto... words) {
    Mkl32 host(type);
    host.iparm[34] = 1;
    (words(host), ...);
    return host.call(phase, matrix, b.data(), x.data(), columns);
  };
  EXPECT_EQ(error(2, 13, Rows{}), -1) << "n = 0";
  for (const int type : {0, 7, 3, 4, -4, 6, 13}) EXPECT_EQ(error(type, 13, a), -1) << type;
  for (const int phase : {14, 21, 31, 331, 332, 333, 99, 5, -2}) EXPECT_EQ(error(2, phase, a), -1) << phase;
  EXPECT_EQ(error(2, 22, a), -1) << "before the analysis (MKL: -2)";
  EXPECT_EQ(error(2, 33, a), -1);
  EXPECT_EQ(error(2, 13, a, 0), -1) << "no right-hand side";
  EXPECT_EQ(error(2, 13, a, 1, [](Mkl32& h) { h.mnum = 2; }), -1);
  EXPECT_EQ(error(2, 13, a, 1, [](Mkl32& h) { h.maxfct = 0; }), -1);
  for (const int word : {35, 36, 55}) EXPECT_EQ(error(-2, 12, a, 1, [&](Mkl32& h) { h.iparm[word] = 1; }), -1) << word;
  EXPECT_EQ(error(-2, 12, a, 1, [](Mkl32& h) { h.iparm[4] = 2; }), -1);
  EXPECT_EQ(error(2, 13, a, 1, [](Mkl32& h) { h.pt[0] = &h; }), -1) << "pt was not cleared";
  // Rows that are not sorted are an error only for the checker, entries below the diagonal always (MKL leaves them
  // out).
  Rows unsorted = unsymmetric(12);
  std::swap(unsorted.indices[0], unsorted.indices[1]);
  std::swap(unsorted.values[0], unsorted.values[1]);
  EXPECT_EQ(error(11, 13, unsorted), 0);
  const auto checked = [](Mkl32& h) { h.iparm[26] = 1; };
  EXPECT_EQ(error(11, 13, unsorted, 1, checked), -1);
  EXPECT_EQ(error(11, 13, unsymmetric(12), 1, checked), 0);
  EXPECT_EQ(error(-2, 13, unsymmetric(12), 1, checked), -1);
  EXPECT_EQ(error(-2, 13, unsymmetric(12)), -1);
  for (const int index : {-1, 12, INT_MAX - 1, INT_MIN}) {
    Rows outside = unsymmetric(12);
    outside.indices[4] = index;
    EXPECT_EQ(error(11, 13, outside), -1) << index;
    EXPECT_EQ(error(11, 13, outside, 1, checked), -1) << index;
  }
  Rows falling = unsymmetric(12);
  falling.pointers[4] = 1;
  EXPECT_EQ(error(11, 13, falling), -1);
  Rows nan = unsymmetric(12);
  nan.values[5] = std::numeric_limits<double>::quiet_NaN();
  EXPECT_EQ(error(11, 13, nan), -1) << "(MKL: 0, and NaN)";
}

TEST(MklPardiso, PivotsThatVanish) {
  Rows a;  // 1 2; 2 1
  a.add(0, 1);
  a.add(1, 2);
  a.end_row();
  a.add(1, 1);
  a.end_row();
  double b[] = {3, 3}, x[2];
  Mkl32 positive(2);
  EXPECT_EQ(positive.call(13, a, b, x), -4);
  EXPECT_GT(positive.iparm[29], 0) << "the row, from 1 on";
  // Singular, with a solution: pivots are perturbed, and said to be.
  for (const int type : {-2, 11}) {
    Rows singular;
    singular.add(0, 1);
    singular.add(1, 1);
    singular.end_row();
    if (type == 11) singular.add(0, 1);
    singular.add(1, 1);
    singular.end_row();
    double ones[] = {1, 1};
    Mkl32 host(type);
    ASSERT_EQ(host.call(13, singular, ones, x), 0);
    EXPECT_EQ(host.iparm[13], 1);
    EXPECT_NEAR(x[0] + x[1], 1, 1e-6);
  }
  // A row of nothing.
  Rows empty;
  empty.add(0, 1);
  empty.add(1, 1);
  empty.end_row();
  empty.end_row();
  Mkl32 host(11);
  EXPECT_LT(host.call(13, empty, b, x), 0) << "(MKL: 0, and 2e13)";
}

TEST(MklPardiso, AnyArguments) {
  std::mt19937 random(11);
  const Rows good = unsymmetric(10);
  int solved = 0, refused = 0;
  for (int round = 0; round < 2000; ++round) {
    const int types[] = {11, 11, 1, 2, -2, 7};
    Mkl32 host(types[random() % std::size(types)]);
    Rows a = good;
    const int ends[] = {INT_MIN, -1, 0, 1, 9, 10, INT_MAX - 1};
    for (int k = static_cast<int>(random() % 3); k > 0; --k) {
      auto& list = random() % 3 == 0 ? a.pointers : a.indices;
      const std::size_t at = random() % list.size();
      if (&list == &a.pointers && at + 1 == list.size()) continue;  // as long as the arrays are
      list[at] = ends[random() % std::size(ends)];
    }
    if (random() % 4 == 0) host.iparm[26] = 1;
    if (random() % 8 == 0) host.iparm[random() % 64] = ends[random() % std::size(ends)];
    if (host.iparm[27] != 0 && host.iparm[0] != 0) continue;  // of floats there are none here
    const bool whole = a.pointers == good.pointers && a.indices == good.indices && host.type == 11;
    const bool transposed = host.iparm[0] != 0 && host.iparm[11] != 0;
    std::vector<double> b = good.times(truth(10), transposed, false), x(10);
    const int error = host.call(13, a, b.data(), x.data());
    if (error != 0) {
      EXPECT_GE(error, -8);
      ++refused;
    } else if (whole) {
      ++solved;
      for (int k = 0; k < 10; ++k) ASSERT_NEAR(x[k], truth(10)[k], 1e-10) << "round " << round;
    }
  }
  EXPECT_GT(solved, 200);
  EXPECT_GT(refused, 200);
  // Nothing at all.
  Mkl32 host(11);
  host.pardiso(nullptr, nullptr, nullptr, nullptr, nullptr, nullptr, nullptr, nullptr, nullptr, nullptr, nullptr,
               nullptr, nullptr, nullptr, nullptr, nullptr);
}

TEST(MklPardiso, ThreadsByAddressOrNumber) {
  const Library library(ESPALIER_MKL_PARDISO);
  const auto most = library.function<int()>("mkl_get_max_threads");
  const int three = 3;
  library.function<void(const int*)>("mkl_set_num_threads")(&three);
  EXPECT_EQ(most(), 3);
  library.function<void(int)>("MKL_Set_Num_Threads")(2);
  EXPECT_EQ(most(), 2);
  library.function<void(std::intptr_t)>("mkl_set_num_threads")(0);
  EXPECT_GE(most(), 1);
}

// A host of Panua's interface.
struct Panua {
  using Pardiso = void(void**, const int*, const int*, const int*, const int*, const int*, const double*, const int*,
                       const int*, int*, const int*, int*, const int*, double*, double*, int*, double*);
  Library library{ESPALIER_PANUA};
  void* pt[64] = {};
  int iparm[64] = {}, type, error = 77;
  double dparm[64] = {};

  explicit Panua(int the_type) : type(the_type) {
    const int direct = 0;
    library.function<void(void**, const int*, const int*, int*, double*, int*)>("pardisoinit")(pt, &type, &direct,
                                                                                               iparm, dparm, &error);
    EXPECT_EQ(error, 0);
  }
  int call(int phase, Rows a, double* b, double* x) {
    for (int& p : a.pointers) ++p;
    for (int& i : a.indices) ++i;
    const int one = 1, n = a.n(), quiet = 0;
    library.function<Pardiso>("pardiso")(pt, &one, &one, &type, &phase, &n, a.values.data(), a.pointers.data(),
                                         a.indices.data(), nullptr, &one, iparm, &quiet, b, x, &error, dparm);
    return error;
  }
};

TEST(PanuaPardiso, AsIpoptCallsIt) {
  const Kkt saddle = kkt(100, 30, 4);
  const Rows a = upper_rows(saddle);
  Panua host(-2);
  host.iparm[5] = 1;
  host.iparm[9] = 12;
  host.iparm[12] = 2;
  ASSERT_EQ(host.call(12, a, nullptr, nullptr), 0);
  EXPECT_EQ(host.iparm[22], saddle.negative);
  EXPECT_EQ(host.iparm[13], 0);
  std::vector<double> b = a.times(truth(a.n()), false, true), rhs = b, x(a.n());
  ASSERT_EQ(host.call(33, a, b.data(), x.data()), 0);
  EXPECT_EQ(b, x);
  EXPECT_LT(saddle.backward_error(x, rhs), 1e-12);
  EXPECT_EQ(host.call(-1, a, nullptr, nullptr), 0);
  EXPECT_EQ(host.call(33, a, b.data(), x.data()), -1);
  host.iparm[31] = 1;
  EXPECT_EQ(host.call(12, a, nullptr, nullptr), -1) << "the iterative solver";
}

// The same names in two libraries, and a third beside them: each host has its own.
TEST(HostLibraries, LiveInOneProcess) {
  const Library hsl(ESPALIER_HSL);
  Mkl32 mkl(11);
  Panua panua(-2);
  expect_solution(mkl, unsymmetric(30), 13);
  const Rows a = chain(30, 10);
  std::vector<double> b = a.times(truth(30), false, true), x(30);
  ASSERT_EQ(panua.call(13, a, b.data(), x.data()), 0);
  EXPECT_NEAR(x[2], 3, 1e-12);
  EXPECT_EQ(panua.iparm[22], 10);
  expect_solution(mkl, unsymmetric(30), 33);
  for (const char* path : {ESPALIER_MKL_PARDISO, ESPALIER_PANUA}) {
    const Library library(path);
    EXPECT_NE(library.dynamic_section().find("NODELETE"), std::string::npos) << path;
    for (const std::string& name : library.names()) {
      std::string lower = name;
      std::transform(lower.begin(), lower.end(), lower.begin(), [](unsigned char c) { return std::tolower(c); });
      EXPECT_TRUE(lower.starts_with("pardiso") || lower.starts_with("mkl_")) << path << " shows " << name;
    }
  }
}

}  // namespace
}  // namespace espalier::test
