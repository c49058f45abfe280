// Saved factors through the C interface: what one solver has saved solves in another one. Truth: the bits of the solver
// that was saved, and Eigen's products with the dense matrix, for every layout, storage, index base and sort of
// numbers.
#include <gtest/gtest.h>

#include <Eigen/Dense>
#include <complex>
#include <filesystem>
#include <string>
#include <vector>

#include "solver/c/c_handle.hpp"
#include "solver/c/c_matrices.hpp"

namespace c_factor_file_test {

using Value = std::complex<double>;
using Dense = Eigen::MatrixXcd;
using espalier::test::analyze;
using espalier::test::factorize;
using espalier::test::Handle;
using espalier::test::make;
using espalier::test::matrix_for;
using Arrays = espalier::test::Arrays<std::int64_t>;

class CFactorFile : public ::testing::Test {
 protected:
  void SetUp() override {
    std::string name = (std::filesystem::temp_directory_path() / "espalier-c-factor-XXXXXX").string();
    ASSERT_NE(::mkdtemp(name.data()), nullptr);
    folder_ = name;
    path_ = folder_ + "/factor";
  }
  void TearDown() override { std::filesystem::remove_all(folder_); }

  static std::vector<double> solved(espalier_solver* s, const std::vector<double>& b, int columns, int transpose) {
    std::vector<double> x(b.size());
    EXPECT_EQ(espalier_solve(s, b.data(), x.data(), columns, transpose, nullptr), ESPALIER_OK)
        << espalier_last_error(s);
    return x;
  }
  static Dense numbers(const std::vector<double>& of, int n, bool complex) {
    Dense d(n, static_cast<Eigen::Index>(of.size()) / n / (complex ? 2 : 1));
    for (Eigen::Index k = 0; k < d.size(); ++k) {
      const auto q = static_cast<std::size_t>(k);
      d.data()[k] = complex ? Value(of[2 * q], of[2 * q + 1]) : Value(of[q]);
    }
    return d;
  }

  void save_and_load(int storage, int layout, int base, bool complex, const char* kind) {
    const int n = 30, columns = 2;
    SCOPED_TRACE(testing::Message() << "storage " << storage << ", layout " << layout << ", base " << base
                                    << ", complex " << complex << ", kind " << kind);
    const Dense a = matrix_for(storage, n, complex);
    const Arrays arrays(a, layout, storage, base, complex);
    const Handle first = make(), second = make();
    ASSERT_EQ(espalier_set_option(first.get(), "kind", kind), ESPALIER_OK);
    ASSERT_EQ(espalier_set_option(second.get(), "threads", "2"), ESPALIER_OK);
    ASSERT_EQ(analyze(first.get(), arrays.c), ESPALIER_OK) << espalier_last_error(first.get());
    ASSERT_EQ(factorize(first.get(), arrays.c), ESPALIER_OK) << espalier_last_error(first.get());
    ASSERT_EQ(espalier_save_factor(first.get(), path_.c_str()), ESPALIER_OK) << espalier_last_error(first.get());
    espalier_factor_info info{};
    info.size = sizeof info;
    ASSERT_EQ(espalier_load_factor(second.get(), path_.c_str(), &info), ESPALIER_OK)
        << espalier_last_error(second.get());
    EXPECT_EQ(info.rank, n);
    std::vector<double> b(static_cast<std::size_t>(n * columns * (complex ? 2 : 1)));
    for (std::size_t k = 0; k < b.size(); ++k) b[k] = std::sin(1.0 + static_cast<double>(k));
    // Where L U has expanded, the transpose is solved: of a Hermitian matrix by rows in place of the conjugate.
    const bool same_bits = !(complex && storage != ESPALIER_GENERAL && std::string(kind) == "lu");
    for (const int t : {ESPALIER_NO_TRANSPOSE, ESPALIER_TRANSPOSE, ESPALIER_CONJUGATE_TRANSPOSE}) {
      const Dense m = t == ESPALIER_NO_TRANSPOSE ? a
                      : t == ESPALIER_TRANSPOSE  ? Dense(a.transpose())
                                                 : Dense(a.adjoint());
      const std::vector<double> x = solved(first.get(), b, columns, t), y = solved(second.get(), b, columns, t);
      if (same_bits) {
        EXPECT_EQ(x, y) << t;
      }
      const Dense solution = numbers(y, n, complex);
      EXPECT_LE((m * solution - numbers(b, n, complex)).norm(), 1e-12 * m.norm() * solution.norm()) << t;
    }
    // Once more: of a loaded factor.
    ASSERT_EQ(espalier_save_factor(second.get(), path_.c_str()), ESPALIER_OK) << espalier_last_error(second.get());
    ASSERT_EQ(espalier_load_factor(first.get(), path_.c_str(), nullptr), ESPALIER_OK);
    EXPECT_EQ(solved(first.get(), b, columns, ESPALIER_NO_TRANSPOSE),
              solved(second.get(), b, columns, ESPALIER_NO_TRANSPOSE));
  }

  std::string folder_, path_;
};

TEST_F(CFactorFile, SolvesAsTheSolverThatWasSaved) {
  for (const bool complex : {false, true})
    for (int storage = ESPALIER_GENERAL; storage <= (complex ? ESPALIER_HERMITIAN_BOTH : ESPALIER_SYMMETRIC_BOTH);
         ++storage)
      for (const int layout : {ESPALIER_CSC, ESPALIER_CSR})
        for (const int base : {0, 1}) {
          save_and_load(storage, layout, base, complex, "auto");
          if (base == 0) save_and_load(storage, layout, base, complex, "lu");
        }
}

// Row 7 is row 4, once more: what the factor knows of it is there after loading.
TEST_F(CFactorFile, NullVectorsComeAlong) {
  for (const bool complex : {false, true})
    for (const int layout : {ESPALIER_CSC, ESPALIER_CSR}) {
      Dense a = matrix_for(ESPALIER_GENERAL, 20, complex);
      a.col(7) = a.col(4);
      const Arrays arrays(a, layout, ESPALIER_GENERAL, 0, complex);
      const Handle first = make(), second = make();
      for (espalier_solver* s : {first.get(), second.get()})
        ASSERT_EQ(espalier_set_option(s, "singular", "report"), ESPALIER_OK);
      ASSERT_EQ(analyze(first.get(), arrays.c), ESPALIER_OK);
      ASSERT_EQ(factorize(first.get(), arrays.c), ESPALIER_OK) << espalier_last_error(first.get());
      ASSERT_EQ(espalier_save_factor(first.get(), path_.c_str()), ESPALIER_OK);
      ASSERT_EQ(espalier_load_factor(second.get(), path_.c_str(), nullptr), ESPALIER_OK)
          << espalier_last_error(second.get());
      std::int64_t row = -1, found = 0;
      std::vector<double> v(complex ? 40 : 20);
      ASSERT_EQ(espalier_null_space(second.get(), 1, &row, v.data(), &found), ESPALIER_OK);
      ASSERT_EQ(found, 1);
      EXPECT_LE((a * numbers(v, 20, complex)).norm(), 1e-13 * a.norm());
    }
}

TEST_F(CFactorFile, MisuseAndBadFilesLeaveAUsableHandle) {
  const Dense a = matrix_for(ESPALIER_GENERAL, 9, true);
  const Arrays arrays(a, ESPALIER_CSR, ESPALIER_GENERAL, 0, true);
  const Handle s = make();
  EXPECT_EQ(espalier_save_factor(s.get(), path_.c_str()), ESPALIER_MISUSE);
  ASSERT_EQ(analyze(s.get(), arrays.c), ESPALIER_OK);
  EXPECT_EQ(espalier_save_factor(s.get(), path_.c_str()), ESPALIER_MISUSE);
  EXPECT_EQ(espalier_load_factor(s.get(), nullptr, nullptr), ESPALIER_MISUSE);
  EXPECT_EQ(espalier_load_factor(s.get(), path_.c_str(), nullptr), ESPALIER_INVALID_INPUT);
  EXPECT_NE(std::string(espalier_last_error(s.get())).find(path_), std::string::npos);
  std::vector<double> b(18, 1.0), x(18);
  EXPECT_EQ(espalier_solve(s.get(), b.data(), x.data(), 1, 0, nullptr), ESPALIER_MISUSE);
  ASSERT_EQ(analyze(s.get(), arrays.c), ESPALIER_OK);
  ASSERT_EQ(factorize(s.get(), arrays.c), ESPALIER_OK);
  EXPECT_EQ(espalier_save_factor(s.get(), (folder_ + "/none/factor").c_str()), ESPALIER_INVALID_INPUT);
  EXPECT_EQ(espalier_solve(s.get(), b.data(), x.data(), 1, 0, nullptr), ESPALIER_OK);
}

}  // namespace c_factor_file_test
