/// \file
/// Espalier as a sparse solver of Eigen (3.4): EspalierLLT, EspalierLDLT and EspalierLU, with the calls of
/// SimplicialLLT and SparseLU. For real double matrices by columns or rows, with 32- or 64-bit indices.
///
///     espalier::EspalierLDLT<Eigen::SparseMatrix<double>> solver;
///     solver.compute(a);                                  // or analyzePattern(a), then factorize(a) for each set of
///     values if (solver.info() != Eigen::Success) std::cerr << solver.message(); Eigen::VectorXd x = solver.solve(b);
///
/// Needs Eigen's headers, and the library espalier::espalier.
#pragma once

#include <Eigen/SparseCore>
#include <cstdint>
#include <memory>
#include <new>
#include <stdexcept>
#include <string>
#include <type_traits>

#include "espalier/espalier.h"

namespace espalier {

/// What the three have in common. @tparam kTriangle  Eigen::Lower or Upper: this triangle of a symmetric matrix is
/// read, whatever the other one holds; 0: the matrix is general
template <class Derived, class Matrix, unsigned kTriangle>
class EigenSolver : public Eigen::SparseSolverBase<Derived> {
  using Base = Eigen::SparseSolverBase<Derived>;
  static_assert(std::is_same_v<typename Matrix::Scalar, double>, "Espalier solves systems of doubles");

 public:
  using MatrixType = Matrix;
  using Scalar = double;
  using RealScalar = double;
  using StorageIndex = typename Matrix::StorageIndex;
  static constexpr int kIndexBytes = sizeof(StorageIndex);
  static_assert(kIndexBytes == 4 || kIndexBytes == 8, "indices must have 32 or 64 bits");
  enum { ColsAtCompileTime = Matrix::ColsAtCompileTime, MaxColsAtCompileTime = Matrix::MaxColsAtCompileTime };

  /// Orders the pattern of `a`; with its values, which say what suits as pivots.
  Derived& analyzePattern(const Matrix& a) {
    const Stored stored = stored_of(a);
    rows_ = a.rows();
    entries_ = stored.nonZeros();
    state_ = State::empty;
    this->m_isInitialized = true;
    if (take(analyze(view(stored, a.rows(), a.cols())))) state_ = State::analyzed;
    return this->derived();
  }
  /// New values for the pattern that was analyzed. @throws std::logic_error before there is one
  Derived& factorize(const Matrix& a) {
    if (state_ == State::empty && info_ == Eigen::Success)
      throw std::logic_error("Espalier: call analyzePattern() first");
    if (state_ == State::empty) return this->derived();  // info() says why
    state_ = State::analyzed;
    const Stored stored = stored_of(a);
    if (a.rows() != rows_ || stored.nonZeros() != entries_) {
      message_ = "the matrix has another pattern than the one analyzed; call analyzePattern() again";
      info_ = Eigen::InvalidInput;
      return this->derived();
    }
    if (take(factorize(view(stored, a.rows(), a.cols())))) state_ = State::factorized;
    return this->derived();
  }
  Derived& compute(const Matrix& a) {
    analyzePattern(a);
    return info_ == Eigen::Success ? factorize(a) : this->derived();
  }

  /// Success, NumericalIssue (singular, or not positive definite), NoConvergence (the backward error is above
  /// "required_backward_error") or InvalidInput, of the last call; solve() counts, too.
  [[nodiscard]] Eigen::ComputationInfo info() const { return info_; }
  /// Why info() is not Success, and what to do.
  [[nodiscard]] const std::string& message() const { return message_; }
  [[nodiscard]] Eigen::Index rows() const { return rows_; }
  [[nodiscard]] Eigen::Index cols() const { return rows_; }

  /// Before the analysis: an option of espalier_set_option(). @throws std::invalid_argument for one that there is not
  void setOption(const char* key, const char* value) {
    if (espalier_set_option(solver_.get(), key, value) != ESPALIER_OK)
      throw std::invalid_argument(espalier_last_error(solver_.get()));
  }
  /// Facts of the last factorization: inertia, determinant, rank (espalier.h).
  [[nodiscard]] const espalier_factor_info& factorInfo() const { return factor_info_; }
  /// The solver of the C interface, for what is not here.
  [[nodiscard]] espalier_solver* handle() { return solver_.get(); }

  using Base::_solve_impl;
  /// A x = b, for solve(). @throws std::logic_error where there is no factor
  template <class Rhs, class Dest>
  void _solve_impl(const Eigen::MatrixBase<Rhs>& b, Eigen::MatrixBase<Dest>& x) const {
    x = solved(b, ESPALIER_NO_TRANSPOSE);
  }
  /// The x of A^T x = b.
  template <class Rhs>
  [[nodiscard]] Eigen::Matrix<double, Rhs::RowsAtCompileTime, Rhs::ColsAtCompileTime> solveTranspose(
      const Eigen::MatrixBase<Rhs>& b) const {
    return solved(b, ESPALIER_TRANSPOSE);
  }

 protected:
  explicit EigenSolver(const char* kind) {
    espalier_solver* solver = nullptr;
    if (espalier_create(&solver) != ESPALIER_OK) throw std::bad_alloc();
    solver_.reset(solver);
    setOption("kind", kind);
    factor_info_.size = sizeof factor_info_;
  }

 private:
  // The matrix itself where it is general and compressed, else a copy.
  using Stored = Eigen::SparseMatrix<double, Matrix::IsRowMajor ? Eigen::RowMajor : Eigen::ColMajor, StorageIndex>;
  using View = std::conditional_t<kIndexBytes == 4, espalier_matrix_i32, espalier_matrix_i64>;
  enum class State { empty, analyzed, factorized };
  struct Destroy {
    void operator()(espalier_solver* solver) const { espalier_destroy(solver); }
  };

  static Stored stored_of(const Matrix& a) {
    Stored stored;
    if constexpr (kTriangle == 0)
      stored = a;
    else
      stored = a.template triangularView<kTriangle>();
    stored.makeCompressed();
    return stored;
  }
  static View view(const Stored& a, Eigen::Index rows, Eigen::Index cols) {
    View v{};
    v.size = sizeof v;
    v.rows = rows;
    v.cols = cols;
    v.nonzeros = a.nonZeros();
    using Int = std::conditional_t<kIndexBytes == 4, std::int32_t, std::int64_t>;
    v.pointers = reinterpret_cast<const Int*>(a.outerIndexPtr());  // long or long long
    v.indices = reinterpret_cast<const Int*>(a.innerIndexPtr());
    v.values = a.valuePtr();
    v.layout = Matrix::IsRowMajor ? ESPALIER_CSR : ESPALIER_CSC;
    v.storage = kTriangle == 0                    ? ESPALIER_GENERAL
                : (kTriangle & Eigen::Lower) != 0 ? ESPALIER_SYMMETRIC_LOWER
                                                  : ESPALIER_SYMMETRIC_UPPER;
    return v;
  }
  int analyze(const espalier_matrix_i32& a) { return espalier_analyze_i32(solver_.get(), &a, nullptr); }
  int analyze(const espalier_matrix_i64& a) { return espalier_analyze_i64(solver_.get(), &a, nullptr); }
  int factorize(const espalier_matrix_i32& a) { return espalier_factorize_i32(solver_.get(), &a, &factor_info_); }
  int factorize(const espalier_matrix_i64& a) { return espalier_factorize_i64(solver_.get(), &a, &factor_info_); }

  // Notes how a call ended. Memory and devices that fail are exceptions, as in Eigen.
  bool take(int status) const {
    message_ = espalier_last_error(solver_.get());
    switch (status) {
      case ESPALIER_OK:
        info_ = Eigen::Success;
        return true;
      case ESPALIER_SINGULAR:
      case ESPALIER_NOT_POSITIVE_DEFINITE:
        info_ = Eigen::NumericalIssue;
        return false;
      case ESPALIER_ACCURACY_NOT_REACHED:
        info_ = Eigen::NoConvergence;
        return false;
      case ESPALIER_INVALID_INPUT:
        info_ = Eigen::InvalidInput;
        return false;
      case ESPALIER_OUT_OF_MEMORY:
        throw std::bad_alloc();
      default:
        throw std::runtime_error("Espalier: " + message_);
    }
  }

  template <class Rhs>
  [[nodiscard]] Eigen::MatrixXd solved(const Eigen::MatrixBase<Rhs>& b, int transpose) const {
    if (state_ != State::factorized) throw std::logic_error("Espalier: there is no factor; see info()");
    Eigen::MatrixXd x = b;
    if (x.size() > 0) take(espalier_solve(solver_.get(), x.data(), x.data(), x.cols(), transpose, nullptr));
    return x;
  }

  std::unique_ptr<espalier_solver, Destroy> solver_;
  Eigen::Index rows_ = 0, entries_ = 0;
  State state_ = State::empty;
  espalier_factor_info factor_info_{};
  mutable Eigen::ComputationInfo info_ = Eigen::Success;
  mutable std::string message_;
};

/// L L^T of a symmetric positive definite matrix. @tparam kTriangle  the one that is read
template <class Matrix, int kTriangle = Eigen::Lower>
class EspalierLLT : public EigenSolver<EspalierLLT<Matrix, kTriangle>, Matrix, kTriangle> {
 public:
  EspalierLLT() : EigenSolver<EspalierLLT, Matrix, kTriangle>("llt") {}
  explicit EspalierLLT(const Matrix& a) : EspalierLLT() { this->compute(a); }
};

/// L D L^T of a symmetric matrix, which need not be definite. @tparam kTriangle  the one that is read
template <class Matrix, int kTriangle = Eigen::Lower>
class EspalierLDLT : public EigenSolver<EspalierLDLT<Matrix, kTriangle>, Matrix, kTriangle> {
 public:
  EspalierLDLT() : EigenSolver<EspalierLDLT, Matrix, kTriangle>("ldlt") {}
  explicit EspalierLDLT(const Matrix& a) : EspalierLDLT() { this->compute(a); }
};

/// L U of any square matrix.
template <class Matrix>
class EspalierLU : public EigenSolver<EspalierLU<Matrix>, Matrix, 0> {
 public:
  EspalierLU() : EigenSolver<EspalierLU, Matrix, 0>("lu") {}
  explicit EspalierLU(const Matrix& a) : EspalierLU() { this->compute(a); }
};

}  // namespace espalier
