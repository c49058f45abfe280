/// \file
/// The formulas of hex8_block.hpp for a lane type T, over lane_algebra-inl.hpp. Included once by the scalar kernel and
/// once per instruction set by the vectors', each in a namespace of its own, so there is no include guard and no
/// include here. Who includes it gives tables(), the hex8::BlockTables where they can be read.

constexpr int kN = hex8::kNodes, kQ = hex8::kPoints, kDofs = hex8::kDofs, kModes = hex8::kEnhancedModes;

template <class T>
struct BlockPoint {
  Tensor<T> inverse;  // dxi_k / dX_d at [k][d]
  T volume, det;
  Tensor<T> f, rate;        // deformation gradient and its rate
  T strain[6], viscous[6];  // E, beta dE/dt
  T stress[6];              // of both
};

/// The enhanced strains: M_k = (det0 / det) p_k(xi) t_c(k), and what is condensed with them.
template <class T>
struct BlockModes {
  T det0;
  T t[6][6];            // [c]: strain of the covariant component c of the centre
  T sigma[6][6];        // [c]: C t_c
  T d[kModes][kModes];  // lower triangle: Cholesky factor of sum M^T C M, the diagonal inverted
};

template <class T>
struct Hex8Work {
  T reference[kDofs], displacement[kDofs], velocity[kDofs];
  BlockPoint<T> point[kQ];
  BlockModes<T> modes;
};

template <class T>
ESPALIER_ANYWHERE void load_state(const BlockInput& in, Hex8Work<T>& w) {
  for (int k = 0; k < kDofs; ++k) {
    w.reference[k] = T::load(in.reference + k * T::kWidth);
    w.displacement[k] = T::load(in.position + k * T::kWidth) - w.reference[k];
    w.velocity[k] = in.velocity == nullptr ? T(0.0) : T::load(in.velocity + k * T::kWidth);
  }
}

template <class T>
ESPALIER_ANYWHERE typename T::Mask kinematics(bool damped, double damping, Hex8Work<T>& w) {
  const hex8::BlockTables& table = tables();
  typename T::Mask good = T::all();
  for (int q = 0; q < kQ; ++q) {
    BlockPoint<T>& p = w.point[q];
    const hex8::Gradients& dn = table.gradient[q];
    p.det = invert_jacobian<T, kN>(w.reference, dn, p.inverse);
    p.volume = T(table.weight[q]) * p.det;
    Tensor<T> local, h;
    local_gradient<T, kN>(w.displacement, dn, local);
    product(local, p.inverse, h);
    p.f = plus_identity(h);
    green_lagrange(h, p.strain);
    if (damped) {
      local_gradient<T, kN>(w.velocity, dn, local);
      product(local, p.inverse, p.rate);
      strain_rate(p.f, p.rate, damping, p.viscous);
    }
    for (int m = 0; m < 6 && !damped; ++m) p.viscous[m] = T(0.0);
    good = and_positive(and_positive(good, p.det), determinant_of(p.f));
  }
  return good;
}

/// Volumetric strain -> its mean over the element; the same for stresses.
template <class T, class Member>
ESPALIER_ANYWHERE void average_trace(Hex8Work<T>& w, const Member& member) {
  T sum(0.0), volume(0.0);
  for (BlockPoint<T>& p : w.point) {
    const auto& s = member(p);
    sum = mul_add(p.volume, s[0] + s[1] + s[2], sum);
    volume = volume + p.volume;
  }
  const T mean = sum / volume;
  for (BlockPoint<T>& p : w.point) {
    auto& s = member(p);
    const T shift = T(1.0 / 3) * (mean - (s[0] + s[1] + s[2]));
    for (int m = 0; m < 3; ++m) s[m] = s[m] + shift;
  }
}

/// D -> its factor. @return `good` where D is positive definite
template <class T>
ESPALIER_ANYWHERE typename T::Mask factor_modes(typename T::Mask good, BlockModes<T>& m) {
  for (int j = 0; j < kModes; ++j)
    for (int i = j; i < kModes; ++i) {
      T sum = m.d[i][j];
      for (int k = 0; k < j; ++k) sum = sum - m.d[i][k] * m.d[j][k];
      if (i == j) {
        good = and_positive(good, sum);
        m.d[j][j] = T(1.0) / square_root(sum);
      } else {
        m.d[i][j] = sum * m.d[j][j];
      }
    }
  return good;
}

/// The modes of hex8::strain_transform at the centre, and the factor of D = sum M^T C M.
template <class T>
ESPALIER_ANYWHERE typename T::Mask make_modes(const Hex8Law& law, typename T::Mask good, Hex8Work<T>& w) {
  BlockModes<T>& m = w.modes;
  Tensor<T> a;
  m.det0 = invert_jacobian<T, kN>(w.reference, tables().centre, a);
  for (int c = 0; c < 6; ++c) {
    const int p = voigt_row(c), r = voigt_column(c);
    for (int n = 0; n < 6; ++n) {
      const int i = voigt_row(n), j = voigt_column(n);
      const T both = mul_add(a.x[p][i], a.x[r][j], a.x[r][i] * a.x[p][j]);
      m.t[c][n] = T(i == j ? 0.5 : 1.0) * both;
    }
    linear_stress(law.lambda, law.mu, m.t[c], m.sigma[c]);
  }
  T by_det[kQ];
  for (int q = 0; q < kQ; ++q) by_det[q] = m.det0 * m.det0 * T(tables().weight[q]) / w.point[q].det;
  for (int j = 0; j < kModes; ++j)
    for (int i = j; i < kModes; ++i) {
      T sum = T(tables().mode[0][i] * tables().mode[0][j]) * by_det[0];
      for (int q = 1; q < kQ; ++q) sum = mul_add(T(tables().mode[q][i] * tables().mode[q][j]), by_det[q], sum);
      m.d[i][j] = sum * inner(m.t[hex8::enhanced_mode(i).component], m.sigma[hex8::enhanced_mode(j).component]);
    }
  return factor_modes(good, m);
}

/// x = R^-1 x with D = R R^T.
template <class T>
ESPALIER_ANYWHERE void solve_lower(const BlockModes<T>& m, T (&x)[kModes]) {
  for (int i = 0; i < kModes; ++i) {
    for (int k = 0; k < i; ++k) x[i] = x[i] - m.d[i][k] * x[k];
    x[i] = x[i] * m.d[i][i];
  }
}

/// x = D^-1 x
template <class T>
ESPALIER_ANYWHERE void solve_modes(const BlockModes<T>& m, T (&x)[kModes]) {
  solve_lower(m, x);
  for (int i = kModes - 1; i >= 0; --i) {
    for (int k = i + 1; k < kModes; ++k) x[i] = x[i] - m.d[k][i] * x[k];
    x[i] = x[i] * m.d[i][i];
  }
}

/// Adds to strains the enhanced ones that leave no stress working on the modes: sum M^T C (E + M alpha) = 0.
template <class T, class Member>
ESPALIER_ANYWHERE void enhance(Hex8Work<T>& w, const Member& member) {
  const BlockModes<T>& m = w.modes;
  T x[kModes];
  for (T& value : x) value = T(0.0);
  for (int q = 0; q < kQ; ++q) {
    T tau[6];
    for (int c = 0; c < 6; ++c) tau[c] = inner(m.sigma[c], member(w.point[q]));
    const double weight = tables().weight[q];
    for (int k = 0; k < kModes; ++k)
      x[k] = mul_add(T(-weight * tables().mode[q][k]) * m.det0, tau[hex8::enhanced_mode(k).component], x[k]);
  }
  solve_modes(m, x);
  for (int q = 0; q < kQ; ++q) {
    T alpha[6];
    for (T& value : alpha) value = T(0.0);
    for (int k = 0; k < kModes; ++k) {
      const int c = hex8::enhanced_mode(k).component;
      alpha[c] = mul_add(T(tables().mode[q][k]), x[k], alpha[c]);
    }
    const T scale = m.det0 / w.point[q].det;
    auto& e = member(w.point[q]);
    for (int c = 0; c < 6; ++c)
      for (int n = 0; n < 6; ++n) e[n] = mul_add(scale * alpha[c], m.t[c][n], e[n]);
  }
}

/// Strains as the formulation assumes them, stresses, energy; the stresses are those that work on compatible strains.
template <class T>
ESPALIER_ANYWHERE typename T::Mask respond(const Hex8Law& law, typename T::Mask good, bool damped, Hex8Work<T>& w,
                                           double* energy) {
  const auto elastic = [](BlockPoint<T>& p) -> T(&)[6] { return p.strain; };
  const auto viscous = [](BlockPoint<T>& p) -> T(&)[6] { return p.viscous; };
  if (law.formulation == Hex8Formulation::mean_dilatation) {
    average_trace(w, elastic);
    if (damped) average_trace(w, viscous);
  }
  if (law.formulation == Hex8Formulation::enhanced) {
    good = make_modes(law, good, w);
    enhance(w, elastic);
    if (damped) enhance(w, viscous);
  }
  T sum(0.0);
  for (BlockPoint<T>& p : w.point) {
    linear_stress(law.lambda, law.mu, p.strain, p.stress);
    sum = mul_add(T(0.5) * p.volume, inner(p.stress, p.strain), sum);
    T s[6];
    linear_stress(law.lambda, law.mu, p.viscous, s);
    for (int m = 0; m < 6; ++m) p.stress[m] = p.stress[m] + s[m];
  }
  sum.store(energy);
  if (law.formulation == Hex8Formulation::mean_dilatation)
    average_trace(w, [](BlockPoint<T>& p) -> T(&)[6] { return p.stress; });
  return good;
}

/// f_a = sum volume F S G_a
template <class T>
ESPALIER_ANYWHERE void write_force(const Hex8Work<T>& w, double* force) {
  T f[kDofs];
  for (T& value : f) value = T(0.0);
  for (int q = 0; q < kQ; ++q) {
    const BlockPoint<T>& p = w.point[q];
    const hex8::Gradients& dn = tables().gradient[q];
    Tensor<T> s, piola;
    tensor_of(p.stress, s);
    product(p.f, s, piola);
    add_force<T, kN>(piola, p.inverse, p.volume, dn, f);
  }
  for (int d = 0; d < kDofs; ++d) f[d].store(force + d * T::kWidth);
}

/// What is added to the tangent when all points are known.
template <class T>
struct TangentSums {
  T l[kModes][kN][3], hat[kModes][kN][3];  // sum M^T C B, and with the weighted B
  T mean[kN][3], mean_hat[kN][3];          // sum volume F g, sum volume W g
};

/// l_k += weight det0 p_k F sigma_c g_a
template <class T>
ESPALIER_ANYWHERE void add_coupling(const BlockModes<T>& m, int q, const Tensor<T>& f, const T (&g)[kN][3],
                                    T (&l)[kModes][kN][3]) {
  const T weight = T(tables().weight[q]) * m.det0;
  for (int c = 0, k = 0; c < 6; ++c) {
    Tensor<T> sigma, y;
    T v[kN][3];
    tensor_of(m.sigma[c], sigma);
    product(f, sigma, y);
    for (auto& row : y.x)
      for (T& value : row) value = weight * value;
    apply<T, kN>(y, g, v);
    for (; k < kModes && hex8::enhanced_mode(k).component == c; ++k) {
      const T value(tables().mode[q][k]);
      for (int a = 0; a < kN; ++a)
        for (int i = 0; i < 3; ++i) l[k][a][i] = q == 0 ? value * v[a][i] : mul_add(value, v[a][i], l[k][a][i]);
    }
  }
}

template <class T>
ESPALIER_ANYWHERE void add_point(const Hex8Law& law, const BlockInput& in, bool damped, int q, const Hex8Work<T>& work,
                                 TangentSums<T>& sums, double* tangent) {
  const BlockPoint<T>& p = work.point[q];
  const hex8::Gradients& dn = tables().gradient[q];
  const bool mean = law.formulation == Hex8Formulation::mean_dilatation;
  PointVectors<T, kN> v;
  gradients<T, kN>(p.inverse, dn, v.g);
  // W = (wq + beta wv) F + beta wq dF/dt
  Tensor<T> weighted, s;
  const T keep(in.position_weight + in.damping * in.velocity_weight), by_rate(in.damping * in.position_weight);
  tensor_of(p.stress, s);
  for (int i = 0; i < 3; ++i)
    for (int j = 0; j < 3; ++j) {
      weighted.x[i][j] = keep * p.f.x[i][j];
      if (damped) weighted.x[i][j] = mul_add(by_rate, p.rate.x[i][j], weighted.x[i][j]);
      s.x[i][j] = T(in.position_weight) * p.volume * s.x[i][j];
    }
  for (int i = 0; i < 3; ++i)
    for (int j = 0; j < 3; ++j)
      v.m.x[i][j] = T(law.mu) * p.volume *
                    mul_add(p.f.x[i][0], weighted.x[j][0],
                            mul_add(p.f.x[i][1], weighted.x[j][1], p.f.x[i][2] * weighted.x[j][2]));
  apply<T, kN>(p.f, v.g, v.u);
  apply<T, kN>(weighted, v.g, v.w);
  apply<T, kN>(s, v.g, v.h);
  const T c1 = T(mean ? -2 * law.mu / 3 : law.lambda) * p.volume, c2 = T(law.mu) * p.volume;
  for (int a = 0; a < kN; ++a)
    for (int i = 0; i < 3; ++i) {
      v.wc[a][i] = c1 * v.w[a][i];
      v.uc[a][i] = c2 * v.u[a][i];
      if (!mean) continue;
      sums.mean[a][i] = q == 0 ? p.volume * v.u[a][i] : mul_add(p.volume, v.u[a][i], sums.mean[a][i]);
      sums.mean_hat[a][i] = q == 0 ? p.volume * v.w[a][i] : mul_add(p.volume, v.w[a][i], sums.mean_hat[a][i]);
    }
  add_pairs<T, kN>(v, !damped, q == 0, tangent);
  if (law.formulation != Hex8Formulation::enhanced) return;
  add_coupling(work.modes, q, p.f, v.g, sums.l);
  if (damped) add_coupling(work.modes, q, weighted, v.g, sums.hat);
}

/// K += scale x^T y over `count` rows of x and y, blocks a <= b alone where symmetric.
template <class T>
ESPALIER_ANYWHERE void add_products(const T (*x)[kN][3], const T (*y)[kN][3], int count, T scale, bool symmetric,
                                    double* tangent) {
  for (int a = 0; a < kN; ++a)
    for (int b = symmetric ? a : 0; b < kN; ++b) {
      T sum[3][3];
      for (int j = 0; j < 3; ++j)
        for (int i = 0; i < 3; ++i) sum[j][i] = x[0][a][i] * y[0][b][j];
      for (int k = 1; k < count; ++k)
        for (int j = 0; j < 3; ++j)
          for (int i = 0; i < 3; ++i) sum[j][i] = mul_add(x[k][a][i], y[k][b][j], sum[j][i]);
      for (int j = 0; j < 3; ++j)
        for (int i = 0; i < 3; ++i) {
          double* to = block_of<T, kN>(tangent, a, b, i, j);
          mul_add(scale, sum[j][i], T::load(to)).store(to);
        }
    }
}

template <class T>
ESPALIER_ANYWHERE void solve_rows(const BlockModes<T>& m, T (&l)[kModes][kN][3]) {
  for (int a = 0; a < kN; ++a)
    for (int i = 0; i < 3; ++i) {
      T x[kModes];
      for (int k = 0; k < kModes; ++k) x[k] = l[k][a][i];
      solve_lower(m, x);
      for (int k = 0; k < kModes; ++k) l[k][a][i] = x[k];
    }
}

template <class T>
ESPALIER_ANYWHERE void write_tangent(const Hex8Law& law, const BlockInput& in, bool damped, Hex8Work<T>& w,
                                     double* tangent) {
  TangentSums<T> sums;
  for (int q = 0; q < kQ; ++q) add_point(law, in, damped, q, w, sums, tangent);
  if (law.formulation == Hex8Formulation::mean_dilatation) {
    T volume(0.0);
    for (const BlockPoint<T>& p : w.point) volume = volume + p.volume;
    add_products<T>(&sums.mean, &sums.mean_hat, 1, T(law.lambda + 2 * law.mu / 3) / volume, !damped, tangent);
  }
  if (law.formulation == Hex8Formulation::enhanced) {  // - L^T D^-1 Lhat; without rates Lhat = (wq + beta wv) L
    solve_rows(w.modes, sums.l);
    if (damped) solve_rows(w.modes, sums.hat);
    const double scale = damped ? 1 : in.position_weight + in.damping * in.velocity_weight;
    add_products<T>(sums.l, damped ? sums.hat : sums.l, kModes, T(-scale), !damped, tangent);
  }
}

template <class T>
ESPALIER_ANYWHERE unsigned evaluate_block(const Hex8Law& law, const BlockInput& in, const BlockOutput& out) {
  Hex8Work<T> w;
  const bool damped = in.damping != 0 && in.velocity != nullptr;
  load_state(in, w);
  typename T::Mask good = kinematics(damped, in.damping, w);
  good = respond(law, good, damped, w, out.energy);
  write_force(w, out.force);
  if (out.tangent != nullptr) write_tangent(law, in, damped, w, out.tangent);
  return T::bits(good);
}
