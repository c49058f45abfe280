/// \file
/// The formulas of hex8_strain.hpp for a lane type T, first half: strains at the points of all formulations, the laws
/// there, and the modes that enhance strains. For hex8_strain_block-inl.hpp, which is included after it; both after
/// hex8_block-inl.hpp, in the same places.
///
/// Strains are sampled in covariant components, E_cov = J^T E J, and with E = T E_cov stresses and moduli are brought
/// to them: S_cov = T^T S, C_cov = T^T C T.

/// One integration point.
template <class T>
struct StrainPoint {
  T volume, scale;            // weight * det; det0 / det of the enhanced modes
  T t[6][6];                  // E = T E_cov
  Tensor<T> basis, velocity;  // the present covariant basis and its rate
  T strain[6], rate[6];       // as the formulation assumes them, Cartesian
  T stress[6], moduli[6][6];  // of the law that was asked last, at the enhanced strain
  T energy;
};

template <class T>
struct StrainWork {
  T reference[kDofs], displacement[kDofs], velocity[kDofs];
  StrainPoint<T> point[kQ];
  Tensor<T> tied_basis[hex8::kTyingPoints], tied_velocity[hex8::kTyingPoints];
  T element_volume;
  T t0[6][6];  // T at the centre
  T alpha[kModes], residual[kModes];
  BlockModes<T> modes;
};

/// Which strains a formulation assumes; the tables of the element.
struct Assumed {
  const hex8::BlockTables& table;
  bool shell, mean;
  int modes;  // enhanced ones
  ESPALIER_ANYWHERE Assumed(Hex8Formulation f, const hex8::BlockTables& all)
      : table(all),
        shell(f == Hex8Formulation::shell),
        mean(f == Hex8Formulation::mean_dilatation),
        modes(shell                            ? hex8::kShellModes
              : f == Hex8Formulation::enhanced ? kModes
                                               : 0) {}
  /// Component of mode k.
  [[nodiscard]] ESPALIER_ANYWHERE int component(int k) const {
    return shell ? hex8::shell_mode(k).component : hex8::enhanced_mode(k).component;
  }
  [[nodiscard]] ESPALIER_ANYWHERE double value(int k, int q) const {
    return shell ? table.shell_mode[q][k] : table.mode[q][k];
  }
  [[nodiscard]] ESPALIER_ANYWHERE bool ties(int component) const {
    return shell && (component == 2 || component == 4 || component == 5);
  }
};

/// Covariant bases at a sampling point.
template <class T>
struct SampledBases {
  Tensor<T> reference, displacement, now, velocity;
  ESPALIER_APART SampledBases(const hex8::Gradients& dn, const StrainWork<T>& w) {
    local_gradient<T, kN>(w.reference, dn, reference);
    local_gradient<T, kN>(w.displacement, dn, displacement);
    local_gradient<T, kN>(w.velocity, dn, velocity);
    for (int i = 0; i < 3; ++i)
      for (int d = 0; d < 3; ++d) now.x[i][d] = reference.x[i][d] + displacement.x[i][d];
  }
};

/// Component c of the covariant strain and of its rate.
template <class T>
ESPALIER_ANYWHERE void sample_strain(const SampledBases<T>& g, int c, T& strain, T& rate) {
  const int p = voigt_row(c), r = voigt_column(c);
  const T scale(p == r ? 0.5 : 1.0);
  T sum(0.0), sum_rate(0.0);
  for (int i = 0; i < 3; ++i) {
    const T up = g.displacement.x[i][p], ur = g.displacement.x[i][r];
    sum = mul_add(g.reference.x[i][p], ur, mul_add(up, g.reference.x[i][r], mul_add(up, ur, sum)));
    sum_rate = mul_add(g.now.x[i][p], g.velocity.x[i][r], mul_add(g.velocity.x[i][p], g.now.x[i][r], sum_rate));
  }
  strain = scale * sum;
  rate = scale * sum_rate;
}

/// T with E = T E_cov in the engineering order, A = (dX/dxi)^-1, as hex8::strain_transform().
template <class T>
ESPALIER_ANYWHERE void transform_of(const Tensor<T>& a, T (&t)[6][6]) {
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
ESPALIER_ANYWHERE void times(const T (&a)[6][6], const T (&x)[6], bool transposed, T (&y)[6]) {
  for (int m = 0; m < 6; ++m) {
    y[m] = (transposed ? a[0][m] : a[m][0]) * x[0];
    for (int n = 1; n < 6; ++n) y[m] = mul_add(transposed ? a[n][m] : a[m][n], x[n], y[m]);
  }
}

template <class T>
ESPALIER_APART void load_strain_state(const BlockInput& in, StrainWork<T>& w) {
  for (int k = 0; k < kDofs; ++k) {
    w.reference[k] = T::load(in.reference + k * T::kWidth);
    w.displacement[k] = T::load(in.position + k * T::kWidth) - w.reference[k];
    w.velocity[k] = in.velocity == nullptr ? T(0.0) : T::load(in.velocity + k * T::kWidth);
  }
}

/// Volumetric strains -> their mean.
template <class T>
ESPALIER_ANYWHERE void average_dilatation(StrainWork<T>& w) {
  T strain(0.0), rate(0.0);
  ESPALIER_ROLLED
  for (const StrainPoint<T>& p : w.point) {
    strain = mul_add(p.volume, p.strain[0] + p.strain[1] + p.strain[2], strain);
    rate = mul_add(p.volume, p.rate[0] + p.rate[1] + p.rate[2], rate);
  }
  ESPALIER_ROLLED
  for (StrainPoint<T>& p : w.point) {
    const T ds = T(1.0 / 3) * (strain / w.element_volume - (p.strain[0] + p.strain[1] + p.strain[2]));
    const T dr = T(1.0 / 3) * (rate / w.element_volume - (p.rate[0] + p.rate[1] + p.rate[2]));
    for (int m = 0; m < 3; ++m) {
      p.strain[m] = p.strain[m] + ds;
      p.rate[m] = p.rate[m] + dr;
    }
  }
}

/// Strains and bases of all points.
template <class T>
ESPALIER_APART typename T::Mask prepare_strains(const Assumed& assumed, StrainWork<T>& w) {
  const hex8::BlockTables& table = assumed.table;
  typename T::Mask good = T::all();
  T tied[hex8::kTyingPoints], tied_rate[hex8::kTyingPoints];
  ESPALIER_ROLLED
  for (int t = 0; t < hex8::kTyingPoints && assumed.shell; ++t) {
    const SampledBases<T> g(table.tying[t], w);
    sample_strain(g, hex8::tying_component(t), tied[t], tied_rate[t]);
    w.tied_basis[t] = g.now;
    w.tied_velocity[t] = g.velocity;
  }
  Tensor<T> inverse;
  const T det0 = invert_jacobian<T, kN>(w.reference, table.centre, inverse);
  transform_of(inverse, w.t0);
  w.element_volume = T(0.0);
  ESPALIER_ROLLED
  for (int q = 0; q < kQ; ++q) {
    StrainPoint<T>& p = w.point[q];
    const SampledBases<T> g(table.gradient[q], w);
    const T det = invert_tensor(g.reference, inverse);
    good = and_positive(and_positive(good, det), determinant_of(g.now));
    p.volume = T(table.weight[q]) * det;
    p.scale = det0 / det;
    p.basis = g.now;
    p.velocity = g.velocity;
    w.element_volume = w.element_volume + p.volume;
    transform_of(inverse, p.t);
    T strain[6], rate[6];
    for (int c = 0; c < 6; ++c) {
      if (!assumed.ties(c)) {
        sample_strain(g, c, strain[c], rate[c]);
        continue;
      }
      strain[c] = rate[c] = T(0.0);
      ESPALIER_ROLLED
      for (int t = 0; t < hex8::kTyingPoints; ++t) {
        if (hex8::tying_component(t) != c) continue;
        const T weight(table.tying_weight[q][t]);
        strain[c] = mul_add(weight, tied[t], strain[c]);
        rate[c] = mul_add(weight, tied_rate[t], rate[c]);
      }
    }
    times(p.t, strain, false, p.strain);
    times(p.t, rate, false, p.rate);
  }
  if (assumed.mean) average_dilatation(w);
  return good;
}

/// S(E), dS/dE and the energy, as StrainMaterial.
template <class T>
ESPALIER_ANYWHERE void linear_law(const Hex8Law& law, const T (&e)[6], StrainPoint<T>& p) {
  linear_stress(law.lambda, law.mu, e, p.stress);
  p.energy = T(0.5) * inner(p.stress, e);
  for (int m = 0; m < 6; ++m)
    for (int n = 0; n < 6; ++n)
      p.moduli[m][n] = T((m < 3 && n < 3 ? law.lambda : 0.0) + (m == n ? (m < 3 ? 2 * law.mu : law.mu) : 0.0));
}

/// S = mu (I - C^-1) + lambda ln J C^-1, dS/dE = lambda C^-1 x C^-1 + 2 (mu - lambda ln J) I_(C^-1), I - C^-1 =
/// C^-1 (C - I). @return where det C > 0
template <class T>
ESPALIER_APART typename T::Mask neo_hookean_law(const Hex8Law& law, const T (&e)[6], StrainPoint<T>& p) {
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

/// Adds one point's share of sum M^T C M, weight = volume * scale.
template <class T>
ESPALIER_APART void add_mode_stiffness(const Assumed& assumed, int q, T weight, const T (&t0)[6][6],
                                       const StrainPoint<T>& p, T (&d)[kModes][kModes]) {
  T z[6][6];  // C in the components of the modes
  for (int c = 0; c < 6; ++c) {
    T column[6], c0[6];
    for (int m = 0; m < 6; ++m) column[m] = t0[m][c];
    times(p.moduli, column, false, c0);
    times(t0, c0, true, z[c]);
  }
  ESPALIER_ROLLED
  for (int i = 0; i < assumed.modes; ++i) {
    const T wi = T(assumed.value(i, q)) * weight * p.scale;
    for (int j = 0; j <= i; ++j)
      d[i][j] = mul_add(wi, T(assumed.value(j, q)) * z[assumed.component(i)][assumed.component(j)], d[i][j]);
  }
}

/// The strain of point q with what alpha adds to it.
template <class T>
ESPALIER_ANYWHERE void enhanced_strain(const Assumed& assumed, int q, const StrainWork<T>& w, T (&strain)[6]) {
  const StrainPoint<T>& p = w.point[q];
  T combined[6], enhanced[6];
  for (T& value : combined) value = T(0.0);
  for (int k = 0; k < assumed.modes; ++k) {
    const int c = assumed.component(k);
    combined[c] = mul_add(T(assumed.value(k, q)) * p.scale, w.alpha[k], combined[c]);
  }
  times(w.t0, combined, false, enhanced);
  for (int m = 0; m < 6; ++m) strain[m] = p.strain[m] + enhanced[m];
}

/// The law at the strains enhanced by alpha; sum M^T S, and, where wanted, D = sum M^T C M with its factor.
template <class T>
ESPALIER_APART typename T::Mask respond_strains(const Hex8Law& law, bool linear, const Assumed& assumed, bool stiffness,
                                                StrainWork<T>& w) {
  typename T::Mask good = T::all();
  for (T& value : w.residual) value = T(0.0);
  for (int i = 0; i < kModes && stiffness; ++i)
    for (int j = 0; j <= i; ++j) w.modes.d[i][j] = T(i == j && i >= assumed.modes ? 1.0 : 0.0);
  ESPALIER_ROLLED
  for (int q = 0; q < kQ; ++q) {
    StrainPoint<T>& p = w.point[q];
    T strain[6];
    enhanced_strain(assumed, q, w, strain);
    if (linear)
      linear_law(law, strain, p);
    else
      good = mask_and(good, neo_hookean_law(law, strain, p));
    if (assumed.modes == 0) continue;
    T s0[6];  // S in the components of the modes
    times(w.t0, p.stress, true, s0);
    const T weight = p.volume * p.scale;
    for (int k = 0; k < assumed.modes; ++k)
      w.residual[k] = mul_add(T(assumed.value(k, q)) * weight, s0[assumed.component(k)], w.residual[k]);
    if (stiffness) add_mode_stiffness(assumed, q, weight, w.t0, p, w.modes.d);
  }
  return stiffness ? factor_modes(good, w.modes) : good;
}

/// Solves sum M^T S(E + M alpha) = 0, each lane until it has converged itself: its residual no longer falls
/// below round-off of the stress.
/// @param known  D and its factor are those of this law already; only where it is linear
template <class T>
ESPALIER_APART typename T::Mask solve_alpha(const Hex8Law& law, bool linear, bool known, const Assumed& assumed,
                                            StrainWork<T>& w) {
  constexpr int kMaxIterations = 30;
  typename T::Mask good = T::all(), done = mask_not(T::all());
  T previous(0.0);
  for (T& value : w.alpha) value = T(0.0);
  ESPALIER_ROLLED
  for (int iteration = 0; iteration < kMaxIterations; ++iteration) {
    const bool stiffness = !known && (iteration == 0 || !linear);
    good = mask_and(good, mask_or(done, respond_strains(law, linear, assumed, stiffness, w)));
    if (assumed.modes == 0) return good;
    T norm(0.0);
    for (int k = 0; k < assumed.modes; ++k) norm = larger(norm, magnitude(w.residual[k]));
    if (iteration > 0) {
      if (linear) return good;
      // converged: the residual falls no longer, or is zero; what is not a number is not whole
      done = mask_or(done, mask_not(and_positive(T::all(), mul_add(T(0.25), previous, T(0.0) - norm))));
      if (T::bits(done) == T::bits(T::all())) return good;
    }
    T step[kModes];
    for (int k = 0; k < kModes; ++k) step[k] = w.residual[k];
    solve_modes(w.modes, step);
    for (int k = 0; k < assumed.modes; ++k) w.alpha[k] = select(done, w.alpha[k], w.alpha[k] - step[k]);
    previous = norm;
  }
  return mask_and(good, done);
}
