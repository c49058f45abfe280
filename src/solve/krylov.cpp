#include <algorithm>
#include <cmath>
#include <initializer_list>
#include <span>
#include <utility>
#include <vector>

#include "solve/refinement.hpp"

namespace espalier::solve {

namespace {

constexpr int kRestart = 30;  // basis vectors kept by FGMRES: memory of 60 vectors a column

template <class Pointer>
Pointer vector_of(const ResidualSpace& a, Pointer block, std::size_t column) {
  return block + static_cast<Offset>(column) * a.size();
}

// Blocks of vectors in the memory of a space, each in a slot of its own.
class Blocks {
 public:
  explicit Blocks(const ResidualSpace& a) : a_(a) {}
  double* take(std::size_t columns) {
    taken_.push_back(a_.vectors(kKrylovSlot + static_cast<Index>(taken_.size()), static_cast<Index>(columns)));
    return taken_.back().data;
  }

 private:
  const ResidualSpace& a_;
  std::vector<ResidualSpace::Vectors> taken_;
};

// Columns that go on stand side by side, in their order: those that are done leave, and what `blocks` hold of the
// others moves to the left.
template <class Column>
void close_ranks(const ResidualSpace& a, std::vector<Column*>& going, std::initializer_list<double*> blocks) {
  std::size_t kept = 0;
  for (std::size_t k = 0; k < going.size(); ++k) {
    if (going[k]->done) continue;
    if (kept != k)
      for (double* block : blocks) a.copy(vector_of(a, block, k), vector_of(a, block, kept));
    going[kept++] = going[k];
  }
  going.resize(kept);
}

// The least squares problem of GMRES: column after column of the Hessenberg matrix, made triangular by Givens
// rotations.
class HessenbergProblem {
 public:
  HessenbergProblem(int columns, double beta) : rows_(columns + 1), h_(size(columns) * size(rows_), 0) {
    g_.push_back(beta);
  }

  // |residual| of the least squares solution.
  [[nodiscard]] double residual() const { return std::abs(g_.back()); }
  [[nodiscard]] double at(int i, int j) const { return h_[size(j) * size(rows_) + size(i)]; }
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
  [[nodiscard]] std::vector<double> solve() const {
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

struct CgColumn {
  KrylovColumn* asked;
  double* d;
  double target = 0;  // |residual|
  double rho = 0;     // r^T M r
  bool done = false;
};

struct FgmresColumn {
  KrylovColumn* asked;
  double* d;
  double beta;  // |r|
  HessenbergProblem h;
  std::vector<double*> v, z;
  bool done = false;

  [[nodiscard]] bool ends() const {
    const int k = asked->steps;
    return k >= basis() || h.residual() <= asked->end.tolerance * beta;
  }
  [[nodiscard]] int basis() const { return std::min(kRestart, asked->end.most_steps); }
};

// w = A z_k becomes the next basis vector (modified Gram-Schmidt).
void extend_basis(const ResidualSpace& a, FgmresColumn& c, double* w) {
  const int k = c.asked->steps;
  for (int i = 0; i <= k; ++i) {
    double* const v = c.v[static_cast<std::size_t>(i)];
    c.h.at(i, k) = a.dot(w, v);
    a.combine(-c.h.at(i, k), v, 1, w);
  }
  const double length = c.h.at(k + 1, k) = std::sqrt(a.dot(w, w));
  c.done = !c.h.close_column(k);
  if (c.done) return;
  ++c.asked->steps;
  c.done = !(length > 0) || c.ends();
  if (!c.done) a.combine(1 / length, w, 0, w);
}

void add_up(const ResidualSpace& a, const FgmresColumn& c) {
  const std::vector<double> y = c.h.solve();
  for (std::size_t j = 0; j < y.size(); ++j) a.combine(y[j], c.z[j], 1, c.d);
}

}  // namespace

void solve_cg(const ResidualSpace& a, const Preconditioner& m, const double* r0, double* d,
              std::span<KrylovColumn> columns) {
  Blocks blocks(a);
  double *r = blocks.take(columns.size()), *z = blocks.take(columns.size()), *p = blocks.take(columns.size()),
         *ap = blocks.take(columns.size());
  std::vector<CgColumn> all;
  for (std::size_t k = 0; k < columns.size(); ++k) {
    const double* from = vector_of(a, r0, k);
    columns[k].steps = 0;
    all.push_back({&columns[k], vector_of(a, d, k)});
    a.combine(0, from, 0, all.back().d);
    a.copy(from, vector_of(a, r, k));
    all.back().target = columns[k].end.tolerance * std::sqrt(a.dot(from, from));
    all.back().done = columns[k].end.most_steps <= 0;
  }
  std::vector<CgColumn*> going;
  for (CgColumn& c : all) going.push_back(&c);
  close_ranks(a, going, {r});
  for (bool first = true; !going.empty(); first = false) {
    m(r, z, static_cast<Index>(going.size()));
    for (std::size_t k = 0; k < going.size(); ++k) {
      CgColumn& c = *going[k];
      const double* zk = vector_of(a, z, k);
      const double rho = a.dot(vector_of(a, r, k), zk);
      c.done = !(rho > 0);  // the preconditioner is not positive definite, or the residual is zero
      if (c.done) continue;
      a.combine(1, zk, first ? 0 : rho / c.rho, vector_of(a, p, k));
      c.rho = rho;
    }
    close_ranks(a, going, {r, p});
    a.multiply_columns(p, ap, static_cast<Index>(going.size()), false);
    for (std::size_t k = 0; k < going.size(); ++k) {
      CgColumn& c = *going[k];
      double *pk = vector_of(a, p, k), *apk = vector_of(a, ap, k), *rk = vector_of(a, r, k);
      const double curvature = a.dot(pk, apk);
      ++c.asked->steps;
      c.done = !(curvature > 0);
      if (c.done) continue;
      a.combine(c.rho / curvature, pk, 1, c.d);
      a.combine(-c.rho / curvature, apk, 1, rk);
      c.done = std::sqrt(a.dot(rk, rk)) <= c.target || c.asked->steps >= c.asked->end.most_steps;
    }
    close_ranks(a, going, {r, p});
  }
}

void solve_fgmres(const ResidualSpace& a, const Preconditioner& m, const double* r0, double* d, bool transpose,
                  std::span<KrylovColumn> columns) {
  Blocks blocks(a);
  std::vector<FgmresColumn> all;
  for (std::size_t k = 0; k < columns.size(); ++k) {
    const double* from = vector_of(a, r0, k);
    columns[k].steps = 0;
    const double beta = std::sqrt(a.dot(from, from));
    const int basis = std::max(0, std::min(kRestart, columns[k].end.most_steps));
    all.push_back({&columns[k], vector_of(a, d, k), beta, HessenbergProblem(basis, beta), {}, {}});
    a.combine(0, from, 0, all.back().d);
    all.back().done = !(beta > 0) || all.back().ends();
  }
  std::vector<FgmresColumn*> going;
  for (FgmresColumn& c : all)
    if (!c.done) going.push_back(&c);
  if (going.empty()) return;
  double* v = blocks.take(going.size());
  for (std::size_t k = 0; k < going.size(); ++k) {
    FgmresColumn& c = *going[k];
    a.combine(1 / c.beta, r0 + (c.d - d), 0, vector_of(a, v, k));
  }
  while (!going.empty()) {
    double* const z = blocks.take(going.size());
    double* const w = blocks.take(going.size());
    const auto count = static_cast<Index>(going.size());
    m(v, z, count);
    a.multiply_columns(z, w, count, transpose);
    for (std::size_t k = 0; k < going.size(); ++k) {
      FgmresColumn& c = *going[k];
      c.v.push_back(vector_of(a, v, k));
      c.z.push_back(vector_of(a, z, k));
      extend_basis(a, c, vector_of(a, w, k));
      if (c.done) add_up(a, c);
    }
    close_ranks(a, going, {w});
    v = w;
  }
}

}  // namespace espalier::solve
