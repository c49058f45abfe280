#include "dynamics/dae/linear_solver.hpp"

#include <Eigen/LU>
#include <Eigen/SparseLU>
#include <cmath>
#include <vector>

namespace espalier::dynamics {
namespace {

class DenseSolver final : public LinearSolver {
 public:
  Status analyze(const MatrixView& a) override {
    n_ = a.rows;
    col_ptr_.assign(a.col_ptr.begin(), a.col_ptr.end());
    row_ind_.assign(a.row_ind.begin(), a.row_ind.end());
    dense_.resize(n_, n_);
    return {};
  }

  Status factorize(std::span<const double> values) override {
    dense_.setZero();
    for (Index j = 0; j < n_; ++j) {
      for (auto p = static_cast<std::size_t>(col_ptr_[static_cast<std::size_t>(j)]);
           p < static_cast<std::size_t>(col_ptr_[static_cast<std::size_t>(j) + 1]); ++p) {
        dense_(row_ind_[p], j) += values[p];
      }
    }
    for (Index j = 0; j < n_; ++j)
      if (!dense_.col(j).allFinite())
        return {StatusCode::singular, "an entry of column " + std::to_string(j) + " is not a finite number", j};
    lu_.compute(dense_);
    for (Index i = 0; i < n_; ++i) {
      const double pivot = lu_.matrixLU()(i, i);
      if (pivot == 0 || !std::isfinite(pivot)) {
        return {StatusCode::singular, "dense LU: no pivot in column " + std::to_string(i), i};
      }
    }
    return {};
  }

  Status solve(std::span<const double> b, std::span<double> x, Index columns) override {
    for (Index c = 0; c < columns; ++c) {
      const auto at = static_cast<std::size_t>(c) * static_cast<std::size_t>(n_);
      Eigen::Map<Eigen::VectorXd> out(x.data() + at, n_);
      work_ = Eigen::Map<const Eigen::VectorXd>(b.data() + at, n_);
      out.noalias() = lu_.permutationP() * work_;
      lu_.matrixLU().triangularView<Eigen::UnitLower>().solveInPlace(out);
      lu_.matrixLU().triangularView<Eigen::Upper>().solveInPlace(out);
    }
    return {};
  }

 private:
  Index n_ = 0;
  std::vector<Offset> col_ptr_;
  std::vector<Index> row_ind_;
  Eigen::MatrixXd dense_;
  Eigen::VectorXd work_;
  Eigen::PartialPivLU<Eigen::MatrixXd> lu_;
};

class EigenSparseSolver final : public LinearSolver {
 public:
  Status analyze(const MatrixView& a) override {
    matrix_.resize(a.rows, a.cols);
    matrix_.resizeNonZeros(static_cast<int>(a.nonzeros()));
    std::copy(a.col_ptr.begin(), a.col_ptr.end(), matrix_.outerIndexPtr());
    std::copy(a.row_ind.begin(), a.row_ind.end(), matrix_.innerIndexPtr());
    if (a.values.empty()) {
      std::fill_n(matrix_.valuePtr(), a.nonzeros(), 1.0);
    } else {
      std::copy(a.values.begin(), a.values.end(), matrix_.valuePtr());
    }
    lu_.analyzePattern(matrix_);
    return {};
  }

  Status factorize(std::span<const double> values) override {
    std::copy(values.begin(), values.end(), matrix_.valuePtr());
    lu_.factorize(matrix_);
    if (lu_.info() != Eigen::Success) return {StatusCode::singular, "sparse LU: " + lu_.lastErrorMessage(), -1};
    return {};
  }

  Status solve(std::span<const double> b, std::span<double> x, Index columns) override {
    const Eigen::Map<const Eigen::MatrixXd> rhs(b.data(), matrix_.rows(), columns);
    Eigen::Map<Eigen::MatrixXd>(x.data(), matrix_.rows(), columns) = lu_.solve(rhs).eval();
    return {};
  }

 private:
  Eigen::SparseMatrix<double, Eigen::ColMajor, int> matrix_;
  Eigen::SparseLU<Eigen::SparseMatrix<double, Eigen::ColMajor, int>, Eigen::COLAMDOrdering<int>> lu_;
};

}  // namespace

std::unique_ptr<LinearSolver> make_dense_solver() { return std::make_unique<DenseSolver>(); }
std::unique_ptr<LinearSolver> make_eigen_solver() { return std::make_unique<EigenSparseSolver>(); }

}  // namespace espalier::dynamics
