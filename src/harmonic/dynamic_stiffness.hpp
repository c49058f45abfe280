/// \file
/// Z(w) = K (1 + i eta) + i H + i w C - w^2 M on one pattern.
#pragma once

#include <complex>
#include <vector>

#include "base/thread_pool.hpp"
#include "espalier/matrix.hpp"

namespace espalier::harmonic {

using Complex = std::complex<double>;

class DynamicStiffness {
 public:
  /// @param c  without rows: no damping  @param h  structural damping of parts of K; without rows: none
  /// @throws Error(invalid_input) for matrices that are not square, not of one size, or not finite
  DynamicStiffness(const MatrixView& k, const MatrixView& c, const MatrixView& m, double loss_factor,
                   base::ThreadPool& pool, const MatrixView& h = {});
  [[nodiscard]] Index n() const { return pattern_.rows; }
  [[nodiscard]] bool symmetric() const { return pattern_.storage == Storage::symmetric_lower; }
  [[nodiscard]] bool damped() const { return damped_; }
  [[nodiscard]] double loss_factor() const { return loss_factor_; }

  /// Values at an angular frequency, resized to fit.
  void evaluate(double w, std::vector<Complex>& z) const;
  /// The matrix with values of evaluate(), which outlive the view.
  [[nodiscard]] ComplexMatrixView view(const std::vector<Complex>& z) const;
  /// y = (|K| + |H| + w |C| + w^2 |M|) |x| entry by entry, with the phases of x.
  void magnitudes(double w, const Complex* x, Complex* y) const;
  /// The largest row sum of |K| + w |C| + w^2 |M|.
  [[nodiscard]] double norm(double w) const;

  enum class Matrix { stiffness, damping, mass, structural };
  [[nodiscard]] bool structural() const { return !h_.empty(); }
  /// One of the real matrices, in the pattern of all; the last one where there is structural().
  [[nodiscard]] MatrixView part(Matrix which) const;
  /// y = A x of one of them.
  void product(Matrix which, const double* x, double* y) const;
  /// The symmetric part, as a lower triangle.
  [[nodiscard]] SparseMatrix symmetric_part(Matrix which) const;

 private:
  [[nodiscard]] const std::vector<double>& values(Matrix which) const;
  template <class Use>
  void each(const Use& use) const;

  SparseMatrix pattern_;  // its values are those of K
  std::vector<double> c_, m_, h_;
  double loss_factor_ = 0;
  bool damped_ = false;
};

}  // namespace espalier::harmonic
