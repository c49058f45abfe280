#include <algorithm>
#include <cmath>
#include <vector>

#include "solve/refinement.hpp"

namespace espalier::solve {

namespace {

constexpr int kRestart = 30;  // basis vectors kept by FGMRES: memory of 60 vectors

// Vectors in the memory of a space, each in a slot of its own.
class Vectors {
 public:
  explicit Vectors(const ResidualSpace& a) : a_(a) {}
  double* take() {
    taken_.push_back(a_.vectors(kKrylovSlot + static_cast<Index>(taken_.size()), 1));
    return taken_.back().data;
  }

 private:
  const ResidualSpace& a_;
  std::vector<ResidualSpace::Vectors> taken_;
};

// The least squares problem of GMRES: column after column of the Hessenberg matrix, made triangular by Givens
// rotations.
class HessenbergProblem {
 public:
  HessenbergProblem(int columns, double beta) : rows_(columns + 1), h_(size(columns) * size(rows_), 0) {
    g_.push_back(beta);
  }

  // |residual| of the least squares solution.
  [[nodiscard]] double residual() const { return std::abs(g_.back()); }
  [[nodiscard]] double& at(int i, int j) { return h_[size(j) * size(rows_) + size(i)]; }

  // Column k is complete. False: it depends on the others, and does not count.
  bool close_column(int k) {
    for (int i = 0; i < k; ++i) {
      const double upper = c_[size(i)] * at(i, k) + s_[size(i)] * at(i + 1, k);
      at(i + 1, k) = -s_[size(i)] * at(i, k) + c_[size(i)] * at(i + 1, k);
      at(i, k) = upper;
    }
    const double radius = std::hypot(at(k, k), at(k + 1, k));
    if (!(radius > 0)) return false;
    c_.push_back(at(k, k) / radius);
    s_.push_back(at(k + 1, k) / radius);
    at(k, k) = radius;
    const double last = g_.back();
    g_.back() = c_.back() * last;
    g_.push_back(-s_.back() * last);
    return true;
  }

  // Weights of the basis vectors.
  std::vector<double> solve() {
    const auto k = static_cast<int>(c_.size());
    std::vector<double> y(g_.begin(), g_.begin() + k);
    for (int i = k - 1; i >= 0; --i) {
      for (int j = i + 1; j < k; ++j) y[size(i)] -= at(i, j) * y[size(j)];
      y[size(i)] /= at(i, i);
    }
    return y;
  }

 private:
  static std::size_t size(int i) { return static_cast<std::size_t>(i); }

  int rows_;
  std::vector<double> h_;  // column-major
  std::vector<double> c_, s_, g_;
};

}  // namespace

int solve_cg(const ResidualSpace& a, const Preconditioner& m, const double* r0, double* d, const KrylovEnd& end) {
  Vectors vectors(a);
  double *r = vectors.take(), *z = vectors.take(), *p = vectors.take(), *ap = vectors.take();
  a.copy(r0, r);
  a.combine(0, r0, 0, d);
  const double target = end.tolerance * std::sqrt(a.dot(r, r));
  double rho = 0;
  for (int step = 0; step < end.most_steps; ++step) {
    m(r, z, 1);
    const double rho_new = a.dot(r, z);
    if (!(rho_new > 0)) return step;  // the preconditioner is not positive definite, or the residual is zero
    a.combine(1, z, step == 0 ? 0 : rho_new / rho, p);
    rho = rho_new;
    a.multiply(p, ap, false);
    const double curvature = a.dot(p, ap);
    if (!(curvature > 0)) return step + 1;
    a.combine(rho / curvature, p, 1, d);
    a.combine(-rho / curvature, ap, 1, r);
    if (std::sqrt(a.dot(r, r)) <= target) return step + 1;
  }
  return end.most_steps;
}

int solve_fgmres(const ResidualSpace& a, const Preconditioner& m, const double* r0, double* d, bool transpose,
                 const KrylovEnd& end) {
  const int basis = std::min(kRestart, end.most_steps);
  a.combine(0, r0, 0, d);
  const double beta = std::sqrt(a.dot(r0, r0));
  if (!(beta > 0) || basis == 0) return 0;
  Vectors vectors(a);
  std::vector<double*> v(1, vectors.take()), z;
  a.combine(1 / beta, r0, 0, v[0]);
  HessenbergProblem h(basis, beta);
  int k = 0;
  for (; k < basis && h.residual() > end.tolerance * beta; ++k) {
    z.push_back(vectors.take());
    m(v.back(), z.back(), 1);
    double* w = vectors.take();
    a.multiply(z.back(), w, transpose);
    for (int i = 0; i <= k; ++i) {  // modified Gram-Schmidt
      h.at(i, k) = a.dot(w, v[static_cast<std::size_t>(i)]);
      a.combine(-h.at(i, k), v[static_cast<std::size_t>(i)], 1, w);
    }
    const double length = h.at(k + 1, k) = std::sqrt(a.dot(w, w));
    if (!h.close_column(k)) break;
    if (!(length > 0)) {
      ++k;
      break;
    }
    a.combine(1 / length, w, 0, w);
    v.push_back(w);
  }
  const std::vector<double> y = h.solve();
  for (std::size_t j = 0; j < y.size(); ++j) a.combine(y[j], z[j], 1, d);
  return k;
}

}  // namespace espalier::solve
