/// \file
/// A rational function of frequency with many components and one denominator, through given samples.
#pragma once

#include <Eigen/Core>
#include <complex>
#include <optional>
#include <vector>

namespace espalier::harmonic {

/// Barycentric: r(s) = sum_j b_j y_j / (s - s_j) / sum_j b_j / (s - s_j). Support points s_j are samples, chosen one by
/// one where the function before is worst; weights b are the smallest singular vector of the Loewner matrix of the
/// others (AAA; see espalier/harmonic.hpp), with rows over the magnitude of their sample, so that errors are relative.
class Rational {
 public:
  /// @param s  rising, at least 2  @param y  components x samples
  /// @param size  components x samples, above 0: what errors are relative to
  /// @param support  of an earlier fit, to begin with: places in s
  void fit(const std::vector<double>& s, const Eigen::MatrixXcd& y, const Eigen::MatrixXd& size, double tolerance,
           std::vector<std::size_t> support = {});
  /// @param y  any components at all the samples of fit()
  [[nodiscard]] Eigen::VectorXcd evaluate(double s, const Eigen::MatrixXcd& y) const;
  /// The values of the components of fit().
  [[nodiscard]] Eigen::VectorXcd evaluate(double s) const { return evaluate(s, y_); }
  /// Complex s at which the denominator vanishes; found at the first call after fit().
  [[nodiscard]] const std::vector<std::complex<double>>& poles() const;
  /// Largest relative error at the samples.
  [[nodiscard]] double error() const { return error_; }
  [[nodiscard]] std::size_t worst() const { return worst_; }
  [[nodiscard]] const std::vector<std::size_t>& support() const { return support_; }
  [[nodiscard]] std::vector<double> support_at() const;
  [[nodiscard]] bool empty() const { return support_.empty(); }

 private:
  void find_weights(const Eigen::MatrixXd& size);
  void judge(const Eigen::MatrixXd& size);
  [[nodiscard]] std::vector<std::complex<double>> find_poles() const;

  std::vector<double> s_;
  Eigen::MatrixXcd y_;
  std::vector<std::size_t> support_;
  Eigen::VectorXcd weights_;
  mutable std::optional<std::vector<std::complex<double>>> poles_;
  double error_ = 0;
  std::size_t worst_ = 0;
};

}  // namespace espalier::harmonic
