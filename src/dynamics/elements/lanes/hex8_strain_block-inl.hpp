/// \file
/// The formulas of hex8_strain.hpp for a lane type T, second half: forces and tangents of all formulations and laws,
/// for what hex8_block-inl.hpp does not cover (shells, and laws that are not linear in the Green-Lagrange strain).
///
/// Rows of B need no transformation, since strains are covariant: that of component pr is scale (dN_p g_r + dN_r g_p),
/// g the present covariant basis; they are made where a tangent wants them. Forces need none: f_a = sum volume dN_p
/// S^pr g_r. Components that a shell ties have their stress at the tying points instead.

template <class T>
using StrainRows = T[6][kDofs];

/// S^pr volume at the integration points, and at the tying points of shells: what works on compatible strains. For the
/// mean dilatation the trace of the stress is averaged like the strain's.
template <class T>
struct WorkingStress {
  Tensor<T> point[kQ];
  T tied[hex8::kTyingPoints];
};

template <class T>
ESPALIER_APART void working_stress(const Assumed& assumed, const T (&stress)[kQ][6], const StrainWork<T>& w,
                                   WorkingStress<T>& out) {
  for (T& value : out.tied) value = T(0.0);
  T mean(0.0);
  ESPALIER_ROLLED
  for (int q = 0; q < kQ; ++q) mean = mul_add(w.point[q].volume, stress[q][0] + stress[q][1] + stress[q][2], mean);
  mean = mean / w.element_volume;
  ESPALIER_ROLLED
  for (int q = 0; q < kQ; ++q) {
    const StrainPoint<T>& p = w.point[q];
    T s[6], covariant[6];
    const T shift = T(1.0 / 3) * (mean - (stress[q][0] + stress[q][1] + stress[q][2]));
    for (int m = 0; m < 6; ++m) s[m] = assumed.mean && m < 3 ? stress[q][m] + shift : stress[q][m];
    times(p.t, s, true, covariant);
    for (int c = 0; c < 6; ++c) {
      covariant[c] = p.volume * covariant[c];
      if (!assumed.ties(c)) continue;
      ESPALIER_ROLLED
      for (int t = 0; t < hex8::kTyingPoints; ++t)
        if (hex8::tying_component(t) == c)
          out.tied[t] = mul_add(T(assumed.table.tying_weight[q][t]), covariant[c], out.tied[t]);
      covariant[c] = T(0.0);
    }
    tensor_of(covariant, out.point[q]);
  }
}

/// The strain of component c alone.
template <class T>
ESPALIER_ANYWHERE Tensor<T> single_component(int c, T value) {
  T all[6];
  Tensor<T> s;
  for (int m = 0; m < 6; ++m) all[m] = m == c ? value : T(0.0);
  tensor_of(all, s);
  return s;
}

/// f_a += dN_p S^pr g_r
template <class T>
ESPALIER_APART void add_stress_force(const hex8::Gradients& dn, const Tensor<T>& s, const Tensor<T>& basis,
                                     T (&f)[kDofs]) {
  Tensor<T> along;
  product(basis, s, along);
  for (int a = 0; a < kN; ++a)
    for (int i = 0; i < 3; ++i)
      for (int p = 0; p < 3; ++p) f[3 * a + i] = mul_add(along.x[i][p], T(dn[p][a]), f[3 * a + i]);
}

template <class T>
ESPALIER_APART void add_strain_force(const Assumed& assumed, const WorkingStress<T>& s, const StrainWork<T>& w,
                                     T (&f)[kDofs]) {
  ESPALIER_ROLLED
  for (int q = 0; q < kQ; ++q) add_stress_force(assumed.table.gradient[q], s.point[q], w.point[q].basis, f);
  ESPALIER_ROLLED
  for (int t = 0; t < hex8::kTyingPoints && assumed.shell; ++t)
    add_stress_force(assumed.table.tying[t], single_component(hex8::tying_component(t), s.tied[t]), w.tied_basis[t], f);
}

/// sum[a][b] += dN_p S^pr dN_r over nodes a <= b: the second derivative of the strains.
template <class T>
ESPALIER_APART void add_geometric(const hex8::Gradients& dn, const Tensor<T>& s, T (&sum)[kN][kN]) {
  ESPALIER_ROLLED
  for (int b = 0; b < kN; ++b) {
    T h[3];
    for (int p = 0; p < 3; ++p)
      h[p] = mul_add(s.x[p][0], T(dn[0][b]), mul_add(s.x[p][1], T(dn[1][b]), s.x[p][2] * T(dn[2][b])));
    for (int a = 0; a <= b; ++a)
      for (int p = 0; p < 3; ++p) sum[a][b] = mul_add(T(dn[p][a]), h[p], sum[a][b]);
  }
}

template <class T>
ESPALIER_APART void add_geometric_tangent(const Assumed& assumed, double weight, bool symmetric,
                                          const WorkingStress<T>& s, double* tangent) {
  T sum[kN][kN];
  for (auto& row : sum)
    for (T& value : row) value = T(0.0);
  ESPALIER_ROLLED
  for (int q = 0; q < kQ; ++q) add_geometric(assumed.table.gradient[q], s.point[q], sum);
  ESPALIER_ROLLED
  for (int t = 0; t < hex8::kTyingPoints && assumed.shell; ++t)
    add_geometric(assumed.table.tying[t], single_component(hex8::tying_component(t), s.tied[t]), sum);
  ESPALIER_ROLLED
  for (int a = 0; a < kN; ++a)
    for (int b = symmetric ? a : 0; b < kN; ++b)
      for (int i = 0; i < 3; ++i) {
        double* to = block_of<T, kN>(tangent, a, b, i, i);
        mul_add(T(weight), a < b ? sum[a][b] : sum[b][a], T::load(to)).store(to);
      }
}

/// The row of B of component c: scale (dN_p g_r + dN_r g_p).
template <class T>
ESPALIER_ANYWHERE void strain_row(const hex8::Gradients& dn, const Tensor<T>& basis, int c, T (&row)[kDofs]) {
  const int p = voigt_row(c), r = voigt_column(c);
  for (int a = 0; a < kN; ++a)
    for (int i = 0; i < 3; ++i)
      row[3 * a + i] =
          p == r ? T(dn[p][a]) * basis.x[i][p] : mul_add(T(dn[p][a]), basis.x[i][r], T(dn[r][a]) * basis.x[i][p]);
}

/// All rows of point q, of the compatible strain but for those that a shell ties.
template <class T>
ESPALIER_APART void strain_rows(const Assumed& assumed, int q, const Tensor<T>& basis,
                                const T (&tying)[hex8::kTyingPoints][kDofs], StrainRows<T>& b) {
  for (int c = 0; c < 6; ++c) {
    if (!assumed.ties(c)) {
      strain_row(assumed.table.gradient[q], basis, c, b[c]);
      continue;
    }
    for (T& value : b[c]) value = T(0.0);
    ESPALIER_ROLLED
    for (int t = 0; t < hex8::kTyingPoints; ++t) {
      if (hex8::tying_component(t) != c) continue;
      const T weight(assumed.table.tying_weight[q][t]);
      for (int d = 0; d < kDofs; ++d) b[c][d] = mul_add(weight, tying[t][d], b[c][d]);
    }
  }
}

/// x g + y dg/dt
template <class T>
ESPALIER_ANYWHERE Tensor<T> with_rate(double x, const Tensor<T>& basis, double y, const Tensor<T>& velocity) {
  Tensor<T> sum;
  for (int i = 0; i < 3; ++i)
    for (int d = 0; d < 3; ++d) sum.x[i][d] = mul_add(T(y), velocity.x[i][d], T(x) * basis.x[i][d]);
  return sum;
}

/// Rows of B for the basis x g + y dg/dt, for the points of one element one after the other.
template <class T>
struct RowMaker {
  double x, y;
  T tying[hex8::kTyingPoints][kDofs];
  T mean[kDofs];  // of the traces

  ESPALIER_APART RowMaker(const Assumed& assumed, const StrainWork<T>& w, double by_basis, double by_rate)
      : x(by_basis), y(by_rate) {
    ESPALIER_ROLLED
    for (int t = 0; t < hex8::kTyingPoints && assumed.shell; ++t)
      strain_row(assumed.table.tying[t], with_rate(x, w.tied_basis[t], y, w.tied_velocity[t]), hex8::tying_component(t),
                 tying[t]);
    if (!assumed.mean) return;
    for (T& value : mean) value = T(0.0);
    ESPALIER_ROLLED
    for (int q = 0; q < kQ; ++q) {
      StrainRows<T> b;
      T trace[kDofs];
      compatible(assumed, q, w.point[q], b);
      trace_row(w.point[q], b, trace);
      const T share = w.point[q].volume / w.element_volume;
      for (int d = 0; d < kDofs; ++d) mean[d] = mul_add(share, trace[d], mean[d]);
    }
  }

  /// As the formulation assumes them. Volumetric strain -> its mean: (mean - trace) / 3 is added to the normal
  /// components, whose covariant form is the metric J^T J.
  ESPALIER_APART void make(const Assumed& assumed, int q, const StrainWork<T>& w, StrainRows<T>& b) const {
    compatible(assumed, q, w.point[q], b);
    if (!assumed.mean) return;
    Tensor<T> j;
    T metric[6], trace[kDofs];
    local_gradient<T, kN>(w.reference, assumed.table.gradient[q], j);
    for (int c = 0; c < 6; ++c) {
      const int r = voigt_row(c), s = voigt_column(c);
      metric[c] = T(c < 3 ? 1.0 / 3 : 2.0 / 3) *
                  mul_add(j.x[0][r], j.x[0][s], mul_add(j.x[1][r], j.x[1][s], j.x[2][r] * j.x[2][s]));
    }
    trace_row(w.point[q], b, trace);
    for (int c = 0; c < 6; ++c)
      for (int d = 0; d < kDofs; ++d) b[c][d] = mul_add(metric[c], mean[d] - trace[d], b[c][d]);
  }

 private:
  ESPALIER_ANYWHERE void compatible(const Assumed& assumed, int q, const StrainPoint<T>& p, StrainRows<T>& b) const {
    strain_rows(assumed, q, with_rate(x, p.basis, y, p.velocity), tying, b);
  }
  /// The trace of the strain as a row of B: sum of T_mn b_n over m < 3.
  ESPALIER_ANYWHERE static void trace_row(const StrainPoint<T>& p, const StrainRows<T>& b, T (&row)[kDofs]) {
    T weight[6];
    for (int n = 0; n < 6; ++n) weight[n] = p.t[0][n] + p.t[1][n] + p.t[2][n];
    for (int d = 0; d < kDofs; ++d) {
      row[d] = weight[0] * b[0][d];
      for (int n = 1; n < 6; ++n) row[d] = mul_add(weight[n], b[n][d], row[d]);
    }
  }
};

/// out[c] = sum_n a[c][n] rows[n]
template <class T>
ESPALIER_APART void multiply_rows(const T (&a)[6][6], const StrainRows<T>& rows, StrainRows<T>& out) {
  ESPALIER_ROLLED
  for (int c = 0; c < 6; ++c)
    for (int d = 0; d < kDofs; ++d) {
      out[c][d] = a[c][0] * rows[0][d];
      for (int n = 1; n < 6; ++n) out[c][d] = mul_add(a[c][n], rows[n][d], out[c][d]);
    }
}

/// tangent += x^T y; with `first` it is written.
template <class T>
ESPALIER_APART void add_row_products(const StrainRows<T>& x, const StrainRows<T>& y, bool symmetric, bool first,
                                     double* tangent) {
  ESPALIER_ROLLED
  for (int a = 0; a < kN; ++a) ESPALIER_ROLLED
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
ESPALIER_APART void add_mode_rows(const Assumed& assumed, int q, const StrainRows<T>& rows, T (&l)[kModes][kN][3]) {
  ESPALIER_ROLLED
  for (int k = 0; k < assumed.modes; ++k) {
    const T value(assumed.value(k, q));
    const T(&row)[kDofs] = rows[assumed.component(k)];
    for (int d = 0; d < kDofs; ++d) l[k][d / 3][d % 3] = mul_add(value, row[d], l[k][d / 3][d % 3]);
  }
}

/// Adds sum B^T C Bhat - L^T D^-1 Lhat with Bhat = wb B + wr B_rate, L = sum M^T C B.
template <class T>
ESPALIER_APART void add_material_tangent(const Assumed& assumed, double wb, double wr, bool symmetric, bool first,
                                         const StrainWork<T>& w, double* tangent) {
  T l[kModes][kN][3], hat[kModes][kN][3];
  for (int k = 0; k < kModes; ++k)
    for (int a = 0; a < kN; ++a)
      for (int i = 0; i < 3; ++i) l[k][a][i] = hat[k][a][i] = T(0.0);
  const RowMaker<T> plain(assumed, w, 1, 0), weighted(assumed, w, wb, wr);
  ESPALIER_ROLLED
  for (int q = 0; q < kQ; ++q) {
    const StrainPoint<T>& p = w.point[q];
    T ct[6][6], moduli[6][6];  // C T by columns, T^T C T
    for (int n = 0; n < 6; ++n) {
      T column[6];
      for (int m = 0; m < 6; ++m) column[m] = p.volume * p.t[m][n];
      times(p.moduli, column, false, ct[n]);
    }
    for (int n = 0; n < 6; ++n) {
      times(p.t, ct[n], true, moduli[n]);  // symmetric
      for (int m = 0; m < 6 && symmetric; ++m) moduli[n][m] = T(wb) * moduli[n][m];
    }
    StrainRows<T> b, b_hat, rows;
    plain.make(assumed, q, w, b);
    if (!symmetric) weighted.make(assumed, q, w, b_hat);
    multiply_rows(moduli, symmetric ? b : b_hat, rows);
    add_row_products(b, rows, symmetric, first && q == 0, tangent);
    if (assumed.modes == 0) continue;
    T coupling[6][6];  // scale T0^T C T
    for (int c = 0; c < 6; ++c)
      for (int n = 0; n < 6; ++n) {
        T sum = w.t0[0][c] * ct[n][0];
        for (int m = 1; m < 6; ++m) sum = mul_add(w.t0[m][c], ct[n][m], sum);
        coupling[c][n] = p.scale * sum;
      }
    multiply_rows(coupling, b, rows);
    add_mode_rows(assumed, q, rows, l);
    if (symmetric) continue;
    multiply_rows(coupling, b_hat, rows);
    add_mode_rows(assumed, q, rows, hat);
  }
  if (assumed.modes == 0) return;
  solve_rows(w.modes, l);
  if (!symmetric) solve_rows(w.modes, hat);
  add_products<T>(l, symmetric ? l : hat, kModes, T(symmetric ? -wb : -1.0), symmetric, tangent);
}

template <class T>
ESPALIER_ANYWHERE void keep_stress(bool add, const StrainWork<T>& w, T (&stress)[kQ][6]) {
  ESPALIER_ROLLED
  for (int q = 0; q < kQ; ++q)
    for (int m = 0; m < 6; ++m) stress[q][m] = add ? stress[q][m] + w.point[q].stress[m] : w.point[q].stress[m];
}

/// From the state to the force, the energy and, where wanted, the tangent.
template <class T>
ESPALIER_ANYWHERE typename T::Mask evaluate_strains(const Hex8Law& law, const Assumed& assumed, const BlockInput& in,
                                                    StrainWork<T>& w, T (&force)[kDofs], double* energy,
                                                    double* tangent) {
  const bool damped = in.damping != 0 && in.velocity != nullptr, symmetric = !damped, linear = !law.neo_hookean;
  const double by_velocity = in.damping * in.velocity_weight, by_rate = damped ? in.damping * in.position_weight : 0;
  typename T::Mask good = prepare_strains(assumed, w);
  good = mask_and(good, solve_alpha(law, linear, false, assumed, w));
  T sum(0.0), stress[kQ][6];
  ESPALIER_ROLLED
  for (const StrainPoint<T>& p : w.point) sum = mul_add(p.volume, p.energy, sum);
  sum.store(energy);
  keep_stress(false, w, stress);
  // The viscous stress: the linear law at the strain beta dE/dt, with enhanced parameters of its own.
  if (tangent != nullptr)
    add_material_tangent(assumed, in.position_weight + (linear ? by_velocity : 0.0), linear ? by_rate : 0.0, symmetric,
                         true, w, tangent);
  if (damped || (in.damping != 0 && tangent != nullptr && !linear)) {
    ESPALIER_ROLLED
    for (StrainPoint<T>& p : w.point)
      for (int m = 0; m < 6; ++m) p.strain[m] = T(damped ? in.damping : 0.0) * p.rate[m];
    good = mask_and(good, solve_alpha(law, true, linear, assumed, w));
    keep_stress(true, w, stress);
    if (tangent != nullptr && !linear)
      add_material_tangent(assumed, by_velocity, by_rate, symmetric, false, w, tangent);
  }
  WorkingStress<T> working;
  working_stress(assumed, stress, w, working);
  for (T& value : force) value = T(0.0);
  add_strain_force(assumed, working, w, force);
  if (tangent != nullptr) add_geometric_tangent(assumed, in.position_weight, symmetric, working, tangent);
  return good;
}

template <class T>
ESPALIER_ANYWHERE unsigned evaluate_strain_block(const Hex8Law& law, const BlockInput& in, const BlockOutput& out) {
  StrainWork<T> w;
  T force[kDofs];
  load_strain_state(in, w);
  const typename T::Mask good =
      evaluate_strains(law, Assumed(law.formulation, tables()), in, w, force, out.energy, out.tangent);
  for (int d = 0; d < kDofs; ++d) force[d].store(out.force + d * T::kWidth);
  return T::bits(good);
}

/// The strains that the element assumes, for equilibrium of its enhanced parameters.
template <class T>
ESPALIER_ANYWHERE typename T::Mask sample_strains(const Hex8Law& law, const BlockInput& in, T (&strain)[kQ][6]) {
  const Assumed assumed(law.formulation, tables());
  StrainWork<T> w;
  load_strain_state(in, w);
  typename T::Mask good = prepare_strains(assumed, w);
  good = mask_and(good, solve_alpha(law, !law.neo_hookean, false, assumed, w));
  for (int q = 0; q < kQ; ++q) enhanced_strain(assumed, q, w, strain[q]);
  return good;
}

template <class T>
unsigned evaluate_hexahedra(const Hex8Law& law, const BlockInput& in, const BlockOutput& out) {
  return law.by_strains() ? evaluate_strain_block<T>(law, in, out) : evaluate_block<T>(law, in, out);
}
