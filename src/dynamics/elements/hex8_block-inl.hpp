/// \file
/// The formulas of hex8_block.hpp for a lane type T. Included once by the scalar kernel and once per instruction set by
/// the vectors', each in a namespace of its own, so there is no include guard and no include here.
///
/// T: a number per lane, with T(double), load, store, + - * / and mul_add(a, b, c) = a b + c, square_root, Mask and
/// and_positive(mask, x). Node a, component i of a nodal field is [3 a + i]; strains and stresses in the order
/// 11 22 33 12 23 13, strains with engineering shears.

constexpr int kN = hex8::kNodes, kQ = hex8::kPoints, kDofs = hex8::kDofs, kModes = 9;

template <class T>
struct Tensor {
  T x[3][3];
};

template <class T>
T cofactor(const Tensor<T>& a, int i, int j) {
  const int i1 = (i + 1) % 3, i2 = (i + 2) % 3, j1 = (j + 1) % 3, j2 = (j + 2) % 3;
  return a.x[i1][j1] * a.x[i2][j2] - a.x[i1][j2] * a.x[i2][j1];
}

template <class T>
T determinant_of(const Tensor<T>& a) {
  return mul_add(a.x[0][0], cofactor(a, 0, 0), mul_add(a.x[0][1], cofactor(a, 0, 1), a.x[0][2] * cofactor(a, 0, 2)));
}

/// c = a b
template <class T>
void product(const Tensor<T>& a, const Tensor<T>& b, Tensor<T>& c) {
  for (int i = 0; i < 3; ++i)
    for (int j = 0; j < 3; ++j)
      c.x[i][j] = mul_add(a.x[i][0], b.x[0][j], mul_add(a.x[i][1], b.x[1][j], a.x[i][2] * b.x[2][j]));
}

/// c[i][k] = sum_a field[3a + i] dN_a/dxi_k
template <class T>
void local_gradient(const T (&field)[kDofs], const hex8::Gradients& dn, Tensor<T>& c) {
  for (int i = 0; i < 3; ++i)
    for (int k = 0; k < 3; ++k) {
      T sum = field[i] * T(dn[k][0]);
      for (int a = 1; a < kN; ++a) sum = mul_add(field[3 * a + i], T(dn[k][a]), sum);
      c.x[i][k] = sum;
    }
}

/// Symmetric tensor of a stress in the order above.
template <class T>
void tensor_of(const T (&s)[6], Tensor<T>& c) {
  for (int m = 0; m < 6; ++m) c.x[hex8::kRow[m]][hex8::kCol[m]] = c.x[hex8::kCol[m]][hex8::kRow[m]] = s[m];
}

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

/// S = C E of the linear isotropic law.
template <class T>
void linear_stress(const Hex8Law& law, const T (&e)[6], T (&s)[6]) {
  const T trace = T(law.lambda) * (e[0] + e[1] + e[2]), mu(law.mu), twice(2 * law.mu);
  for (int m = 0; m < 3; ++m) {
    s[m] = mul_add(twice, e[m], trace);
    s[m + 3] = mu * e[m + 3];
  }
}

template <class T>
T inner(const T (&a)[6], const T (&b)[6]) {
  T sum = a[0] * b[0];
  for (int m = 1; m < 6; ++m) sum = mul_add(a[m], b[m], sum);
  return sum;
}

template <class T>
void load_state(const BlockInput& in, Hex8Work<T>& w) {
  for (int k = 0; k < kDofs; ++k) {
    w.reference[k] = T::load(in.reference + k * T::kWidth);
    w.displacement[k] = T::load(in.position + k * T::kWidth) - w.reference[k];
    w.velocity[k] = in.velocity == nullptr ? T(0.0) : T::load(in.velocity + k * T::kWidth);
  }
}

/// Inverse of dX/dxi. @return its determinant
template <class T>
T invert_jacobian(const T (&x)[kDofs], const hex8::Gradients& dn, Tensor<T>& inverse) {
  Tensor<T> jacobian;
  local_gradient(x, dn, jacobian);
  const T det = determinant_of(jacobian);
  const T scale = T(1.0) / det;
  for (int i = 0; i < 3; ++i)
    for (int j = 0; j < 3; ++j) inverse.x[j][i] = scale * cofactor(jacobian, i, j);
  return det;
}

/// E = (H + H^T + H^T H) / 2 from the displacement gradient H, so that small strains keep their digits; beta dE/dt.
template <class T>
void strains(const Tensor<T>& h, bool damped, double damping, BlockPoint<T>& p) {
  for (int m = 0; m < 6; ++m) {
    const int i = hex8::kRow[m], j = hex8::kCol[m];
    T square = h.x[0][i] * h.x[0][j], rate(0.0);
    for (int k = 1; k < 3; ++k) square = mul_add(h.x[k][i], h.x[k][j], square);
    for (int k = 0; k < 3 && damped; ++k)
      rate = mul_add(p.f.x[k][i], p.rate.x[k][j], mul_add(p.rate.x[k][i], p.f.x[k][j], rate));
    const T twice = h.x[i][j] + h.x[j][i] + square;
    p.strain[m] = m < 3 ? T(0.5) * twice : twice;
    p.viscous[m] = T(m < 3 ? 0.5 * damping : damping) * rate;
  }
}

template <class T>
typename T::Mask kinematics(bool damped, double damping, Hex8Work<T>& w) {
  const hex8::Tables& table = hex8::tables();
  typename T::Mask good = T::all();
  for (int q = 0; q < kQ; ++q) {
    BlockPoint<T>& p = w.point[q];
    const hex8::Gradients& dn = table.points.gradient[q];
    p.det = invert_jacobian(w.reference, dn, p.inverse);
    p.volume = T(table.points.weight[q]) * p.det;
    Tensor<T> local, h;
    local_gradient(w.displacement, dn, local);
    product(local, p.inverse, h);
    p.f = h;
    for (int i = 0; i < 3; ++i) p.f.x[i][i] = h.x[i][i] + T(1.0);
    if (damped) {
      local_gradient(w.velocity, dn, local);
      product(local, p.inverse, p.rate);
    }
    good = and_positive(and_positive(good, p.det), determinant_of(p.f));
    strains(h, damped, damping, p);
  }
  return good;
}

/// Volumetric strain -> its mean over the element; the same for stresses.
template <class T, class Member>
void average_trace(Hex8Work<T>& w, const Member& member) {
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

inline double mode_value(int k, int q) { return hex8::polynomial(hex8::kEnhanced[k].polynomial, hex8::tables().xi[q]); }

/// The modes of hex8::strain_transform at the centre, and the factor of D = sum M^T C M.
template <class T>
typename T::Mask make_modes(const Hex8Law& law, typename T::Mask good, Hex8Work<T>& w) {
  BlockModes<T>& m = w.modes;
  Tensor<T> a;
  m.det0 = invert_jacobian(w.reference, hex8::tables().centre, a);
  for (int c = 0; c < 6; ++c) {
    const int p = hex8::kRow[c], r = hex8::kCol[c];
    for (int n = 0; n < 6; ++n) {
      const int i = hex8::kRow[n], j = hex8::kCol[n];
      const T both = mul_add(a.x[p][i], a.x[r][j], a.x[r][i] * a.x[p][j]);
      m.t[c][n] = T(i == j ? 0.5 : 1.0) * both;
    }
    linear_stress(law, m.t[c], m.sigma[c]);
  }
  T by_det[kQ];
  for (int q = 0; q < kQ; ++q) by_det[q] = m.det0 * m.det0 * T(hex8::tables().points.weight[q]) / w.point[q].det;
  for (int j = 0; j < kModes; ++j)
    for (int i = j; i < kModes; ++i) {
      T sum = T(mode_value(i, 0) * mode_value(j, 0)) * by_det[0];
      for (int q = 1; q < kQ; ++q) sum = mul_add(T(mode_value(i, q) * mode_value(j, q)), by_det[q], sum);
      m.d[i][j] = sum * inner(m.t[hex8::kEnhanced[i].component], m.sigma[hex8::kEnhanced[j].component]);
    }
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

/// x = R^-1 x with D = R R^T.
template <class T>
void solve_lower(const BlockModes<T>& m, T (&x)[kModes]) {
  for (int i = 0; i < kModes; ++i) {
    for (int k = 0; k < i; ++k) x[i] = x[i] - m.d[i][k] * x[k];
    x[i] = x[i] * m.d[i][i];
  }
}

/// Adds to strains the enhanced ones that leave no stress working on the modes: sum M^T C (E + M alpha) = 0.
template <class T, class Member>
void enhance(Hex8Work<T>& w, const Member& member) {
  const BlockModes<T>& m = w.modes;
  T x[kModes];
  for (T& value : x) value = T(0.0);
  for (int q = 0; q < kQ; ++q) {
    T tau[6];
    for (int c = 0; c < 6; ++c) tau[c] = inner(m.sigma[c], member(w.point[q]));
    const double weight = hex8::tables().points.weight[q];
    for (int k = 0; k < kModes; ++k)
      x[k] = mul_add(T(-weight * mode_value(k, q)) * m.det0, tau[hex8::kEnhanced[k].component], x[k]);
  }
  solve_lower(m, x);
  for (int i = kModes - 1; i >= 0; --i) {  // x = R^-T x
    for (int k = i + 1; k < kModes; ++k) x[i] = x[i] - m.d[k][i] * x[k];
    x[i] = x[i] * m.d[i][i];
  }
  for (int q = 0; q < kQ; ++q) {
    T alpha[6];
    for (T& value : alpha) value = T(0.0);
    for (int k = 0; k < kModes; ++k) {
      const int c = hex8::kEnhanced[k].component;
      alpha[c] = mul_add(T(mode_value(k, q)), x[k], alpha[c]);
    }
    const T scale = m.det0 / w.point[q].det;
    auto& e = member(w.point[q]);
    for (int c = 0; c < 6; ++c)
      for (int n = 0; n < 6; ++n) e[n] = mul_add(scale * alpha[c], m.t[c][n], e[n]);
  }
}

/// Strains as the formulation assumes them, stresses, energy; the stresses are those that work on compatible strains.
template <class T>
typename T::Mask respond(const Hex8Law& law, typename T::Mask good, bool damped, Hex8Work<T>& w, double* energy) {
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
    linear_stress(law, p.strain, p.stress);
    sum = mul_add(T(0.5) * p.volume, inner(p.stress, p.strain), sum);
    T s[6];
    linear_stress(law, p.viscous, s);
    for (int m = 0; m < 6; ++m) p.stress[m] = p.stress[m] + s[m];
  }
  sum.store(energy);
  if (law.formulation == Hex8Formulation::mean_dilatation)
    average_trace(w, [](BlockPoint<T>& p) -> T(&)[6] { return p.stress; });
  return good;
}

/// f_a = sum volume F S G_a
template <class T>
void write_force(const Hex8Work<T>& w, double* force) {
  T f[kDofs];
  for (T& value : f) value = T(0.0);
  for (int q = 0; q < kQ; ++q) {
    const BlockPoint<T>& p = w.point[q];
    const hex8::Gradients& dn = hex8::tables().points.gradient[q];
    Tensor<T> s, piola;
    tensor_of(p.stress, s);
    product(p.f, s, piola);
    for (int i = 0; i < 3; ++i) {
      T local[3];
      for (int k = 0; k < 3; ++k)
        local[k] = p.volume * mul_add(piola.x[i][0], p.inverse.x[k][0],
                                      mul_add(piola.x[i][1], p.inverse.x[k][1], piola.x[i][2] * p.inverse.x[k][2]));
      for (int a = 0; a < kN; ++a)
        for (int k = 0; k < 3; ++k) f[3 * a + i] = mul_add(local[k], T(dn[k][a]), f[3 * a + i]);
    }
  }
  for (int d = 0; d < kDofs; ++d) f[d].store(force + d * T::kWidth);
}

/// v[a] = A g[a]
template <class T>
void apply(const Tensor<T>& a, const T (&g)[kN][3], T (&v)[kN][3]) {
  for (int n = 0; n < kN; ++n)
    for (int i = 0; i < 3; ++i) v[n][i] = mul_add(a.x[i][0], g[n][0], mul_add(a.x[i][1], g[n][1], a.x[i][2] * g[n][2]));
}

/// One point's share of the tangent: block (a, b) = c1 u_a w_b^T + c2 u_b w_a^T + (g_a . h_b) I + (g_a . g_b) m, the
/// formula of PointResponse; wc = c1 w, uc = c2 u.
template <class T>
struct PointVectors {
  T g[kN][3], u[kN][3], w[kN][3], h[kN][3], wc[kN][3], uc[kN][3];
  Tensor<T> m;
};

template <class T>
double* block_of(double* tangent, int a, int b, int i, int j) {
  return tangent + ((3 * b + j) * kDofs + 3 * a + i) * T::kWidth;
}

template <class T>
void add_pairs(const PointVectors<T>& p, bool symmetric, bool first, double* tangent) {
  for (int a = 0; a < kN; ++a)
    for (int b = symmetric ? a : 0; b < kN; ++b) {
      const T dot = mul_add(p.g[a][0], p.g[b][0], mul_add(p.g[a][1], p.g[b][1], p.g[a][2] * p.g[b][2]));
      const T diagonal = mul_add(p.g[a][0], p.h[b][0], mul_add(p.g[a][1], p.h[b][1], p.g[a][2] * p.h[b][2]));
      for (int j = 0; j < 3; ++j)
        for (int i = 0; i < 3; ++i) {
          double* to = block_of<T>(tangent, a, b, i, j);
          T sum = mul_add(p.m.x[i][j], dot, i == j ? diagonal : T(0.0));
          if (!first) sum = sum + T::load(to);
          mul_add(p.u[a][i], p.wc[b][j], mul_add(p.w[a][j], p.uc[b][i], sum)).store(to);
        }
    }
}

/// What is added to the tangent when all points are known.
template <class T>
struct TangentSums {
  T l[kModes][kN][3], hat[kModes][kN][3];  // sum M^T C B, and with the weighted B
  T mean[kN][3], mean_hat[kN][3];          // sum volume F g, sum volume W g
};

/// l_k += weight det0 p_k F sigma_c g_a
template <class T>
void add_coupling(const BlockModes<T>& m, int q, const Tensor<T>& f, const T (&g)[kN][3], T (&l)[kModes][kN][3]) {
  const T weight = T(hex8::tables().points.weight[q]) * m.det0;
  for (int c = 0, k = 0; c < 6; ++c) {
    Tensor<T> sigma, y;
    T v[kN][3];
    tensor_of(m.sigma[c], sigma);
    product(f, sigma, y);
    for (auto& row : y.x)
      for (T& value : row) value = weight * value;
    apply(y, g, v);
    for (; k < kModes && hex8::kEnhanced[k].component == c; ++k) {
      const T value(mode_value(k, q));
      for (int a = 0; a < kN; ++a)
        for (int i = 0; i < 3; ++i) l[k][a][i] = q == 0 ? value * v[a][i] : mul_add(value, v[a][i], l[k][a][i]);
    }
  }
}

template <class T>
void add_point(const Hex8Law& law, const BlockInput& in, bool damped, int q, const Hex8Work<T>& work,
               TangentSums<T>& sums, double* tangent) {
  const BlockPoint<T>& p = work.point[q];
  const hex8::Gradients& dn = hex8::tables().points.gradient[q];
  const bool mean = law.formulation == Hex8Formulation::mean_dilatation;
  PointVectors<T> v;
  for (int a = 0; a < kN; ++a)
    for (int d = 0; d < 3; ++d)
      v.g[a][d] = mul_add(p.inverse.x[0][d], T(dn[0][a]),
                          mul_add(p.inverse.x[1][d], T(dn[1][a]), p.inverse.x[2][d] * T(dn[2][a])));
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
  apply(p.f, v.g, v.u);
  apply(weighted, v.g, v.w);
  apply(s, v.g, v.h);
  const T c1 = T(mean ? -2 * law.mu / 3 : law.lambda) * p.volume, c2 = T(law.mu) * p.volume;
  for (int a = 0; a < kN; ++a)
    for (int i = 0; i < 3; ++i) {
      v.wc[a][i] = c1 * v.w[a][i];
      v.uc[a][i] = c2 * v.u[a][i];
      if (!mean) continue;
      sums.mean[a][i] = q == 0 ? p.volume * v.u[a][i] : mul_add(p.volume, v.u[a][i], sums.mean[a][i]);
      sums.mean_hat[a][i] = q == 0 ? p.volume * v.w[a][i] : mul_add(p.volume, v.w[a][i], sums.mean_hat[a][i]);
    }
  add_pairs(v, !damped, q == 0, tangent);
  if (law.formulation != Hex8Formulation::enhanced) return;
  add_coupling(work.modes, q, p.f, v.g, sums.l);
  if (damped) add_coupling(work.modes, q, weighted, v.g, sums.hat);
}

/// K += scale x^T y over `count` rows of x and y, blocks a <= b alone where symmetric.
template <class T>
void add_products(const T (*x)[kN][3], const T (*y)[kN][3], int count, T scale, bool symmetric, double* tangent) {
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
          double* to = block_of<T>(tangent, a, b, i, j);
          mul_add(scale, sum[j][i], T::load(to)).store(to);
        }
    }
}

template <class T>
void solve_rows(const BlockModes<T>& m, T (&l)[kModes][kN][3]) {
  for (int a = 0; a < kN; ++a)
    for (int i = 0; i < 3; ++i) {
      T x[kModes];
      for (int k = 0; k < kModes; ++k) x[k] = l[k][a][i];
      solve_lower(m, x);
      for (int k = 0; k < kModes; ++k) l[k][a][i] = x[k];
    }
}

template <class T>
void write_tangent(const Hex8Law& law, const BlockInput& in, bool damped, Hex8Work<T>& w, double* tangent) {
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
  for (int a = 0; a < kN && !damped; ++a)
    for (int b = 0; b < a; ++b)
      for (int j = 0; j < 3; ++j)
        for (int i = 0; i < 3; ++i) T::load(block_of<T>(tangent, b, a, j, i)).store(block_of<T>(tangent, a, b, i, j));
}

template <class T>
unsigned evaluate_block(const Hex8Law& law, const BlockInput& in, const BlockOutput& out) {
  Hex8Work<T> w;
  const bool damped = in.damping != 0 && in.velocity != nullptr;
  load_state(in, w);
  typename T::Mask good = kinematics(damped, in.damping, w);
  good = respond(law, good, damped, w, out.energy);
  write_force(w, out.force);
  if (out.tangent != nullptr) write_tangent(law, in, damped, w, out.tangent);
  return T::bits(good);
}
