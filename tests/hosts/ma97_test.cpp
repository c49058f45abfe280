// The interface of MA97 in libespalier_hsl.so, as a host calls it. Truths: the inertia of saddle points by
// construction, a known solution, the documented flags.
#include "hsl/ma97.hpp"

#include <sys/wait.h>
#include <unistd.h>

#include <climits>
#include <cstdio>
#include <fstream>
#include <limits>
#include <random>
#include <thread>

#include "hosts/kkt.hpp"
#include "hosts/library.hpp"

namespace espalier::test {
namespace {

using hosts::ma97::Control;
using hosts::ma97::Info;

struct Ma97 {
  Library library{ESPALIER_HSL};
  void (*default_control)(Control*) = library.function<void(Control*)>("ma97_default_control_d");
  void (*analyse)(int, int, const int*, const int*, double*, void**, const Control*, Info*, int*) =
      library.function<void(int, int, const int*, const int*, double*, void**, const Control*, Info*, int*)>(
          "ma97_analyse_d");
  void (*factor)(int, const int*, const int*, const double*, void**, void**, const Control*, Info*,
                 double*) = library.function<void(int, const int*, const int*, const double*, void**, void**,
                                                  const Control*, Info*, double*)>("ma97_factor_d");
  void (*solve)(int, int, double*, int, void**, void**, const Control*, Info*) =
      library.function<void(int, int, double*, int, void**, void**, const Control*, Info*)>("ma97_solve_d");
  void (*factor_solve)(int, const int*, const int*, const double*, int, double*, int, void**, void**, const Control*,
                       Info*, double*) =
      library.function<void(int, const int*, const int*, const double*, int, double*, int, void**, void**,
                            const Control*, Info*, double*)>("ma97_factor_solve_d");
  void (*finalise)(void**, void**) = library.function<void(void**, void**)>("ma97_finalise_d");
  void (*free_akeep)(void**) = library.function<void(void**)>("ma97_free_akeep_d");
  void (*free_fkeep)(void**) = library.function<void(void**)>("ma97_free_fkeep_d");
};

// One system from analysis to solution, with the settings of Ipopt.
struct Host : Ma97 {
  Control control{};
  Info info{};
  void* akeep = nullptr;
  void* fkeep = nullptr;

  Host() {
    default_control(&control);
    control.f_arrays = 1;
    control.action = 0;
    control.u = 1e-8;
  }
  ~Host() { finalise(&akeep, &fkeep); }
  int analyse_matrix(const Kkt& a) {
    analyse(0, a.n, a.pointers.data(), a.rows.data(), nullptr, &akeep, &control, &info, nullptr);
    return info.flag;
  }
  int factorize(const Kkt& a) {
    factor(4, a.pointers.data(), a.rows.data(), a.values.data(), &akeep, &fkeep, &control, &info, nullptr);
    return info.flag;
  }
  // The backward error of the solution of A x = A (1, 2, 3, ...), for two right-hand sides that do not follow each
  // other.
  double error(const Kkt& a) {
    std::vector<double> truth(a.n);
    for (int k = 0; k < a.n; ++k) truth[k] = 1 + k % 7;
    const std::vector<double> b = a.times(truth);
    const int stride = a.n + 3;
    std::vector<double> x(2 * stride, -9.0);
    for (int k = 0; k < a.n; ++k) x[k] = x[stride + k] = b[k];
    solve(0, 2, x.data(), stride, &akeep, &fkeep, &control, &info);
    EXPECT_EQ(info.flag, 0);
    EXPECT_EQ(x[a.n], -9.0) << "what lies between is not ours";
    EXPECT_EQ(x[stride + a.n], -9.0);
    return std::max(a.backward_error({x.begin(), x.begin() + a.n}, b),
                    a.backward_error({x.begin() + stride, x.begin() + stride + a.n}, b));
  }
};

TEST(Ma97, ShowsItsNamesAlone) {
  for (const std::string& name : Library(ESPALIER_HSL).names()) EXPECT_TRUE(name.starts_with("ma")) << name;
  EXPECT_EQ(Library(ESPALIER_HSL).names().size(), 17U);
}

TEST(Ma97, InertiaAndSolutionOfSaddlePoints) {
  for (const double spread : {0.0, 6.0, 14.0}) {
    for (const int n : {1, 2, 40, 700}) {
      Host host;
      Kkt a = kkt(n, n / 3, spread);
      ASSERT_EQ(host.analyse_matrix(a), 0);
      ASSERT_EQ(host.factorize(a), 0) << n;
      EXPECT_EQ(host.info.num_neg, a.negative);
      EXPECT_EQ(host.info.matrix_rank, a.n);
      EXPECT_GT(host.info.num_factor, 0);
      // Entries of L may be as large as 1 / u, which counts where the values spread.
      const double bound = spread > 6 ? 2.2e-16 / host.control.u : 1e-11;
      EXPECT_LT(host.error(a), bound) << "n " << n << ", " << spread << " decades";
      for (double& v : a.values) v *= -1;  // the same pattern, the opposite inertia
      ASSERT_EQ(host.factorize(a), 0);
      EXPECT_EQ(host.info.num_neg, a.n - a.negative);
      EXPECT_LT(host.error(a), bound);
    }
  }
}

TEST(Ma97, SingularIsAnErrorOrAWarning) {
  const Kkt a = kkt(40, 10, 0, 2);
  Host host;
  ASSERT_EQ(host.analyse_matrix(a), 0);
  EXPECT_EQ(host.factorize(a), -7);
  host.control.action = 1;
  EXPECT_EQ(host.factorize(a), 7);
  EXPECT_EQ(host.info.matrix_rank, a.n - 2);
  EXPECT_EQ(host.info.num_neg, a.negative);
  // A row of zeros: the optimiser asks for a multiplier of nothing.
  Kkt empty = kkt(40, 10);
  for (int k = 0; k < empty.entries(); ++k)
    if (empty.rows[k] == empty.n) empty.values[k] = 0;
  host.control.action = 0;
  ASSERT_EQ(host.analyse_matrix(empty), 0);
  EXPECT_EQ(host.factorize(empty), -7);
  // The next matrix is regular: nothing of it stays.
  EXPECT_EQ(host.factorize(kkt(40, 10)), 0);
  EXPECT_LT(host.error(kkt(40, 10)), 1e-13);
}

TEST(Ma97, FortranOrCIndicesAndUncleanColumns) {
  const Kkt a = kkt(30, 9);
  Kkt c = a;
  for (int& p : c.pointers) --p;
  for (int& r : c.rows) --r;
  Host host;
  host.control.f_arrays = 0;
  ASSERT_EQ(host.analyse_matrix(c), 0);
  ASSERT_EQ(host.factorize(c), 0);
  EXPECT_LT(host.error(a), 1e-13);
  // With check, entries above the diagonal and out of range are left out and counted, repeated ones are summed.
  Kkt unclean;
  unclean.n = 3;
  unclean.pointers = {1, 4, 7, 9};
  unclean.rows = {1, 1, 5, 1, 2, 3, -2, 3};
  unclean.values = {1, 3, 99, 99, 2, 0.5, 99, 5};
  Host with_check;
  with_check.analyse(1, 3, unclean.pointers.data(), unclean.rows.data(), nullptr, &with_check.akeep,
                     &with_check.control, &with_check.info, nullptr);
  EXPECT_EQ(with_check.info.flag, 1);
  EXPECT_EQ(with_check.info.matrix_outrange, 3);
  with_check.factor(4, nullptr, nullptr, unclean.values.data(), &with_check.akeep, &with_check.fkeep,
                    &with_check.control, &with_check.info, nullptr);
  ASSERT_EQ(with_check.info.flag, 0);
  double x[] = {4, 2.5, 5.5};
  with_check.solve(0, 1, x, 3, &with_check.akeep, &with_check.fkeep, &with_check.control, &with_check.info);
  for (const double v : x) EXPECT_NEAR(v, 1, 1e-14);
}

TEST(Ma97, MistakesAreFlags) {
  const Kkt a = kkt(12, 4);
  Host host;
  Info& info = host.info;
  const auto analyse = [&](int n, const int* pointers, const int* rows) {
    host.analyse(0, n, pointers, rows, nullptr, &host.akeep, &host.control, &info, nullptr);
    return info.flag;
  };
  EXPECT_EQ(host.factorize(a), -1) << "before the analysis";
  EXPECT_EQ(analyse(-1, a.pointers.data(), a.rows.data()), -2);
  EXPECT_EQ(analyse(INT_MAX, a.pointers.data(), a.rows.data()), -2);
  EXPECT_EQ(analyse(a.n, nullptr, a.rows.data()), -3);
  EXPECT_EQ(analyse(a.n, a.pointers.data(), nullptr), -3);
  Kkt falling = a;
  falling.pointers[3] = 1;
  EXPECT_EQ(host.analyse_matrix(falling), -3);
  Kkt upper = a;
  upper.rows[3] = 1;
  EXPECT_EQ(host.analyse_matrix(upper), -4);
  ASSERT_EQ(host.analyse_matrix(a), 0);
  double x[16] = {};
  host.solve(0, 1, x, a.n, &host.akeep, &host.fkeep, &host.control, &info);
  EXPECT_EQ(info.flag, -1) << "before the factorization";
  host.factor(4, nullptr, nullptr, nullptr, &host.akeep, &host.fkeep, &host.control, &info, nullptr);
  EXPECT_EQ(info.flag, -13);
  host.factor(7, nullptr, nullptr, a.values.data(), &host.akeep, &host.fkeep, &host.control, &info, nullptr);
  EXPECT_EQ(info.flag, -5);
  host.factor(3, nullptr, nullptr, a.values.data(), &host.akeep, &host.fkeep, &host.control, &info, nullptr);
  EXPECT_EQ(info.flag, -8) << "not positive definite";
  Kkt nan = a;
  nan.values[4] = std::numeric_limits<double>::quiet_NaN();
  EXPECT_EQ(host.factorize(nan), -9);
  ASSERT_EQ(host.factorize(a), 0);
  host.solve(1, 1, x, a.n, &host.akeep, &host.fkeep, &host.control, &info);
  EXPECT_EQ(info.flag, -11);
  host.solve(0, 0, x, a.n, &host.akeep, &host.fkeep, &host.control, &info);
  EXPECT_EQ(info.flag, -10);
  host.solve(0, 2, x, a.n - 1, &host.akeep, &host.fkeep, &host.control, &info);
  EXPECT_EQ(info.flag, -10);
  // Handles that were never set, or have ended.
  void* stray = &host;
  host.solve(0, 1, x, a.n, &stray, &stray, &host.control, &info);
  EXPECT_EQ(info.flag, -1);
  void* ended = host.fkeep;
  host.finalise(&host.akeep, &host.fkeep);
  host.free_fkeep(&ended);
  stray = &host;
  host.free_akeep(&stray);
  host.analyse(0, a.n, a.pointers.data(), a.rows.data(), nullptr, nullptr, nullptr, nullptr, nullptr);
}

// Blocks of arguments of any content: a flag, or the right solution.
TEST(Ma97, AnyArguments) {
  std::mt19937 random(7);
  const Kkt a = kkt(8, 3);
  const std::vector<double> truth(a.n, 1.0), b = a.times(truth);
  int solved = 0, refused = 0;
  for (int round = 0; round < 3000; ++round) {
    Host host;
    Kkt broken = a;
    const int ends[] = {INT_MIN, -1, 0, 1, 2, a.n, a.n + 1, INT_MAX};
    for (int k = static_cast<int>(random() % 3); k > 0; --k) {
      auto& list = random() % 3 == 0 ? broken.pointers : broken.rows;
      const std::size_t at = random() % list.size();
      if (&list == &broken.pointers && at + 1 == list.size()) continue;  // as long as the arrays are
      list[at] = ends[random() % std::size(ends)];
    }
    const int check = static_cast<int>(random() % 2);
    host.control.f_arrays = random() % 8 != 0;
    if (random() % 16 == 0) host.control.u = -1;
    host.analyse(check, broken.n, broken.pointers.data(), broken.rows.data(), nullptr, &host.akeep, &host.control,
                 &host.info, nullptr);
    std::vector<double> x = b;
    host.factor_solve(4, nullptr, nullptr, broken.values.data(), 1, x.data(), a.n, &host.akeep, &host.fkeep,
                      &host.control, &host.info, nullptr);
    if (host.info.flag < 0) {
      ++refused;
    } else if (broken.pointers == a.pointers && broken.rows == a.rows && host.control.f_arrays == 1) {
      ++solved;
      for (int k = 0; k < a.n; ++k) ASSERT_NEAR(x[k], 1, 1e-10) << "round " << round;
    }
  }
  EXPECT_GT(solved, 300);
  EXPECT_GT(refused, 300);
}

TEST(Ma97, ChildOfAForkGoesOn) {
  const Kkt a = kkt(300, 100);
  Host host;
  ASSERT_EQ(host.analyse_matrix(a), 0);
  ASSERT_EQ(host.factorize(a), 0);
  const pid_t child = ::fork();
  if (child == 0) ::_exit(host.factorize(a) == 0 && host.error(a) < 1e-13 ? 0 : 1);
  int status = -1;
  ASSERT_EQ(::waitpid(child, &status, 0), child);
  EXPECT_TRUE(WIFEXITED(status) && WEXITSTATUS(status) == 0);
  EXPECT_LT(host.error(a), 1e-13);
}

TEST(Ma97, FactorsInSeveralThreads) {
  std::vector<std::thread> threads;
  for (int t = 0; t < 4; ++t)
    threads.emplace_back([t] {
      const Kkt a = kkt(100 + t, 30);
      for (int round = 0; round < 5; ++round) {
        Host host;
        EXPECT_EQ(host.analyse_matrix(a), 0);
        EXPECT_EQ(host.factorize(a), 0);
        EXPECT_EQ(host.info.num_neg, a.negative);
        EXPECT_LT(host.error(a), 1e-13);
      }
    });
  for (std::thread& t : threads) t.join();
}

TEST(Ma97, UnloadedAndLoadedAgain) {
  EXPECT_NE(Library(ESPALIER_HSL).dynamic_section().find("NODELETE"), std::string::npos);
  for (int round = 0; round < 3; ++round) {
    Host host;
    const Kkt a = kkt(200, 60);
    ASSERT_EQ(host.analyse_matrix(a), 0);
    ASSERT_EQ(host.factorize(a), 0);
    host.library.close();  // its threads live, and so does it
    EXPECT_LT(host.error(a), 1e-13);
  }
}

TEST(HostEnvironment, OneLineForEachFactorization) {
  const std::string path = ::testing::TempDir() + "espalier_hosts.log";
  std::remove(path.c_str());
  const Kkt a = kkt(20, 6);
  {
    const Variable log("ESPALIER_LOG", path);
    Host host;
    ASSERT_EQ(host.analyse_matrix(a), 0);
    ASSERT_EQ(host.factorize(a), 0);
    ASSERT_EQ(host.factorize(a), 0);
  }
  std::ifstream file(path);
  int lines = 0;
  for (std::string line; std::getline(file, line); ++lines) {
    EXPECT_NE(line.find("espalier ma97: factorized n 26"), std::string::npos) << line;
    EXPECT_NE(line.find("inertia 20 6 0"), std::string::npos) << line;
  }
  EXPECT_EQ(lines, 2);
}

TEST(HostEnvironment, OptionsOfTheUser) {
  const Kkt a = kkt(20, 6);
  {
    const Variable options("ESPALIER_OPTIONS", "kind=lu;host_memory=1");
    Host host;
    ASSERT_EQ(host.analyse_matrix(a), 0);
    EXPECT_EQ(host.factorize(a), -14) << "his budget counts";
  }
  {
    const Variable options("ESPALIER_OPTIONS", "kind=lu");
    Host host;
    ASSERT_EQ(host.analyse_matrix(a), 0);
    ASSERT_EQ(host.factorize(a), 0);
    EXPECT_EQ(host.info.num_neg, a.negative) << "the host wants an inertia, whatever the user says";
  }
  const Variable options("ESPALIER_OPTIONS", "colour=red");
  Host host;
  ASSERT_EQ(host.analyse_matrix(a), 0);
  ::testing::internal::CaptureStderr();
  EXPECT_LT(host.factorize(a), 0);
  EXPECT_NE(::testing::internal::GetCapturedStderr().find("ESPALIER_OPTIONS"), std::string::npos);
}

}  // namespace
}  // namespace espalier::test
