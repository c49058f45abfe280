/// \file
/// The formulas of hex8_strain.cpp for a lane type T: all formulations and laws, for what hex8_block-inl.hpp does not
/// cover (shells, and laws that are not linear in the Green-Lagrange strain). Included after it, in the same places.
///
/// Rows of B stay in covariant components of the strain, E_cov = J^T E J, which need no transformation; stresses and
/// the moduli of the law are brought to them instead: with E = T E_cov, S_cov = T^T S and C_cov = T^T C T.

template <class T>
using StrainRows = T[6][kDofs];

/// One integration point.
template <class T>
struct StrainPoint {
  T volume, scale;            // weight * det; det0 / det of the enhanced modes
  T t[6][6];                  // E = T E_cov
  T strain[6], rate[6];       // Cartesian
  StrainRows<T> b, b_rate;    // covariant
  T stress[6], moduli[6][6];  // Cartesian, at the enhanced strain
  T energy;
};

template <class T>
struct StrainWork {
  T reference[kDofs], displacement[kDofs], velocity[kDofs];
  StrainPoint<T> point[kQ];
  T t0[6][6];  // T at the centre
  T alpha[kModes], residual[kModes];
  BlockModes<T> modes;
};

/// Which enhanced modes a formulation has.
struct ModeList {
  const hex8::Mode* mode;
  int count;
  explicit ModeList(Hex8Formulation f)
      : mode(f == Hex8Formulation::shell ? hex8::kShell : hex8::kEnhanced),
        count(f == Hex8Formulation::shell      ? 8
              : f == Hex8Formulation::enhanced ? kModes
                                               : 0) {}
  [[nodiscard]] double value(int k, int q) const { return hex8::polynomial(mode[k].polynomial, hex8::tables().xi[q]); }
};

/// Covariant bases at a sampling point.
template <class T>
struct SampledBases {
  Tensor<T> reference, displacement, current, velocity;
  SampledBases(const hex8::Gradients& dn, const StrainWork<T>& w) {
    local_gradient<T, kN>(w.reference, dn, reference);
    local_gradient<T, kN>(w.displacement, dn, displacement);
    local_gradient<T, kN>(w.velocity, dn, velocity);
    for (int i = 0; i < 3; ++i)
      for (int d = 0; d < 3; ++d) current.x[i][d] = reference.x[i][d] + displacement.x[i][d];
  }
};

/// Component c of the covariant strain, its rate, and their rows of B.
template <class T>
void sample_strain(const hex8::Gradients& dn, const SampledBases<T>& g, int c, T& strain, T& rate, T (&b)[kDofs],
                   T (&b_rate)[kDofs]) {
  const int p = voigt_row(c), r = voigt_column(c);
  const double scale = p == r ? 0.5 : 1.0;
  T sum(0.0), sum_rate(0.0);
  for (int i = 0; i < 3; ++i) {
    const T up = g.displacement.x[i][p], ur = g.displacement.x[i][r];
    sum = mul_add(g.reference.x[i][p], ur, mul_add(up, g.reference.x[i][r], mul_add(up, ur, sum)));
    sum_rate = mul_add(g.current.x[i][p], g.velocity.x[i][r], mul_add(g.velocity.x[i][p], g.current.x[i][r], sum_rate));
    for (int a = 0; a < kN; ++a) {
      const T np(scale * dn[p][a]), nr(scale * dn[r][a]);
      b[3 * a + i] = mul_add(np, g.current.x[i][r], nr * g.current.x[i][p]);
      b_rate[3 * a + i] = mul_add(np, g.velocity.x[i][r], nr * g.velocity.x[i][p]);
    }
  }
  strain = T(scale) * sum;
  rate = T(scale) * sum_rate;
}

/// T with E = T E_cov in the engineering order, A = (dX/dxi)^-1, as hex8::strain_transform().
template <class T>
void transform_of(const Tensor<T>& a, T (&t)[6][6]) {
  for (int m = 0; m < 6; ++m) {
    const int i = voigt_row(m), j = voigt_column(m);
    for (int n = 0; n < 6; ++n) {
      const int p = voigt_row(n), r = voigt_column(n);
      const T both = mul_add(a.x[p][i], a.x[r][j], a.x[r][i] * a.x[p][j]);
      t[m][n] = T((i == j ? 1.0 : 2.0) * 0.5) * both;
    }
  }
}

/// y = A x, or A^T x
template <class T>
void times(const T (&a)[6][6], const T (&x)[6], bool transposed, T (&y)[6]) {
  for (int m = 0; m < 6; ++m) {
    y[m] = (transposed ? a[0][m] : a[m][0]) * x[0];
    for (int n = 1; n < 6; ++n) y[m] = mul_add(transposed ? a[n][m] : a[m][n], x[n], y[m]);
  }
}

template <class T>
void load_strain_state(const BlockInput& in, StrainWork<T>& w) {
  for (int k = 0; k < kDofs; ++k) {
    w.reference[k] = T::load(in.reference + k * T::kWidth);
    w.displacement[k] = T::load(in.position + k * T::kWidth) - w.reference[k];
    w.velocity[k] = in.velocity == nullptr ? T(0.0) : T::load(in.velocity + k * T::kWidth);
  }
}

/// Covariant strains and rows of one point; those that a shell ties are interpolated.
template <class T>
void fill_rows(bool shell, int q, const SampledBases<T>& g, const T (&tied)[8], const T (&tied_rate)[8],
               const T (&tying)[8][kDofs], const T (&tying_rate)[8][kDofs], T (&strain)[6], T (&rate)[6],
               StrainPoint<T>& p) {
  const hex8::Tables& table = hex8::tables();
  for (int c = 0; c < 6; ++c) {
    if (!shell || (c != 2 && c != 4 && c != 5)) {
      sample_strain(table.points.gradient[q], g, c, strain[c], rate[c], p.b[c], p.b_rate[c]);
      continue;
    }
    strain[c] = rate[c] = T(0.0);
    for (int d = 0; d < kDofs; ++d) p.b[c][d] = p.b_rate[c][d] = T(0.0);
    for (int t = 0; t < 8; ++t) {
      if (hex8::kTying[t].component != c) continue;
      const T weight(table.weight[q][t]);
      strain[c] = mul_add(weight, tied[t], strain[c]);
      rate[c] = mul_add(weight, tied_rate[t], rate[c]);
      for (int d = 0; d < kDofs; ++d) {
        p.b[c][d] = mul_add(weight, tying[t][d], p.b[c][d]);
        p.b_rate[c][d] = mul_add(weight, tying_rate[t][d], p.b_rate[c][d]);
      }
    }
  }
}

/// Strains and rows of all points.
template <class T>
typename T::Mask prepare_strains(bool shell, StrainWork<T>& w) {
  const hex8::Tables& table = hex8::tables();
  typename T::Mask good = T::all();
  T tied[8], tied_rate[8];
  T tying[8][kDofs], tying_rate[8][kDofs];
  for (int t = 0; t < 8 && shell; ++t) {
    const SampledBases<T> g(table.tying[t], w);
    sample_strain(table.tying[t], g, hex8::kTying[t].component, tied[t], tied_rate[t], tying[t], tying_rate[t]);
  }
  Tensor<T> inverse;
  const T det0 = invert_jacobian<T, kN>(w.reference, table.centre, inverse);
  transform_of(inverse, w.t0);
  for (int q = 0; q < kQ; ++q) {
    StrainPoint<T>& p = w.point[q];
    const SampledBases<T> g(table.points.gradient[q], w);
    const T det = invert_tensor(g.reference, inverse);
    good = and_positive(and_positive(good, det), determinant_of(g.current));
    p.volume = T(table.points.weight[q]) * det;
    p.scale = det0 / det;
    transform_of(inverse, p.t);
    T strain[6], rate[6];
    fill_rows(shell, q, g, tied, tied_rate, tying, tying_rate, strain, rate, p);
    times(p.t, strain, false, p.strain);
    times(p.t, rate, false, p.rate);
  }
  return good;
}

/// The trace of the strain as a row of B: sum of T_mn b_n over m < 3.
template <class T>
void trace_row(const StrainPoint<T>& p, const StrainRows<T>& b, T (&row)[kDofs]) {
  T weight[6];
  for (int n = 0; n < 6; ++n) weight[n] = p.t[0][n] + p.t[1][n] + p.t[2][n];
  for (int d = 0; d < kDofs; ++d) {
    row[d] = weight[0] * b[0][d];
    for (int n = 1; n < 6; ++n) row[d] = mul_add(weight[n], b[n][d], row[d]);
  }
}

/// Volumetric strain -> its mean: (mean - trace) / 3 is added to the normal components, whose covariant form is the
/// metric J^T J.
template <class T, class Rows>
void average_rows(const Tensor<T> (&metric)[kQ], T volume, const Rows& rows, StrainWork<T>& w) {
  T mean[kDofs], trace[kQ][kDofs];
  for (T& value : mean) value = T(0.0);
  for (int q = 0; q < kQ; ++q) {
    trace_row(w.point[q], rows(w.point[q]), trace[q]);
    for (int d = 0; d < kDofs; ++d) mean[d] = mul_add(w.point[q].volume, trace[q][d], mean[d]);
  }
  const T by_volume = T(1.0) / volume;
  for (int q = 0; q < kQ; ++q) {
    auto& b = rows(w.point[q]);
    for (int d = 0; d < kDofs; ++d) {
      const T shift = T(1.0 / 3) * mul_add(by_volume, mean[d], T(0.0) - trace[q][d]);
      for (int c = 0; c < 6; ++c)
        b[c][d] = mul_add(T(c < 3 ? 1.0 : 2.0) * metric[q].x[voigt_row(c)][voigt_column(c)], shift, b[c][d]);
    }
  }
}

template <class T>
void average_dilatation(StrainWork<T>& w) {
  Tensor<T> metric[kQ];
  T volume(0.0), strain(0.0), rate(0.0);
  for (int q = 0; q < kQ; ++q) {
    const StrainPoint<T>& p = w.point[q];
    Tensor<T> j;
    local_gradient<T, kN>(w.reference, hex8::tables().points.gradient[q], j);
    for (int r = 0; r < 3; ++r)
      for (int s = 0; s < 3; ++s)
        metric[q].x[r][s] = mul_add(j.x[0][r], j.x[0][s], mul_add(j.x[1][r], j.x[1][s], j.x[2][r] * j.x[2][s]));
    volume = volume + p.volume;
    strain = mul_add(p.volume, p.strain[0] + p.strain[1] + p.strain[2], strain);
    rate = mul_add(p.volume, p.rate[0] + p.rate[1] + p.rate[2], rate);
  }
  for (StrainPoint<T>& p : w.point) {
    const T ds = T(1.0 / 3) * (strain / volume - (p.strain[0] + p.strain[1] + p.strain[2]));
    const T dr = T(1.0 / 3) * (rate / volume - (p.rate[0] + p.rate[1] + p.rate[2]));
    for (int m = 0; m < 3; ++m) {
      p.strain[m] = p.strain[m] + ds;
      p.rate[m] = p.rate[m] + dr;
    }
  }
  average_rows(
      metric, volume, [](StrainPoint<T>& p) -> StrainRows<T>& { return p.b; }, w);
  average_rows(
      metric, volume, [](StrainPoint<T>& p) -> StrainRows<T>& { return p.b_rate; }, w);
}

/// S(E), dS/dE and the energy, as StrainMaterial.
template <class T>
void linear_law(const Hex8Law& law, const T (&e)[6], StrainPoint<T>& p) {
  linear_stress(law.lambda, law.mu, e, p.stress);
  p.energy = T(0.5) * inner(p.stress, e);
  for (int m = 0; m < 6; ++m)
    for (int n = 0; n < 6; ++n)
      p.moduli[m][n] = T((m < 3 && n < 3 ? law.lambda : 0.0) + (m == n ? (m < 3 ? 2 * law.mu : law.mu) : 0.0));
}

/// S = mu (I - C^-1) + lambda ln J C^-1, dS/dE = lambda C^-1 x C^-1 + 2 (mu - lambda ln J) I_(C^-1), I - C^-1 =
/// C^-1 (C - I). @return where det C > 0
template <class T>
typename T::Mask neo_hookean_law(const Hex8Law& law, const T (&e)[6], StrainPoint<T>& p) {
  Tensor<T> twice, inverse, difference;
  for (int m = 0; m < 6; ++m)
    twice.x[voigt_row(m)][voigt_column(m)] = twice.x[voigt_column(m)][voigt_row(m)] = m < 3 ? T(2.0) * e[m] : e[m];
  const T change = volume_change_of(twice);  // det C - 1
  const T log_j = T(0.5) * log_one_plus(change);
  static_cast<void>(invert_tensor(plus_identity(twice), inverse));
  product(inverse, twice, difference);
  const T pull = T(law.lambda) * log_j, mu2 = T(law.mu) - pull;
  for (int m = 0; m < 6; ++m) {
    const int i = voigt_row(m), j = voigt_column(m);
    p.stress[m] = mul_add(T(0.5 * law.mu), difference.x[i][j] + difference.x[j][i], pull * inverse.x[i][j]);
    for (int n = m; n < 6; ++n) {
      const int k = voigt_row(n), l = voigt_column(n);
      const T both = mul_add(inverse.x[i][k], inverse.x[j][l], inverse.x[i][l] * inverse.x[j][k]);
      p.moduli[m][n] = p.moduli[n][m] = mul_add(T(law.lambda) * inverse.x[i][j], inverse.x[k][l], mu2 * both);
    }
  }
  p.energy = mul_add(T(law.mu), e[0] + e[1] + e[2] - log_j, T(0.5) * pull * log_j);
  return and_positive(T::all(), T(1.0) + change);
}

/// The law at the strains enhanced by alpha; sum M^T S, and D = sum M^T C M with its factor.
template <class T>
typename T::Mask respond_strains(const Hex8Law& law, bool linear, const ModeList& list, StrainWork<T>& w) {
  typename T::Mask good = T::all();
  for (T& value : w.residual) value = T(0.0);
  for (int i = 0; i < kModes; ++i)
    for (int j = 0; j <= i; ++j) w.modes.d[i][j] = T(i == j && i >= list.count ? 1.0 : 0.0);
  for (int q = 0; q < kQ; ++q) {
    StrainPoint<T>& p = w.point[q];
    T combined[6], enhanced[6], strain[6];
    for (T& value : combined) value = T(0.0);
    for (int k = 0; k < list.count; ++k) {
      const int c = list.mode[k].component;
      combined[c] = mul_add(T(list.value(k, q)) * p.scale, w.alpha[k], combined[c]);
    }
    times(w.t0, combined, false, enhanced);
    for (int m = 0; m < 6; ++m) strain[m] = p.strain[m] + enhanced[m];
    if (linear)
      linear_law(law, strain, p);
    else
      good = mask_and(good, neo_hookean_law(law, strain, p));
    if (list.count == 0) continue;
    T s0[6], c0[6][6], z[6][6];  // S and C in the components of the modes
    times(w.t0, p.stress, true, s0);
    for (int c = 0; c < 6; ++c) {
      T column[6];
      for (int m = 0; m < 6; ++m) column[m] = w.t0[m][c];
      times(p.moduli, column, false, c0[c]);
    }
    for (int c = 0; c < 6; ++c) times(w.t0, c0[c], true, z[c]);
    const T weight = p.volume * p.scale;
    for (int i = 0; i < list.count; ++i) {
      const int c = list.mode[i].component;
      const T wi = T(list.value(i, q)) * weight;
      w.residual[i] = mul_add(wi, s0[c], w.residual[i]);
      for (int j = 0; j <= i; ++j)
        w.modes.d[i][j] = mul_add(wi * p.scale, T(list.value(j, q)) * z[c][list.mode[j].component], w.modes.d[i][j]);
    }
  }
  return factor_modes(good, w.modes);
}

/// Solves sum M^T S(E + M alpha) = 0, as solve_modes() of hex8_strain.cpp, each lane until it has converged itself.
template <class T>
typename T::Mask solve_alpha(const Hex8Law& law, bool linear, const ModeList& list, StrainWork<T>& w) {
  constexpr int kMaxIterations = 30;
  typename T::Mask good = T::all(), done = mask_not(T::all());
  T previous(0.0);
  for (T& value : w.alpha) value = T(0.0);
  for (int iteration = 0; iteration < kMaxIterations; ++iteration) {
    good = mask_and(good, mask_or(done, respond_strains(law, linear, list, w)));
    if (list.count == 0) return good;
    T norm(0.0);
    for (int k = 0; k < list.count; ++k) norm = larger(norm, magnitude(w.residual[k]));
    if (iteration > 0) {
      if (linear) return good;
      // converged: the residual falls no longer, or is zero; what is not a number is not whole
      done = mask_or(done, mask_not(and_positive(T::all(), mul_add(T(0.25), previous, T(0.0) - norm))));
      if (T::bits(done) == T::bits(T::all())) return good;
    }
    T step[kModes];
    for (int k = 0; k < kModes; ++k) step[k] = w.residual[k];
    solve_modes(w.modes, step);
    for (int k = 0; k < list.count; ++k) w.alpha[k] = select(done, w.alpha[k], w.alpha[k] - step[k]);
    previous = norm;
  }
  return mask_and(good, done);
}

template <class T>
void add_strain_force(const StrainWork<T>& w, T (&f)[kDofs]) {
  for (const StrainPoint<T>& p : w.point) {
    T s[6];
    times(p.t, p.stress, true, s);
    for (int c = 0; c < 6; ++c) {
      const T weight = p.volume * s[c];
      for (int d = 0; d < kDofs; ++d) f[d] = mul_add(p.b[c][d], weight, f[d]);
    }
  }
}

/// out[c] = sum_n a[c][n] rows[n]
template <class T>
void multiply_rows(const T (&a)[6][6], const StrainRows<T>& rows, StrainRows<T>& out) {
  for (int c = 0; c < 6; ++c)
    for (int d = 0; d < kDofs; ++d) {
      out[c][d] = a[c][0] * rows[0][d];
      for (int n = 1; n < 6; ++n) out[c][d] = mul_add(a[c][n], rows[n][d], out[c][d]);
    }
}

/// tangent += x^T y; with `first` it is written.
template <class T>
void add_row_products(const StrainRows<T>& x, const StrainRows<T>& y, bool symmetric, bool first, double* tangent) {
  for (int a = 0; a < kN; ++a)
    for (int b = symmetric ? a : 0; b < kN; ++b)
      for (int j = 0; j < 3; ++j)
        for (int i = 0; i < 3; ++i) {
          double* to = block_of<T, kN>(tangent, a, b, i, j);
          T sum = first ? T(0.0) : T::load(to);
          for (int c = 0; c < 6; ++c) sum = mul_add(x[c][3 * a + i], y[c][3 * b + j], sum);
          sum.store(to);
        }
}

/// l_k += value * row of the mode's component
template <class T>
void add_mode_rows(const ModeList& list, int q, const StrainRows<T>& rows, T (&l)[kModes][kN][3]) {
  for (int k = 0; k < list.count; ++k)
    for (int d = 0; d < kDofs; ++d)
      l[k][d / 3][d % 3] = mul_add(T(list.value(k, q)), rows[list.mode[k].component][d], l[k][d / 3][d % 3]);
}

/// Adds sum B^T C Bhat - L^T D^-1 Lhat with Bhat = wb B + wr B_rate, L = sum M^T C B.
template <class T>
void add_material_tangent(const ModeList& list, double wb, double wr, bool symmetric, bool first, StrainWork<T>& w,
                          double* tangent) {
  T l[kModes][kN][3], hat[kModes][kN][3];
  for (int k = 0; k < kModes; ++k)
    for (int a = 0; a < kN; ++a)
      for (int i = 0; i < 3; ++i) l[k][a][i] = hat[k][a][i] = T(0.0);
  for (int q = 0; q < kQ; ++q) {
    const StrainPoint<T>& p = w.point[q];
    T ct[6][6], moduli[6][6];  // C T by columns, T^T C T
    for (int n = 0; n < 6; ++n) {
      T column[6];
      for (int m = 0; m < 6; ++m) column[m] = p.volume * p.t[m][n];
      times(p.moduli, column, false, ct[n]);
    }
    for (int n = 0; n < 6; ++n) times(p.t, ct[n], true, moduli[n]);  // symmetric
    StrainRows<T> b_hat, rows;
    for (int c = 0; c < 6; ++c)
      for (int d = 0; d < kDofs; ++d) b_hat[c][d] = mul_add(T(wr), p.b_rate[c][d], T(wb) * p.b[c][d]);
    multiply_rows(moduli, b_hat, rows);
    add_row_products(p.b, rows, symmetric, first && q == 0, tangent);
    if (list.count == 0) continue;
    T coupling[6][6];  // scale T0^T C T
    for (int c = 0; c < 6; ++c)
      for (int n = 0; n < 6; ++n) {
        T sum = w.t0[0][c] * ct[n][0];
        for (int m = 1; m < 6; ++m) sum = mul_add(w.t0[m][c], ct[n][m], sum);
        coupling[c][n] = p.scale * sum;
      }
    multiply_rows(coupling, p.b, rows);
    add_mode_rows(list, q, rows, l);
    if (symmetric) continue;
    multiply_rows(coupling, b_hat, rows);
    add_mode_rows(list, q, rows, hat);
  }
  if (list.count == 0) return;
  solve_rows(w.modes, l);
  if (!symmetric) solve_rows(w.modes, hat);
  add_products<T>(l, symmetric ? l : hat, kModes, T(symmetric ? -wb : -1.0), symmetric, tangent);
}

/// sum[a][b] += stress * second derivative of the covariant strain component between nodes a and b.
template <class T>
void add_geometric(const hex8::Gradients& dn, int c, T stress, T (&sum)[kN][kN]) {
  const int p = voigt_row(c), r = voigt_column(c);
  const double scale = p == r ? 0.5 : 1.0;
  for (int a = 0; a < kN; ++a)
    for (int b = 0; b < kN; ++b)
      sum[a][b] = mul_add(T(scale * (dn[p][a] * dn[r][b] + dn[r][a] * dn[p][b])), stress, sum[a][b]);
}

template <class T>
void add_geometric_tangent(Hex8Formulation formulation, double weight, bool symmetric, const StrainWork<T>& w,
                           double* tangent) {
  const hex8::Tables& table = hex8::tables();
  const bool shell = formulation == Hex8Formulation::shell;
  T sum[kN][kN], tied[8], mean(0.0), volume(0.0);
  for (T& value : tied) value = T(0.0);
  for (auto& row : sum)
    for (T& value : row) value = T(0.0);
  for (const StrainPoint<T>& p : w.point) {
    mean = mul_add(p.volume, p.stress[0] + p.stress[1] + p.stress[2], mean);
    volume = volume + p.volume;
  }
  mean = mean / volume;
  for (int q = 0; q < kQ; ++q) {
    const StrainPoint<T>& p = w.point[q];
    T s[6], contravariant[6];
    for (int m = 0; m < 6; ++m) s[m] = p.stress[m];
    // Stress that works on the compatible strain: for the mean dilatation its trace is averaged like the strain's.
    const T shift = T(1.0 / 3) * (mean - (s[0] + s[1] + s[2]));
    for (int m = 0; m < 3 && formulation == Hex8Formulation::mean_dilatation; ++m) s[m] = s[m] + shift;
    times(p.t, s, true, contravariant);
    for (int c = 0; c < 6; ++c) {
      const T stress = p.volume * contravariant[c];
      const bool interpolated = shell && (c == 2 || c == 4 || c == 5);
      if (!interpolated) add_geometric(table.points.gradient[q], c, stress, sum);
      for (int t = 0; t < 8 && interpolated; ++t)
        if (hex8::kTying[t].component == c) tied[t] = mul_add(T(table.weight[q][t]), stress, tied[t]);
    }
  }
  for (int t = 0; t < 8 && shell; ++t) add_geometric(table.tying[t], hex8::kTying[t].component, tied[t], sum);
  for (int a = 0; a < kN; ++a)
    for (int b = symmetric ? a : 0; b < kN; ++b)
      for (int i = 0; i < 3; ++i) {
        double* to = block_of<T, kN>(tangent, a, b, i, i);
        mul_add(T(weight), sum[a][b], T::load(to)).store(to);
      }
}

template <class T>
unsigned evaluate_strain_block(const Hex8Law& law, const BlockInput& in, const BlockOutput& out) {
  StrainWork<T> w;
  const bool damped = in.damping != 0 && in.velocity != nullptr, symmetric = !damped;
  const ModeList list(law.formulation);
  load_strain_state(in, w);
  typename T::Mask good = prepare_strains(law.formulation == Hex8Formulation::shell, w);
  if (law.formulation == Hex8Formulation::mean_dilatation) average_dilatation(w);
  T force[kDofs], energy(0.0);
  for (T& value : force) value = T(0.0);
  good = mask_and(good, solve_alpha(law, !law.neo_hookean, list, w));
  for (const StrainPoint<T>& p : w.point) energy = mul_add(p.volume, p.energy, energy);
  energy.store(out.energy);
  add_strain_force(w, force);
  if (out.tangent != nullptr) {
    add_material_tangent(list, in.position_weight, 0, symmetric, true, w, out.tangent);
    add_geometric_tangent(law.formulation, in.position_weight, symmetric, w, out.tangent);
  }
  if (in.damping != 0) {  // the linear law at the strain beta dE/dt, with enhanced parameters of its own
    for (StrainPoint<T>& p : w.point)
      for (int m = 0; m < 6; ++m) p.strain[m] = T(damped ? in.damping : 0.0) * p.rate[m];
    good = mask_and(good, solve_alpha(law, true, list, w));
    add_strain_force(w, force);
    if (out.tangent != nullptr) {
      add_material_tangent(list, in.damping * in.velocity_weight, in.damping * in.position_weight, symmetric, false, w,
                           out.tangent);
      add_geometric_tangent(law.formulation, in.position_weight, symmetric, w, out.tangent);
    }
  }
  for (int d = 0; d < kDofs; ++d) force[d].store(out.force + d * T::kWidth);
  return T::bits(good);
}

template <class T>
unsigned evaluate_hexahedra(const Hex8Law& law, const BlockInput& in, const BlockOutput& out) {
  const bool special = law.neo_hookean || law.formulation == Hex8Formulation::shell;
  return special ? evaluate_strain_block<T>(law, in, out) : evaluate_block<T>(law, in, out);
}
