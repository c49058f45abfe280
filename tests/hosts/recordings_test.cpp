// What real hosts have said to their solver (recordings/, made by record.sh), said to our libraries again. Truths: of
// PARDISO the answers that MKL gave to PyPardiso and Clarabel; of MA97 flags and inertia that led Ipopt to the
// solutions of its own MUMPS (tests/hosts/ipopt.py), and backward errors.
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <fstream>
#include <map>
#include <sstream>
#include <stdexcept>
#include <string>
#include <vector>

#include "hosts/kkt.hpp"
#include "hosts/library.hpp"
#include "hsl/ma97.hpp"
#include "places.hpp"

namespace espalier::test {
namespace {

// The words and numbers of one call.
class Call {
 public:
  explicit Call(const std::string& line) : stream_(line) { stream_ >> name; }
  template <class T = int>
  T number() {
    double value = NAN;
    if (!(stream_ >> value)) throw std::runtime_error("a number is missing after " + name);
    return static_cast<T>(value);
  }
  template <class T = double>
  std::vector<T> array() {
    char open = 0, close = 0;
    stream_ >> open;
    std::vector<T> numbers(number<std::size_t>());
    for (T& v : numbers) v = number<T>();
    if (!(stream_ >> close) || open != '[' || close != ']') throw std::runtime_error("no array in " + name);
    return numbers;
  }
  void answers() {
    std::string arrow;
    if (!(stream_ >> arrow) || arrow != "->") throw std::runtime_error("no answers in " + name);
  }
  std::string name;

 private:
  std::istringstream stream_;
};

std::vector<Call> recording(const std::string& name) {
  std::ifstream file(source_folder() / "tests/hosts/recordings" / (name + ".txt"));
  std::vector<Call> calls;
  for (std::string line; std::getline(file, line);) calls.emplace_back(line);
  return calls;
}

class IpoptRecordings : public ::testing::TestWithParam<const char*> {};

TEST_P(IpoptRecordings, SameFlagsAndInertia) {
  using hosts::ma97::Control;
  using hosts::ma97::Info;
  const Library library(ESPALIER_HSL);
  Control control{};
  library.function<void(Control*)>("ma97_default_control_d")(&control);
  control.f_arrays = 1;
  void *akeep = nullptr, *fkeep = nullptr;
  Info info{};
  Kkt a;
  int factored = 0, solved = 0, singular = 0;
  for (Call& call : recording(GetParam())) {
    if (call.name == "analyse") {
      const int check = call.number();
      a.n = call.number();
      ASSERT_EQ(call.number(), 1);
      a.pointers = call.array<int>();
      a.rows = call.array<int>();
      library.function<void(int, int, const int*, const int*, double*, void**, const Control*, Info*, int*)>(
          "ma97_analyse_d")(check, a.n, a.pointers.data(), a.rows.data(), nullptr, &akeep, &control, &info, nullptr);
      call.answers();
      ASSERT_EQ(info.flag, call.number());
    } else if (call.name == "factor") {
      const int type = call.number();
      control.u = call.number<double>();
      control.small = call.number<double>();
      control.action = call.number();
      a.values = call.array();
      library
          .function<void(int, const int*, const int*, const double*, void**, void**, const Control*, Info*, double*)>(
              "ma97_factor_d")(type, a.pointers.data(), a.rows.data(), a.values.data(), &akeep, &fkeep, &control, &info,
                               nullptr);
      call.answers();
      ASSERT_EQ(info.flag, call.number()) << "factorization " << factored;
      if (info.flag == 0) {
        ASSERT_EQ(info.num_neg, call.number()) << "factorization " << factored;
      }
      singular += info.flag == -7;
      ++factored;
    } else if (call.name == "solve") {
      const int columns = call.number(), stride = call.number();
      const std::vector<double> b = call.array();
      std::vector<double> x = b;
      library.function<void(int, int, double*, int, void**, void**, const Control*, Info*)>("ma97_solve_d")(
          0, columns, x.data(), stride, &akeep, &fkeep, &control, &info);
      call.answers();
      ASSERT_EQ(info.flag, call.number());
      // Unrefined, with the threshold that Ipopt chose (1e-8).
      ASSERT_LT(a.backward_error(x, b), 1e-6) << "solve " << solved;
      ++solved;
    }
  }
  library.function<void(void**, void**)>("ma97_finalise_d")(&akeep, &fkeep);
  EXPECT_GT(factored, 3);
  EXPECT_GE(solved, factored - singular);
  EXPECT_EQ(singular > 0, GetParam() == std::string("ipopt_redundant"));
}

INSTANTIATE_TEST_SUITE_P(Problems, IpoptRecordings,
                         ::testing::Values("ipopt_hs013", "ipopt_hs071", "ipopt_hs118", "ipopt_redundant"));

struct Matrix {
  std::vector<int> pointers, indices;
  std::vector<double> values;
};

// The normwise backward error of one right-hand side. Indices are 1-based as all of these hosts' are.
double backward_error(const Matrix& a, bool symmetric, bool transposed, const double* x, const double* b) {
  const int n = static_cast<int>(a.pointers.size()) - 1, base = a.pointers[0];
  std::vector<double> product(n, 0.0), rows(n, 0.0);
  double of_x = 0, of_b = 0, of_a = 0, worst = 0;
  for (int r = 0; r < n; ++r) {
    for (int k = a.pointers[r] - base; k < a.pointers[r + 1] - base; ++k) {
      const int c = a.indices[k] - base, to = transposed ? c : r, from = transposed ? r : c;
      product[to] += a.values[k] * x[from];
      rows[to] += std::abs(a.values[k]);
      if (!symmetric || r == c) continue;
      product[from] += a.values[k] * x[to];
      rows[from] += std::abs(a.values[k]);
    }
  }
  for (int k = 0; k < n; ++k) {
    of_x = std::max(of_x, std::abs(x[k]));
    of_b = std::max(of_b, std::abs(b[k]));
    of_a = std::max(of_a, rows[k]);
    worst = std::max(worst, std::abs(b[k] - product[k]));
  }
  return worst / (of_a * of_x + of_b);
}

class PardisoRecordings : public ::testing::TestWithParam<const char*> {};

TEST_P(PardisoRecordings, AnswersOfMkl) {
  const Library library(ESPALIER_MKL_PARDISO);
  using Pardiso = void(void**, const int*, const int*, const int*, const int*, const int*, const void*, const int*,
                       const int*, int*, const int*, int*, const int*, void*, void*, int*);
  const auto pardiso = library.function<Pardiso>("pardiso");
  struct Handle {
    void* pt[64] = {};
    Matrix a;
  };
  std::map<int, Handle> handles;  // the programs have one for each type
  int factored = 0, compared = 0;
  for (Call& call : recording(GetParam())) {
    const int type = call.number(), phase = call.number(), n = call.number(), columns = call.number(), one = 1;
    std::vector<int> iparm = call.array<int>();
    Handle& handle = handles[type];
    Matrix given{call.array<int>(), call.array<int>(), call.array()};
    if (!given.pointers.empty()) handle.a = std::move(given);
    const Matrix& a = handle.a;
    std::vector<double> b = call.array(), x(b.size());
    const std::vector<double> rhs = b;
    call.answers();
    int error = 77;
    pardiso(handle.pt, &one, &one, &type, &phase, &n, a.values.data(), a.pointers.data(), a.indices.data(), nullptr,
            &columns, iparm.data(), &one, b.data(), x.data(), &error);
    ASSERT_EQ(error, call.number()) << "phase " << phase << " of type " << type;
    const std::vector<int> theirs = call.array<int>();
    const std::vector<double> truth = call.array();
    if (phase % 10 >= 2 && phase / 10 <= 2 && phase > 0) {
      ++factored;
      EXPECT_EQ(iparm[13], theirs[13]) << "perturbed pivots";
      EXPECT_EQ(iparm[21], theirs[21]) << "positive eigenvalues";
      EXPECT_EQ(iparm[22], theirs[22]) << "negative eigenvalues";
    }
    ASSERT_EQ(x.size(), truth.size());
    if (x.empty()) continue;
    ++compared;
    const bool symmetric = type == 2 || type == -2, transposed = theirs[11] != 0;
    double size = 0;
    for (const double v : truth) size = std::max(size, std::abs(v));
    // Interior-point matrices are so badly conditioned that solutions differ where both are right.
    for (std::size_t k = 0; k < x.size(); ++k) ASSERT_NEAR(x[k], truth[k], 1e-6 * size) << k;
    for (int c = 0; c < columns; ++c)
      EXPECT_LT(backward_error(a, symmetric, transposed, &x[c * n], &rhs[c * n]), 1e-15 * n) << "solve " << compared;
  }
  EXPECT_GE(factored, 3);
  EXPECT_GE(compared, 3);
}

INSTANTIATE_TEST_SUITE_P(Programs, PardisoRecordings, ::testing::Values("pypardiso", "clarabel"));

}  // namespace
}  // namespace espalier::test
