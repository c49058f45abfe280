/// \file
/// Complex systems of tests, and the forms in which they are factorized: by kernels for complex numbers, or as real
/// systems of twice the size, on the host or on a GPU.
#pragma once

#include <gtest/gtest.h>

#include <Eigen/Dense>
#include <complex>
#include <limits>
#include <optional>
#include <ostream>
#include <random>
#include <string>

#include "espalier/complex_solver.hpp"
#include "solver/as_real_form.hpp"
#include "solver/gpu/gpu_fixture.hpp"
#include "solver/rounding.hpp"

namespace espalier::test {

using Value = std::complex<double>;
using Dense = Eigen::MatrixXcd;

enum class Sort { symmetric, hermitian, definite, general };

// A random sparse matrix: a chain, so that it is connected, and some further entries.
inline Dense random_dense(Index n, Sort sort, unsigned seed) {
  std::mt19937 random(seed);
  std::uniform_real_distribution<double> u(-1, 1);
  std::uniform_int_distribution<Index> row(0, n - 1);
  // One draw a statement: compilers may take the arguments of a call in any order.
  const auto number = [&] {
    const double real = u(random);
    return Value(real, u(random));
  };
  Dense a = Dense::Zero(n, n);
  for (Index i = 0; i + 1 < n; ++i) a(i + 1, i) = number();
  for (Index k = 0; k < 3 * n; ++k) {
    const Index i = row(random), j = row(random);
    a(i, j) = number();
  }
  for (Index i = 0; i < n; ++i) a(i, i) = i % 4 == 0 ? Value(0) : number();
  if (sort == Sort::general) {
    for (Index i = 0; i + 1 < n; ++i) a(i, i + 1) = number();
    return a;
  }
  const Dense strict = a.triangularView<Eigen::StrictlyLower>();
  Dense both = strict + (sort == Sort::symmetric ? Dense(strict.transpose()) : Dense(strict.adjoint()));
  for (Index i = 0; i < n; ++i) both(i, i) = sort == Sort::symmetric ? a(i, i) : Value(a(i, i).real());
  if (sort == Sort::definite)
    for (Index i = 0; i < n; ++i) both(i, i) = 1 + both.row(i).cwiseAbs().sum();
  return both;
}

inline ComplexSparseMatrix sparse(const Dense& a, Storage storage) {
  ComplexSparseMatrix s;
  s.rows = s.cols = static_cast<Index>(a.rows());
  s.storage = storage;
  s.col_ptr.push_back(0);
  for (Index j = 0; j < a.cols(); ++j) {
    for (Index i = 0; i < a.rows(); ++i) {
      const bool lower = storage == Storage::symmetric_lower || storage == Storage::hermitian_lower;
      const bool upper = storage == Storage::symmetric_upper || storage == Storage::hermitian_upper;
      if ((lower && i < j) || (upper && i > j) || (a(i, j) == Value(0) && i != j)) continue;
      s.row_ind.push_back(i);
      s.values.push_back(a(i, j));
    }
    s.col_ptr.push_back(static_cast<Offset>(s.row_ind.size()));
  }
  return s;
}

inline Dense random_columns(Index n, Index columns, unsigned seed) {
  std::mt19937 random(seed);
  std::uniform_real_distribution<double> u(-1, 1);
  return Dense::NullaryExpr(n, columns, [&] {
    const double real = u(random);
    return Value(real, u(random));
  });
}

inline Dense op(const Dense& a, Transpose t) {
  if (t == Transpose::no) return a;
  return t == Transpose::yes ? Dense(a.transpose()) : Dense(a.adjoint());
}

// Solves for `columns` right-hand sides with A, A^T and A^H, and holds the residuals, formed by Eigen, against the
// errors that the solver says.
inline void expect_solutions(ComplexSolver& solver, const Dense& a, double limit = 1e-14) {
  const auto n = static_cast<Index>(a.rows());
  for (const Index columns : {1, 5})
    for (const Transpose t : {Transpose::no, Transpose::yes, Transpose::conjugate}) {
      const Dense m = op(a, t), b = random_columns(n, columns, 5);
      Dense x(n, columns);
      const SolveResult r = solver.solve({b.data(), static_cast<std::size_t>(b.size())},
                                         {x.data(), static_cast<std::size_t>(x.size())}, columns, t);
      ASSERT_TRUE(r.status.ok()) << r.status.message;
      const Dense residual = b - m * x;
      const Eigen::MatrixXd scale = m.cwiseAbs() * x.cwiseAbs() + b.cwiseAbs();
      double componentwise = 0, normwise = 0;
      const double norm = m.cwiseAbs().rowwise().sum().maxCoeff();
      for (Index c = 0; c < columns; ++c) {
        for (Index i = 0; i < n; ++i)
          if (residual(i, c) != Value(0))
            componentwise = std::max(componentwise, std::abs(residual(i, c)) / scale(i, c));
        normwise = std::max(normwise, residual.col(c).cwiseAbs().maxCoeff() /
                                          (norm * x.col(c).cwiseAbs().maxCoeff() + b.col(c).cwiseAbs().maxCoeff()));
      }
      EXPECT_LE(normwise, limit) << static_cast<int>(t) << " " << columns;
      EXPECT_NEAR(r.backward_error, normwise, limit);
      EXPECT_NEAR(r.componentwise_error, componentwise, 20 * limit);
    }
}

struct Form {
  const char* name;
  const char* device;
  bool real;
};
inline const Form kForms[] = {
    {"Native", "cpu", false}, {"Real", "cpu", true}, {"Reference", "reference", true}, {"Gpu", "gpu:0", true}};
inline void PrintTo(const Form& form, std::ostream* out) { *out << form.name; }
inline std::string name_of_form(const testing::TestParamInfo<Form>& info) { return info.param.name; }

/// One test body over all forms; on a GPU where there is one.
class InForms : public testing::TestWithParam<Form> {
 protected:
  void SetUp() override {
    const std::string device = GetParam().device;
    const std::string why = device == "gpu:0" ? why_no_gpu() : "";
    if (!why.empty()) GTEST_SKIP() << why;
    if (device == "cpu" && real()) form_.emplace();
  }
  [[nodiscard]] bool real() const { return GetParam().real; }
  [[nodiscard]] Options options() const {
    Options o;
    o.device = GetParam().device;
    return o;
  }
  [[nodiscard]] ComplexSolver solver() const { return ComplexSolver(options()); }

 private:
  std::optional<AsRealForm> form_;
};

/// Truth: the products of the matrix with its null vectors.
inline void expect_null_space(const ComplexFactorResult& r, const Dense& a, Sort sort, Index zeros) {
  ASSERT_EQ(r.null_vectors.size(), static_cast<std::size_t>(a.rows() * zeros));
  const Dense null = Eigen::Map<const Dense>(r.null_vectors.data(), a.rows(), zeros);
  EXPECT_LE((a * null).norm(), 1e-12 * a.norm());
  EXPECT_EQ(Eigen::FullPivLU<Dense>(null).setThreshold(1e-6).rank(), zeros);
  if (sort != Sort::symmetric) {
    ASSERT_EQ(r.left_null_vectors.size(), r.null_vectors.size());
    const Dense left = Eigen::Map<const Dense>(r.left_null_vectors.data(), a.rows(), zeros);
    EXPECT_LE((a.transpose() * left).norm(), 1e-12 * a.norm());
  }
}

}  // namespace espalier::test
