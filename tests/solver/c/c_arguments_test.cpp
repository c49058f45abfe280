// The C interface against argument blocks of any content, and its options from the environment. Truths: the documented
// status; a valid system still gives the closed-form solution.
#include <gtest/gtest.h>

#include <climits>
#include <cmath>
#include <cstdlib>
#include <limits>
#include <random>
#include <string>
#include <tuple>
#include <vector>

#include "espalier/espalier.hpp"
#include "solver/c/c_handle.hpp"

namespace c_arguments_test {

using espalier::test::analyze;
using espalier::test::factorize;
using espalier::test::Handle;
using espalier::test::make;

// diag(2, 4, 8)
template <class Matrix, class Int>
struct Diagonal {
  std::vector<Int> pointers{0, 1, 2, 3}, indices{0, 1, 2};
  std::vector<double> values{2, 4, 8};
  Matrix matrix() const {
    Matrix a{};
    a.size = sizeof a;
    a.rows = a.cols = a.nonzeros = 3;
    a.pointers = pointers.data();
    a.indices = indices.data();
    a.values = values.data();
    return a;
  }
};

// Numbers at the ends of their types and near what is right. Undefined behaviour shows in the sanitizer's build.
template <class Matrix, class Int>
void break_arrays() {
  std::mt19937_64 random(4);
  const Int ends[] = {std::numeric_limits<Int>::min(),     std::numeric_limits<Int>::min() + 1, -1, 0, 1, 3, 4,
                      std::numeric_limits<Int>::max() - 1, std::numeric_limits<Int>::max()};
  const auto any = [&] { return ends[random() % std::size(ends)]; };
  int solved = 0;
  for (int round = 0; round < 4000; ++round) {
    Diagonal<Matrix, Int> arrays;
    for (std::uint64_t k = random() % 3; k > 0; --k) {
      auto& list = random() % 2 == 0 ? arrays.pointers : arrays.indices;
      list[random() % list.size()] = any();
    }
    Matrix a = arrays.matrix();
    switch (random() % 8) {
      case 0:
        a.layout = static_cast<int32_t>(any());
        break;
      case 1:
        a.storage = static_cast<int32_t>(any());
        break;
      case 2:
        a.index_base = static_cast<int32_t>(any());
        break;
      case 3:
        a.nonzeros = std::min<int64_t>(3, static_cast<int64_t>(any()));  // the arrays are not longer
        break;
      case 4:
        a.rows = random() % 2 == 0 ? std::min<int64_t>(3, any()) : 3;
        a.cols = random() % 2 == 0 ? std::min<int64_t>(3, any()) : 3;
        break;
      case 5:
        (random() % 2 == 0 ? a.pointers : a.indices) = nullptr;
        break;
      case 6:
        a.size = random() % 3 == 0 ? 0 : sizeof a - 1;
        break;
      default:
        break;
    }
    const Handle s = make();
    ASSERT_EQ(espalier_set_option(s.get(), "threads", "1"), ESPALIER_OK);
    int status = analyze(s.get(), a);
    if (status == ESPALIER_OK) status = factorize(s.get(), a);
    ASSERT_TRUE(status == ESPALIER_OK || status == ESPALIER_MISUSE || status == ESPALIER_INVALID_INPUT ||
                status == ESPALIER_SINGULAR)
        << "round " << round << ": " << status << ", " << espalier_last_error(s.get());
    if (status != ESPALIER_OK) {
      EXPECT_NE(std::string(espalier_last_error(s.get())), "");
    }
    solved += status == ESPALIER_OK ? 1 : 0;
  }
  EXPECT_GT(solved, 100);
  EXPECT_LT(solved, 3900);
}

TEST(CArguments, OfAnyContent32) { break_arrays<espalier_matrix_i32, int32_t>(); }
TEST(CArguments, OfAnyContent64) { break_arrays<espalier_matrix_i64, int64_t>(); }

TEST(CArguments, CountsOfAnySize) {
  const Diagonal<espalier_matrix_i64, int64_t> arrays;
  const Handle s = make();
  const espalier_matrix_i64 a = arrays.matrix();
  ASSERT_EQ(analyze(s.get(), a), ESPALIER_OK);
  ASSERT_EQ(factorize(s.get(), a), ESPALIER_OK);
  std::vector<double> b{2, 4, 8}, x(3);
  for (const int64_t n : {INT64_MIN, INT64_MAX, int64_t{-1}, int64_t{0}, int64_t{1} << 31, int64_t{1} << 62}) {
    EXPECT_EQ(espalier_refactorize(s.get(), arrays.values.data(), n, nullptr), ESPALIER_MISUSE) << n;
    EXPECT_EQ(espalier_solve(s.get(), b.data(), x.data(), n, 0, nullptr), ESPALIER_MISUSE) << n;
  }
  for (const int transpose : {INT_MIN, -1, 3, INT_MAX})
    EXPECT_EQ(espalier_solve(s.get(), b.data(), x.data(), 1, transpose, nullptr), ESPALIER_MISUSE);
  EXPECT_EQ(espalier_solve(s.get(), b.data(), x.data(), 1, 0, nullptr), ESPALIER_OK);
  for (const double v : x) EXPECT_NEAR(v, 1, 4e-16);
  for (const int code : {INT_MIN, -1, 1000, INT_MAX}) EXPECT_NE(espalier_status_name(code), nullptr);
}

// Sets a variable for one scope.
class Variable {
 public:
  Variable(const char* name, const char* value) : name_(name) { ::setenv(name, value, 1); }
  Variable(const Variable&) = delete;
  Variable& operator=(const Variable&) = delete;
  ~Variable() { ::unsetenv(name_); }

 private:
  const char* name_;
};

// Which threads worked is in the line of the log and in the name of the device.
std::string device_of(const espalier::Options& o) {
  espalier::Solver s(o);
  const Diagonal<espalier_matrix_i64, int64_t> d;
  std::vector<espalier::Index> rows{0, 1, 2};
  const espalier::MatrixView a{3, 3, d.pointers, rows, d.values, espalier::Storage::general};
  if (!s.analyze(a).status.ok()) return "";
  const auto f = s.factorize(a);
  return f.devices.empty() ? "" : f.devices.front().name;
}

TEST(Environment, ThreadsWhereTheCallerSaysNothing) {
  espalier::Options o;
  o.device = "cpu";
  {
    const Variable v("OMP_NUM_THREADS", "3");
    EXPECT_EQ(device_of(o), "host (3 threads)");
    o.threads = 2;
    EXPECT_EQ(device_of(o), "host (2 threads)");
    o.threads = 0;
  }
  const std::string usual = device_of(o);
  for (const char* text : {"", "0", "-4", "many", "4x"}) {
    const Variable v("OMP_NUM_THREADS", text);
    EXPECT_EQ(device_of(o), usual) << text;
  }
  const Variable v("OMP_NUM_THREADS", "3,2");
  EXPECT_EQ(device_of(o), "host (3 threads)");
}

TEST(Environment, OptionsOfTheCInterface) {
  const Diagonal<espalier_matrix_i64, int64_t> arrays;
  const espalier_matrix_i64 a = arrays.matrix();
  const auto run = [&](const char* key, const char* value) {
    const Handle s = make();
    if (key != nullptr) {
      EXPECT_EQ(espalier_set_option(s.get(), key, value), ESPALIER_OK);
    }
    int status = analyze(s.get(), a);
    espalier_factor_info info{};
    info.size = sizeof info;
    if (status == ESPALIER_OK) status = espalier_factorize_i64(s.get(), &a, &info);
    const std::string error = espalier_last_error(s.get());
    return std::tuple(status, info.positive, error);
  };
  EXPECT_EQ(std::get<1>(run(nullptr, nullptr)), 3) << "symmetric and positive: llt";
  {
    const Variable v("ESPALIER_OPTIONS", "kind=lu;threads=1;");
    EXPECT_EQ(std::get<1>(run(nullptr, nullptr)), -1) << "lu has no inertia";
    EXPECT_EQ(std::get<1>(run("kind", "ldlt")), 3) << "the program has the last word";
  }
  // A library between a program and us: its defaults, and over them the user's words.
  const auto positive_of = [&](const char* variable, int applied) {
    const Handle s = make();
    EXPECT_EQ(espalier_set_option(s.get(), "kind", "ldlt"), ESPALIER_OK);
    const Variable v("ESPALIER_OPTIONS", variable);
    EXPECT_EQ(espalier_apply_environment(s.get()), applied) << variable;
    espalier_factor_info info{};
    info.size = sizeof info;
    EXPECT_EQ(analyze(s.get(), a), ESPALIER_OK);
    EXPECT_EQ(factorize(s.get(), a, &info), ESPALIER_OK);
    return info.positive;
  };
  EXPECT_EQ(positive_of("kind=lu", ESPALIER_OK), -1);
  EXPECT_EQ(positive_of("threads=1", ESPALIER_OK), 3) << "what it does not name stays";
  EXPECT_EQ(positive_of("kind=lu;kind=qr", ESPALIER_INVALID_INPUT), 3) << "nothing was changed";
  for (const char* text : {"kind=qr", "colour=red", "kind", "log=file"}) {
    const Variable v("ESPALIER_OPTIONS", text);
    const auto [status, positive, error] = run(nullptr, nullptr);
    EXPECT_EQ(status, ESPALIER_INVALID_INPUT) << text;
    EXPECT_NE(error.find("ESPALIER_OPTIONS"), std::string::npos) << error;
  }
  const Variable v("ESPALIER_OPTIONS", "log=stderr");
  ::testing::internal::CaptureStderr();
  EXPECT_EQ(std::get<0>(run(nullptr, nullptr)), ESPALIER_OK);
  EXPECT_NE(::testing::internal::GetCapturedStderr().find("espalier: analysis"), std::string::npos);
}

// A factor in FP32 needs steps to 1e-16, and none to 1e-3.
TEST(Environment, RefinementEndsAtItsTarget) {
  const Diagonal<espalier_matrix_i64, int64_t> arrays;
  espalier_matrix_i64 a = arrays.matrix();
  const std::vector<double> values{3, 7, 11}, b{1, 1, 1};
  a.values = values.data();
  const auto steps = [&](const char* target) {
    const Handle s = make();
    EXPECT_EQ(espalier_set_option(s.get(), "precision", "mixed"), ESPALIER_OK);
    EXPECT_EQ(espalier_set_option(s.get(), "refinement_target", target), ESPALIER_OK);
    EXPECT_EQ(analyze(s.get(), a), ESPALIER_OK);
    EXPECT_EQ(factorize(s.get(), a), ESPALIER_OK);
    std::vector<double> x(3);
    espalier_solve_info info{};
    info.size = sizeof info;
    EXPECT_EQ(espalier_solve(s.get(), b.data(), x.data(), 1, 0, &info),
              ESPALIER_ACCURACY_NOT_REACHED * (*target == '1'));
    return info.refinement_steps;
  };
  EXPECT_GE(steps("2e-16"), 1);
  EXPECT_EQ(steps("1e-3"), 0);
}

// As solver.hpp says: without residuals, errors are NaN and no status comes of them.
TEST(Environment, NoErrorIsTooLarge) {
  const Diagonal<espalier_matrix_i64, int64_t> arrays;
  const espalier_matrix_i64 a = arrays.matrix();
  const Handle s = make();
  EXPECT_EQ(espalier_set_option(s.get(), "required_backward_error", "inf"), ESPALIER_OK);
  EXPECT_EQ(espalier_set_option(s.get(), "refinement_steps", "0"), ESPALIER_OK);
  EXPECT_EQ(espalier_set_option(s.get(), "required_backward_error", "-inf"), ESPALIER_INVALID_INPUT);
  EXPECT_EQ(espalier_set_option(s.get(), "required_backward_error", "nan"), ESPALIER_INVALID_INPUT);
  ASSERT_EQ(analyze(s.get(), a), ESPALIER_OK);
  ASSERT_EQ(factorize(s.get(), a), ESPALIER_OK);
  const std::vector<double> b{2, 4, 8};
  std::vector<double> x(3);
  espalier_solve_info info{};
  info.size = sizeof info;
  EXPECT_EQ(espalier_solve(s.get(), b.data(), x.data(), 1, 0, &info), ESPALIER_OK);
  EXPECT_TRUE(std::isnan(info.backward_error));
  for (const double v : x) EXPECT_NEAR(v, 1, 4e-16);
  // At once, for the factor that is there.
  EXPECT_EQ(espalier_set_refinement(s.get(), -1, 1e-10), ESPALIER_MISUSE);
  EXPECT_EQ(espalier_set_refinement(s.get(), 2, std::numeric_limits<double>::quiet_NaN()), ESPALIER_MISUSE);
  EXPECT_EQ(espalier_set_refinement(s.get(), 2, 1e-10), ESPALIER_OK);
  EXPECT_EQ(espalier_solve(s.get(), b.data(), x.data(), 1, 0, &info), ESPALIER_OK);
  EXPECT_LT(info.backward_error, 1e-15);
}

}  // namespace c_arguments_test
