// Inertia where small eigenvalues stand beside zeros. Truth: the eigenvalues that matrices are made of.
#include <gtest/gtest.h>

#include <Eigen/Dense>
#include <algorithm>
#include <cmath>
#include <complex>
#include <vector>

#include "solver/complex_common.hpp"
#include "solver/solver_common.hpp"

namespace espalier {
namespace small_eigenvalues_test {

using namespace test;

/// Q diag(values) Q^H with a random unitary Q.
template <class Value>
Eigen::Matrix<Value, Eigen::Dynamic, Eigen::Dynamic> with_eigenvalues(const std::vector<double>& values,
                                                                      unsigned seed) {
  using Matrix = Eigen::Matrix<Value, Eigen::Dynamic, Eigen::Dynamic>;
  const auto n = static_cast<Index>(values.size());
  const Eigen::MatrixXcd random = random_columns(n, n, seed);
  Matrix start(n, n);
  if constexpr (std::is_same_v<Value, double>)
    start = random.real();
  else
    start = random;
  const Matrix q = Eigen::HouseholderQR<Matrix>(start).householderQ();
  const Eigen::VectorXd d = Eigen::Map<const Eigen::VectorXd>(values.data(), n);
  return q * d.cast<Value>().asDiagonal() * q.adjoint();
}

std::vector<double> values_with(const std::vector<double>& small, Index zeros) {
  std::vector<double> values;
  for (Index k = 0; k < 50; ++k) values.push_back((k % 3 == 0 ? -1 : 1) * (0.5 + 0.03 * static_cast<double>(k)));
  values.insert(values.end(), small.begin(), small.end());
  values.insert(values.end(), static_cast<std::size_t>(zeros), 0.0);
  return values;
}

template <class Result>
void expect_signs(const Result& f, const std::vector<double>& values) {
  ASSERT_TRUE(f.status.ok()) << f.status.message;
  EXPECT_EQ(f.inertia.zero, std::count(values.begin(), values.end(), 0.0));
  EXPECT_EQ(f.inertia.negative, std::count_if(values.begin(), values.end(), [](double v) { return v < 0; }));
  EXPECT_EQ(f.inertia.positive, std::count_if(values.begin(), values.end(), [](double v) { return v > 0; }));
}

TEST(SmallEigenvalues, AreNoZerosAndKeepTheirSigns) {
  for (const Index zeros : {0, 1, 3})
    for (const std::vector<double>& small :
         {std::vector<double>{}, {-1e-10}, {1e-10, -1e-10, -3e-11}, {-1e-10, -2e-10, -1e-9, -2e-9, 1e-11}}) {
      SCOPED_TRACE(testing::Message() << zeros << " zeros, " << small.size() << " small ones");
      const std::vector<double> values = values_with(small, zeros);
      const auto n = static_cast<Index>(values.size());
      Options o = two_threads();
      o.kind = Kind::ldlt;
      o.singular = SingularMatrix::report;
      const Eigen::MatrixXd a = with_eigenvalues<double>(values, 3);
      std::vector<reference::Triple> lower;
      for (Index c = 0; c < n; ++c)
        for (Index r = c; r < n; ++r) lower.push_back({r, c, a(r, c)});
      Solver s(o);
      const SparseMatrix m = reference::from_triples(n, lower, Storage::symmetric_lower);
      ASSERT_TRUE(s.analyze(m).status.ok());
      expect_signs(s.factorize(m), values);
      ComplexSolver h(o);
      Eigen::MatrixXcd dense = with_eigenvalues<std::complex<double>>(values, 5);
      dense.diagonal() = Eigen::VectorXcd(dense.diagonal().real());
      const ComplexSparseMatrix c = sparse(dense, Storage::hermitian_lower);
      ASSERT_TRUE(h.analyze(c).status.ok());
      expect_signs(h.factorize(c), values);
    }
}

// Errors are formed for who asks for a limit or for refinement, and only then.
TEST(SmallEigenvalues, ErrorsAreFormedForWhoAsks) {
  const SparseMatrix a = generated({"elasticity", "5"});
  const std::vector<double> b = reference::random_vector(a.cols, 3);
  std::vector<double> x(b.size());
  const auto solve = [&](int steps, double limit) {
    Options o = two_threads();
    o.precision = Precision::mixed;
    o.refinement_steps = steps;
    o.required_backward_error = limit;
    Solver s(o);
    EXPECT_TRUE(s.analyze(a).status.ok());
    EXPECT_TRUE(s.factorize(a).status.ok());
    return s.solve(b, x);
  };
  const double none = std::numeric_limits<double>::infinity();
  const SolveResult limited = solve(0, 1e-3), refined = solve(10, none), refused = solve(0, 1e-14);
  EXPECT_EQ(refused.status.code, StatusCode::accuracy_not_reached);
  ASSERT_TRUE(limited.status.ok());
  EXPECT_GT(limited.backward_error, 1e-12);
  EXPECT_LT(limited.backward_error, 1e-3);
  ASSERT_TRUE(refined.status.ok());
  EXPECT_GT(refined.refinement_steps, 0);
  EXPECT_LT(refined.backward_error, 1e-15);
}

}  // namespace small_eigenvalues_test
}  // namespace espalier
