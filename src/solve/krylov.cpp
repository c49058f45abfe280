#include <algorithm>
#include <cmath>
#include <numeric>
#include <vector>

#include "solve/refinement.hpp"

namespace espalier::solve {

namespace {

double dot(std::span<const double> a, std::span<const double> b) {
  return std::inner_product(a.begin(), a.end(), b.begin(), 0.0);
}

double norm(std::span<const double> a) { return std::sqrt(dot(a, a)); }

void add_scaled(double factor, std::span<const double> from, std::span<double> to) {
  for (std::size_t i = 0; i < to.size(); ++i) to[i] += factor * from[i];
}

constexpr int kRestart = 30;  // basis vectors kept by FGMRES: memory of 60 vectors

}  // namespace

int solve_cg(const ResidualOperator& a, const Preconditioner& m, std::span<const double> r0, std::span<double> d,
             const KrylovEnd& end) {
  const std::size_t n = r0.size();
  std::vector<double> r(r0.begin(), r0.end());
  std::vector<double> z(n);
  std::vector<double> p(n);
  std::vector<double> ap(n);
  std::fill(d.begin(), d.end(), 0.0);
  const double target = end.tolerance * norm(r);
  double rho = 0;
  for (int step = 0; step < end.most_steps; ++step) {
    m(r.data(), z.data(), 1);
    const double rho_new = dot(r, z);
    if (!(rho_new > 0)) return step;  // the preconditioner is not positive definite, or the residual is zero
    const double beta = step == 0 ? 0 : rho_new / rho;
    for (std::size_t i = 0; i < n; ++i) p[i] = z[i] + beta * p[i];
    rho = rho_new;
    a.multiply(p.data(), ap.data(), false);
    const double curvature = dot(p, ap);
    if (!(curvature > 0)) return step + 1;
    add_scaled(rho / curvature, p, d);
    add_scaled(-rho / curvature, ap, r);
    if (norm(r) <= target) return step + 1;
  }
  return end.most_steps;
}

int solve_fgmres(const ResidualOperator& a, const Preconditioner& m, std::span<const double> r0, std::span<double> d,
                 bool transpose, const KrylovEnd& end) {
  const std::size_t n = r0.size();
  const int basis = std::min(kRestart, end.most_steps);
  std::fill(d.begin(), d.end(), 0.0);
  const double beta = norm(r0);
  if (!(beta > 0) || basis == 0) return 0;
  std::vector<std::vector<double>> v(1, std::vector<double>(r0.begin(), r0.end()));
  std::vector<std::vector<double>> z;
  for (double& e : v[0]) e /= beta;
  std::vector<double> h(static_cast<std::size_t>(basis + 1) * static_cast<std::size_t>(basis), 0);  // column-major
  const auto at = [&](int i, int j) -> double& { return h[static_cast<std::size_t>(j * (basis + 1) + i)]; };
  std::vector<double> c(static_cast<std::size_t>(basis));
  std::vector<double> s(static_cast<std::size_t>(basis));
  std::vector<double> g(static_cast<std::size_t>(basis) + 1, 0);
  g[0] = beta;
  int k = 0;
  for (; k < basis && std::abs(g[static_cast<std::size_t>(k)]) > end.tolerance * beta; ++k) {
    z.emplace_back(n);
    m(v[static_cast<std::size_t>(k)].data(), z.back().data(), 1);
    std::vector<double> w(n);
    a.multiply(z.back().data(), w.data(), transpose);
    for (int i = 0; i <= k; ++i) {  // modified Gram-Schmidt
      at(i, k) = dot(w, v[static_cast<std::size_t>(i)]);
      add_scaled(-at(i, k), v[static_cast<std::size_t>(i)], w);
    }
    const double length = norm(w);
    at(k + 1, k) = length;
    for (int i = 0; i < k; ++i) {  // earlier Givens rotations
      const auto q = static_cast<std::size_t>(i);
      const double upper = c[q] * at(i, k) + s[q] * at(i + 1, k);
      at(i + 1, k) = -s[q] * at(i, k) + c[q] * at(i + 1, k);
      at(i, k) = upper;
    }
    const auto q = static_cast<std::size_t>(k);
    const double radius = std::hypot(at(k, k), at(k + 1, k));
    if (!(radius > 0)) break;
    c[q] = at(k, k) / radius;
    s[q] = at(k + 1, k) / radius;
    at(k, k) = radius;
    g[q + 1] = -s[q] * g[q];
    g[q] *= c[q];
    if (!(length > 0)) {
      ++k;
      break;
    }
    for (double& e : w) e /= length;
    v.push_back(std::move(w));
  }
  for (int i = k - 1; i >= 0; --i) {  // back substitution, y overwrites g
    double sum = g[static_cast<std::size_t>(i)];
    for (int j = i + 1; j < k; ++j) sum -= at(i, j) * g[static_cast<std::size_t>(j)];
    g[static_cast<std::size_t>(i)] = sum / at(i, i);
  }
  for (int j = 0; j < k; ++j) add_scaled(g[static_cast<std::size_t>(j)], z[static_cast<std::size_t>(j)], d);
  return k;
}

}  // namespace espalier::solve
