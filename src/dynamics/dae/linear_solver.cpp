#include "dynamics/dae/linear_solver.hpp"

#include <cmath>
#include <vector>

#include "dense/dense.hpp"

namespace espalier::dynamics {
namespace {

class DenseSolver final : public LinearSolver {
 public:
  Status analyze(const MatrixView& a) override {
    n_ = a.rows;
    col_ptr_.assign(a.col_ptr.begin(), a.col_ptr.end());
    row_ind_.assign(a.row_ind.begin(), a.row_ind.end());
    dense::resize(dense_, n_, n_);
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
    const Eigen::VectorXd pivots = lu_.pivots();
    for (Index i = 0; i < n_; ++i) {
      const double pivot = pivots[i];
      if (pivot == 0 || !std::isfinite(pivot)) {
        return {StatusCode::singular, "dense LU: no pivot in column " + std::to_string(i), i};
      }
    }
    sign_ = lu_.permutation_sign();
    for (Index i = 0; i < n_; ++i)
      if (pivots[i] < 0) sign_ = -sign_;
    return {};
  }
  [[nodiscard]] int determinant_sign() const override { return sign_; }

  Status solve(std::span<const double> b, std::span<double> x, Index columns) override {
    for (Index c = 0; c < columns; ++c) {
      const auto at = static_cast<std::size_t>(c) * static_cast<std::size_t>(n_);
      Eigen::Map<Eigen::VectorXd> out(x.data() + at, n_);
      work_ = Eigen::Map<const Eigen::VectorXd>(b.data() + at, n_);
      lu_.solve(work_, out);
    }
    return {};
  }

 private:
  Index n_ = 0;
  int sign_ = 0;
  std::vector<Offset> col_ptr_;
  std::vector<Index> row_ind_;
  Eigen::MatrixXd dense_;
  Eigen::VectorXd work_;
  dense::Lu lu_;
};

}  // namespace

std::unique_ptr<LinearSolver> make_dense_solver() { return std::make_unique<DenseSolver>(); }

}  // namespace espalier::dynamics
