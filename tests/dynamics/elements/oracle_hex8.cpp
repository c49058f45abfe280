// One eight-node hexahedron with assumed or enhanced strains, with rows of B: the second implementation that
// elements_block_test.cpp compares with.
#include "dynamics/elements/oracle_hex8.hpp"

#include <algorithm>
#include <cmath>
#include <limits>

#include "dynamics/elements/oracles.hpp"

namespace espalier::dynamics::oracle {
namespace {

/// A = L L^T of the symmetric n x n matrix a (row i, column j at a[i * n + j]; the lower triangle is read and
/// overwritten by L). @return false when A is not positive definite
inline bool cholesky_factor(double* a, int n) {
  for (int j = 0; j < n; ++j) {
    double d = a[j * n + j];
    for (int k = 0; k < j; ++k) d -= a[j * n + k] * a[j * n + k];
    if (!(d > 0)) return false;
    d = std::sqrt(d);
    a[j * n + j] = d;
    for (int i = j + 1; i < n; ++i) {
      double s = a[i * n + j];
      for (int k = 0; k < j; ++k) s -= a[i * n + k] * a[j * n + k];
      a[i * n + j] = s / d;
    }
  }
  return true;
}

/// x = A^-1 x with the factor of cholesky_factor.
inline void cholesky_solve(const double* l, int n, double* x) {
  for (int i = 0; i < n; ++i) {
    for (int k = 0; k < i; ++k) x[i] -= l[i * n + k] * x[k];
    x[i] /= l[i * n + i];
  }
  for (int i = n - 1; i >= 0; --i) {
    for (int k = i + 1; k < n; ++k) x[i] -= l[k * n + i] * x[k];
    x[i] /= l[i * n + i];
  }
}

/// Volumetric strain -> its mean: row m of B += (1/3) (mean - trace) for the three normal components.
template <bool kRows>
ESPALIER_INLINE void average_dilatation(Element& e) {
  double volume = 0, strain = 0, rate = 0;
  Row b = {}, b_rate = {};
  for (const PointData& p : e.point) {
    volume += p.volume;
    for (int m = 0; m < 3; ++m) {
      strain += p.volume * p.strain[m];
      rate += p.volume * p.rate[m];
      for (int d = 0; kRows && d < kDofs; ++d) {
        b[d] += p.volume * p.b[m][d];
        b_rate[d] += p.volume * p.b_rate[m][d];
      }
    }
  }
  for (PointData& p : e.point) {
    const double ds = (strain / volume - p.strain[0] - p.strain[1] - p.strain[2]) / 3;
    const double dr = (rate / volume - p.rate[0] - p.rate[1] - p.rate[2]) / 3;
    Row db, db_rate;
    for (int d = 0; kRows && d < kDofs; ++d) {
      db[d] = (b[d] / volume - p.b[0][d] - p.b[1][d] - p.b[2][d]) / 3;
      db_rate[d] = (b_rate[d] / volume - p.b_rate[0][d] - p.b_rate[1][d] - p.b_rate[2][d]) / 3;
    }
    for (int m = 0; m < 3; ++m) {
      p.strain[m] += ds;
      p.rate[m] += dr;
      for (int d = 0; kRows && d < kDofs; ++d) {
        p.b[m][d] += db[d];
        p.b_rate[m][d] += db_rate[d];
      }
    }
  }
}

/// Stresses of all points and the blocks that the condensation needs.
struct Response {
  StrainStress stress[kPoints];
  double residual[kMaxModes];               // sum M^T S
  double stiffness[kMaxModes * kMaxModes];  // sum M^T C M
};

ESPALIER_INLINE bool respond(const StrainMaterial& law, const Element& e, Response& r) {
  std::fill_n(r.residual, kMaxModes, 0.0);
  std::fill_n(r.stiffness, kMaxModes * kMaxModes, 0.0);
  for (int q = 0; q < kPoints; ++q) {
    const PointData& p = e.point[q];
    double strain[6];
    for (int m = 0; m < 6; ++m) {
      strain[m] = p.strain[m];
      for (int k = 0; k < e.modes; ++k) strain[m] += p.m[m][k] * e.alpha[k];
    }
    if (!law.stress(strain, r.stress[q])) return false;
    for (int k = 0; k < e.modes; ++k) {
      double cm[6];
      for (int m = 0; m < 6; ++m) {
        cm[m] = 0;
        for (int n = 0; n < 6; ++n) cm[m] += r.stress[q].c[m][n] * p.m[n][k];
        r.residual[k] += p.volume * p.m[m][k] * r.stress[q].s[m];
      }
      for (int l = 0; l < e.modes; ++l)
        for (int m = 0; m < 6; ++m) r.stiffness[k * e.modes + l] += p.volume * p.m[m][l] * cm[m];
    }
  }
  return true;
}

/// Solves sum M^T S(E + M alpha) = 0 for alpha, starting from the linearisation at alpha = 0; `r` ends at the
/// solution, its stiffness factored. Converged when the residual no longer falls below round-off of the stress.
/// @param strains_alone  only alpha is wanted, not `r`
ESPALIER_INLINE bool solve_modes(const StrainMaterial& law, Element& e, Response& r, bool strains_alone = false) {
  constexpr int kMaxIterations = 30;
  std::fill_n(e.alpha, kMaxModes, 0.0);
  double previous = std::numeric_limits<double>::infinity();
  for (int iteration = 0; iteration < kMaxIterations; ++iteration) {
    if (!respond(law, e, r)) return false;
    if (e.modes == 0) return true;
    double norm = 0;
    for (int k = 0; k < e.modes; ++k) norm = std::max(norm, std::fabs(r.residual[k]));
    double step[kMaxModes];
    if (!cholesky_factor(r.stiffness, e.modes)) return false;
    if (iteration > 0 && (law.linear() || norm >= 0.25 * previous || norm == 0)) return true;
    std::copy_n(r.residual, e.modes, step);
    cholesky_solve(r.stiffness, e.modes, step);
    for (int k = 0; k < e.modes; ++k) e.alpha[k] -= step[k];
    if (strains_alone && law.linear()) return true;
    previous = norm;
  }
  return false;
}

ESPALIER_INLINE void add_force(const Element& e, const Response& r, ElementOutput& out) {
  for (int q = 0; q < kPoints; ++q)
    for (int m = 0; m < 6; ++m) {
      const double s = e.point[q].volume * r.stress[q].s[m];
      for (int d = 0; d < kDofs; ++d) out.force[d] += e.point[q].b[m][d] * s;
    }
}

/// Adds sum B^T C Bhat - L^T D^-1 Lhat with Bhat = wb B + wr B_rate, L = sum M^T C B.
ESPALIER_INLINE void add_material_tangent(const Element& e, const Response& r, double wb, double wr,
                                          ElementOutput& out) {
  double l[kMaxModes][kDofs] = {}, l_hat[kMaxModes][kDofs] = {};
  for (int q = 0; q < kPoints; ++q) {
    const PointData& p = e.point[q];
    double b_hat[6][kDofs], cb[6][kDofs] = {}, cb_hat[6][kDofs] = {};
    for (int m = 0; m < 6; ++m)
      for (int d = 0; d < kDofs; ++d) b_hat[m][d] = wb * p.b[m][d] + wr * p.b_rate[m][d];
    for (int m = 0; m < 6; ++m)
      for (int n = 0; n < 6; ++n) {
        const double c = p.volume * r.stress[q].c[m][n];
        if (c == 0) continue;
        for (int d = 0; d < kDofs; ++d) {
          cb[m][d] += c * p.b[n][d];
          cb_hat[m][d] += c * b_hat[n][d];
        }
      }
    for (int m = 0; m < 6; ++m)
      for (int col = 0; col < kDofs; ++col) {
        const double c = cb_hat[m][col];
        for (int row = 0; row < kDofs; ++row) out.tangent[col * kDofs + row] += p.b[m][row] * c;
      }
    for (int k = 0; k < e.modes; ++k)
      for (int m = 0; m < 6; ++m)
        for (int d = 0; d < kDofs; ++d) {
          l[k][d] += p.m[m][k] * cb[m][d];
          l_hat[k][d] += p.m[m][k] * cb_hat[m][d];
        }
  }
  for (int col = 0; col < kDofs && e.modes > 0; ++col) {
    double x[kMaxModes];
    for (int k = 0; k < e.modes; ++k) x[k] = l_hat[k][col];
    cholesky_solve(r.stiffness, e.modes, x);
    for (int k = 0; k < e.modes; ++k)
      for (int row = 0; row < kDofs; ++row) out.tangent[col * kDofs + row] -= l[k][row] * x[k];
  }
}

/// Adds the part of the tangent that comes from the second derivative of the strains: per pair of nodes a number,
/// sum over sampling points of volume * S^ij (N_a,i N_b,j + N_a,j N_b,i) / 2, S^ij the contravariant stress.
class GeometricTangent {
 public:
  ESPALIER_INLINE void add(const Gradients& dn, int component, double stress) {
    const int p = kRow[component], r = kCol[component];
    const double scale = (p == r ? 0.5 : 1.0) * stress;
    for (int a = 0; a < kNodes; ++a)
      for (int b = 0; b < kNodes; ++b) sum_[a][b] += scale * (dn[p][a] * dn[r][b] + dn[r][a] * dn[p][b]);
  }
  ESPALIER_INLINE void write(double weight, double* tangent) const {
    for (int b = 0; b < kNodes; ++b)
      for (int a = 0; a < kNodes; ++a)
        for (int i = 0; i < 3; ++i) tangent[(3 * b + i) * kDofs + 3 * a + i] += weight * sum_[a][b];
  }

 private:
  double sum_[kNodes][kNodes] = {};
};

/// Stress that works on the compatible strain: for the mean dilatation its trace is averaged like the strain's.
ESPALIER_INLINE void working_stress(Hex8Formulation formulation, const Element& e, const Response& r,
                                    double (&s)[kPoints][6]) {
  double mean = 0, volume = 0;
  for (int q = 0; q < kPoints; ++q) {
    std::copy_n(r.stress[q].s, 6, s[q]);
    mean += e.point[q].volume * (s[q][0] + s[q][1] + s[q][2]);
    volume += e.point[q].volume;
  }
  if (formulation != Hex8Formulation::mean_dilatation) return;
  for (auto& sq : s) {
    const double shift = (mean / volume - sq[0] - sq[1] - sq[2]) / 3;
    for (int m = 0; m < 3; ++m) sq[m] += shift;
  }
}

ESPALIER_INLINE void add_geometric_tangent(Hex8Formulation formulation, const Element& e, const Response& r,
                                           double weight, ElementOutput& out) {
  const Tables& table = tables();
  double s[kPoints][6], tied[8] = {};
  working_stress(formulation, e, r, s);
  GeometricTangent geometric;
  for (int q = 0; q < kPoints; ++q)
    for (int n = 0; n < 6; ++n) {
      double contravariant = 0;
      for (int m = 0; m < 6; ++m) contravariant += e.point[q].volume * e.point[q].t[m][n] * s[q][m];
      if (formulation != Hex8Formulation::shell || n == 0 || n == 1 || n == 3) {
        geometric.add(table.points.gradient[q], n, contravariant);
        continue;
      }
      for (int t = 0; t < 8; ++t)
        if (kTying[t].component == n) tied[t] += table.weight[q][t] * contravariant;
    }
  if (formulation == Hex8Formulation::shell)
    for (int t = 0; t < 8; ++t) geometric.add(table.tying[t], kTying[t].component, tied[t]);
  geometric.write(weight, out.tangent);
}

/// Strains, B rows (kRows) and enhanced modes of all points. @return false when the reference element is inverted
template <bool kRows = true>
ESPALIER_INLINE bool prepare(Hex8Formulation formulation, const ElementInput& in, Element& e) {
  const Tables& table = tables();
  double u[kDofs], v[kDofs] = {};
  for (int d = 0; d < kDofs; ++d) u[d] = in.position[d] - in.reference[d];
  if (in.velocity != nullptr) std::copy_n(in.velocity, kDofs, v);
  const bool shell = formulation == Hex8Formulation::shell;
  Bases g;
  Sample tying[8], cov[6];
  for (int t = 0; t < 8 && shell; ++t) {
    fill_bases(table.tying[t], in.reference, u, v, g);
    sample<kRows>(table.tying[t], g, kTying[t].component, tying[t]);
  }
  Mat33 centre, inverse;
  double t0[6][6];
  basis(table.centre, in.reference, centre);
  const double det0 = invert(centre, inverse);
  strain_transform(inverse, t0);
  e.modes = shell ? 8 : formulation == Hex8Formulation::enhanced ? 9 : 0;
  for (int q = 0; q < kPoints; ++q) {
    PointData& p = e.point[q];
    fill_bases(table.points.gradient[q], in.reference, u, v, g);
    const double det = invert(g.reference, inverse);
    if (!(det > 0) || !(determinant(g.current) > 0)) return false;
    for (int n = 0; n < 6; ++n) sample<kRows>(table.points.gradient[q], g, n, cov[n]);
    if (shell) tie<kRows>(table.weight[q], tying, cov);
    p.volume = table.points.weight[q] * det;
    strain_transform(inverse, p.t);
    to_cartesian<kRows>(p.t, cov, p);
    fill_modes(shell ? kShell : kEnhanced, e.modes, t0, det0 / det, table.xi[q], p);
  }
  if (formulation == Hex8Formulation::mean_dilatation) average_dilatation<kRows>(e);
  return true;
}

/// Replaces the strains by damping * rates, for the viscous pass, or adds that to them.
ESPALIER_INLINE void add_rate(double keep, double damping, Element& e) {
  for (PointData& p : e.point)
    for (int m = 0; m < 6; ++m) p.strain[m] = keep * p.strain[m] + damping * p.rate[m];
}

ESPALIER_INLINE double strain_energy(const Element& e, const Response& r) {
  double energy = 0;
  for (int q = 0; q < kPoints; ++q) energy += e.point[q].volume * r.stress[q].energy;
  return energy;
}

bool evaluate(Hex8Formulation formulation, const Material& material, const ElementInput& in, ElementOutput& out) {
  Element e;
  Response r;
  if (!prepare(formulation, in, e)) return false;
  const bool tangent = out.tangent != nullptr;
  const bool damped = in.damping != 0 && in.velocity != nullptr;
  std::fill_n(out.force, kDofs, 0.0);
  if (tangent) std::fill_n(out.tangent, kDofs * kDofs, 0.0);
  const StrainMaterial law(material);
  if (!solve_modes(law, e, r)) return false;
  out.energy = strain_energy(e, r);
  add_force(e, r, out);
  if (tangent) {
    add_material_tangent(e, r, in.position_weight, 0, out);
    add_geometric_tangent(formulation, e, r, in.position_weight, out);
  }
  if (in.damping == 0) return true;
  // Viscous stress: the linear law at the strain beta dE/dt, with its own enhanced parameters (their rates), so that
  // the damping of bending does not lock either.
  const StrainMaterial viscous(Material{SolidLaw::st_venant_kirchhoff, material.young, material.poisson, 0});
  add_rate(0, damped ? in.damping : 0, e);
  if (!solve_modes(viscous, e, r)) return false;
  add_force(e, r, out);
  if (tangent) {
    add_material_tangent(e, r, in.damping * in.velocity_weight, in.damping * in.position_weight, out);
    add_geometric_tangent(formulation, e, r, in.position_weight, out);
  }
  return true;
}

}  // namespace

bool evaluate_hex8(Hex8Formulation formulation, const Material& material, const ElementInput& in, ElementOutput& out) {
  return evaluate(formulation, material, in, out);
}

bool sample_hex8(Hex8Formulation formulation, const Material& material, const double* reference, const double* position,
                 ElementSamples& out) {
  Element e;
  Response r;
  if (!prepare<false>(formulation, {reference, position, nullptr}, e)) return false;
  if (!solve_modes(StrainMaterial(material), e, r, true)) return false;
  for (int q = 0; q < kPoints; ++q)
    for (int m = 0; m < 6; ++m) {
      out.value[q][m] = e.point[q].strain[m];
      for (int k = 0; k < e.modes; ++k) out.value[q][m] += e.point[q].m[m][k] * e.alpha[k];
    }
  return true;
}

}  // namespace espalier::dynamics::oracle
