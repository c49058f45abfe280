/// \file
/// Tensors and nodal fields for a lane type T, for the kernels' formulas (solid_block-inl.hpp, hex8_block-inl.hpp).
/// Included by them, within their namespaces, so there is no include guard and no include here.
///
/// T: a number per lane, with T(double), load, store, + - * / and mul_add(a, b, c) = a b + c, square_root,
/// log_one_plus, Mask and and_positive(mask, x). Node a, component i of a nodal field is [3 a + i]; strains and
/// stresses in the order 11 22 33 12 23 13, strains with engineering shears.

/// Component m of a strain or a stress is that of this row and column. Functions, since kernels of GPUs read no arrays
/// of the host.
ESPALIER_ANYWHERE constexpr int voigt_row(int m) {
  constexpr int rows[6] = {0, 1, 2, 0, 1, 0};
  return rows[m];
}
ESPALIER_ANYWHERE constexpr int voigt_column(int m) {
  constexpr int columns[6] = {0, 1, 2, 1, 2, 2};
  return columns[m];
}

template <class T>
struct Tensor {
  T x[3][3];
};

template <class T>
ESPALIER_ANYWHERE T cofactor(const Tensor<T>& a, int i, int j) {
  const int i1 = (i + 1) % 3, i2 = (i + 2) % 3, j1 = (j + 1) % 3, j2 = (j + 2) % 3;
  return a.x[i1][j1] * a.x[i2][j2] - a.x[i1][j2] * a.x[i2][j1];
}

template <class T>
ESPALIER_ANYWHERE T determinant_of(const Tensor<T>& a) {
  return mul_add(a.x[0][0], cofactor(a, 0, 0), mul_add(a.x[0][1], cofactor(a, 0, 1), a.x[0][2] * cofactor(a, 0, 2)));
}

/// det(I + h) - 1 without the cancellation of computing the determinant first.
template <class T>
ESPALIER_ANYWHERE T volume_change_of(const Tensor<T>& h) {
  const T second = cofactor(h, 0, 0) + cofactor(h, 1, 1) + cofactor(h, 2, 2);
  return h.x[0][0] + h.x[1][1] + h.x[2][2] + second + determinant_of(h);
}

/// @return det a
template <class T>
ESPALIER_ANYWHERE T invert_tensor(const Tensor<T>& a, Tensor<T>& inverse) {
  const T det = determinant_of(a);
  const T scale = T(1.0) / det;
  for (int i = 0; i < 3; ++i)
    for (int j = 0; j < 3; ++j) inverse.x[j][i] = scale * cofactor(a, i, j);
  return det;
}

/// c = a b
template <class T>
ESPALIER_ANYWHERE void product(const Tensor<T>& a, const Tensor<T>& b, Tensor<T>& c) {
  for (int i = 0; i < 3; ++i)
    for (int j = 0; j < 3; ++j)
      c.x[i][j] = mul_add(a.x[i][0], b.x[0][j], mul_add(a.x[i][1], b.x[1][j], a.x[i][2] * b.x[2][j]));
}

/// c = a b^T
template <class T>
ESPALIER_ANYWHERE void product_transposed(const Tensor<T>& a, const Tensor<T>& b, Tensor<T>& c) {
  for (int i = 0; i < 3; ++i)
    for (int j = 0; j < 3; ++j)
      c.x[i][j] = mul_add(a.x[i][0], b.x[j][0], mul_add(a.x[i][1], b.x[j][1], a.x[i][2] * b.x[j][2]));
}

/// h = a + I
template <class T>
ESPALIER_ANYWHERE Tensor<T> plus_identity(const Tensor<T>& h) {
  Tensor<T> f = h;
  for (int i = 0; i < 3; ++i) f.x[i][i] = h.x[i][i] + T(1.0);
  return f;
}

/// Symmetric tensor of a stress in the order above.
template <class T>
ESPALIER_ANYWHERE void tensor_of(const T (&s)[6], Tensor<T>& c) {
  for (int m = 0; m < 6; ++m) c.x[voigt_row(m)][voigt_column(m)] = c.x[voigt_column(m)][voigt_row(m)] = s[m];
}

/// S = C E of the linear isotropic law with Lame's constants.
template <class T>
ESPALIER_ANYWHERE void linear_stress(double lambda, double mu, const T (&e)[6], T (&s)[6]) {
  const T trace = T(lambda) * (e[0] + e[1] + e[2]), shear(mu), twice(2 * mu);
  for (int m = 0; m < 3; ++m) {
    s[m] = mul_add(twice, e[m], trace);
    s[m + 3] = shear * e[m + 3];
  }
}

template <class T>
ESPALIER_ANYWHERE T inner(const T (&a)[6], const T (&b)[6]) {
  T sum = a[0] * b[0];
  for (int m = 1; m < 6; ++m) sum = mul_add(a[m], b[m], sum);
  return sum;
}

/// E = (H + H^T + H^T H) / 2 from the displacement gradient H, so that small strains keep their digits.
template <class T>
ESPALIER_ANYWHERE void green_lagrange(const Tensor<T>& h, T (&e)[6]) {
  for (int m = 0; m < 6; ++m) {
    const int i = voigt_row(m), j = voigt_column(m);
    T square = h.x[0][i] * h.x[0][j];
    for (int k = 1; k < 3; ++k) square = mul_add(h.x[k][i], h.x[k][j], square);
    const T twice = h.x[i][j] + h.x[j][i] + square;
    e[m] = m < 3 ? T(0.5) * twice : twice;
  }
}

/// beta dE/dt from F and its rate.
template <class T>
ESPALIER_ANYWHERE void strain_rate(const Tensor<T>& f, const Tensor<T>& rate, double damping, T (&e)[6]) {
  for (int m = 0; m < 6; ++m) {
    const int i = voigt_row(m), j = voigt_column(m);
    T sum(0.0);
    for (int k = 0; k < 3; ++k) sum = mul_add(f.x[k][i], rate.x[k][j], mul_add(rate.x[k][i], f.x[k][j], sum));
    e[m] = T(m < 3 ? 0.5 * damping : damping) * sum;
  }
}

/// c[i][k] = sum_a field[3a + i] dN_a/dxi_k
template <class T, int kN>
ESPALIER_ANYWHERE void local_gradient(const T (&field)[3 * kN], const double (&dn)[3][kN], Tensor<T>& c) {
  for (int i = 0; i < 3; ++i)
    for (int k = 0; k < 3; ++k) {
      T sum = field[i] * T(dn[k][0]);
      for (int a = 1; a < kN; ++a) sum = mul_add(field[3 * a + i], T(dn[k][a]), sum);
      c.x[i][k] = sum;
    }
}

/// Inverse of dX/dxi. @return its determinant
template <class T, int kN>
ESPALIER_ANYWHERE T invert_jacobian(const T (&x)[3 * kN], const double (&dn)[3][kN], Tensor<T>& inverse) {
  Tensor<T> jacobian;
  local_gradient<T, kN>(x, dn, jacobian);
  return invert_tensor(jacobian, inverse);
}

/// f_a += volume P G_a with P the first Piola stress, G_a = dN_a/dX.
template <class T, int kN>
ESPALIER_ANYWHERE void add_force(const Tensor<T>& piola, const Tensor<T>& inverse, T volume, const double (&dn)[3][kN],
                                 T (&f)[3 * kN]) {
  for (int i = 0; i < 3; ++i) {
    T local[3];
    for (int k = 0; k < 3; ++k)
      local[k] = volume * mul_add(piola.x[i][0], inverse.x[k][0],
                                  mul_add(piola.x[i][1], inverse.x[k][1], piola.x[i][2] * inverse.x[k][2]));
    for (int a = 0; a < kN; ++a)
      for (int k = 0; k < 3; ++k) f[3 * a + i] = mul_add(local[k], T(dn[k][a]), f[3 * a + i]);
  }
}

/// g[a] = dN_a/dX
template <class T, int kN>
ESPALIER_ANYWHERE void gradients(const Tensor<T>& inverse, const double (&dn)[3][kN], T (&g)[kN][3]) {
  for (int a = 0; a < kN; ++a)
    for (int d = 0; d < 3; ++d)
      g[a][d] =
          mul_add(inverse.x[0][d], T(dn[0][a]), mul_add(inverse.x[1][d], T(dn[1][a]), inverse.x[2][d] * T(dn[2][a])));
}

/// v[a] = A g[a]
template <class T, int kN>
ESPALIER_ANYWHERE void apply(const Tensor<T>& a, const T (&g)[kN][3], T (&v)[kN][3]) {
  for (int n = 0; n < kN; ++n)
    for (int i = 0; i < 3; ++i) v[n][i] = mul_add(a.x[i][0], g[n][0], mul_add(a.x[i][1], g[n][1], a.x[i][2] * g[n][2]));
}

/// One point's share of the tangent: block (a, b) = c1 u_a w_b^T + c2 u_b w_a^T + (g_a . h_b) I + (g_a . g_b) m, the
/// formula of PointResponse; wc = c1 w, uc = c2 u.
template <class T, int kN>
struct PointVectors {
  T g[kN][3], u[kN][3], w[kN][3], h[kN][3], wc[kN][3], uc[kN][3];
  Tensor<T> m;
};

template <class T, int kN>
ESPALIER_ANYWHERE double* block_of(double* tangent, int a, int b, int i, int j) {
  return tangent + ((3 * b + j) * 3 * kN + 3 * a + i) * T::kWidth;
}

/// Adds it, or with `first` writes it; of a symmetric tangent the blocks a <= b alone.
template <class T, int kN>
ESPALIER_ANYWHERE void add_pairs(const PointVectors<T, kN>& p, bool symmetric, bool first, double* tangent) {
  for (int a = 0; a < kN; ++a)
    for (int b = symmetric ? a : 0; b < kN; ++b) {
      const T dot = mul_add(p.g[a][0], p.g[b][0], mul_add(p.g[a][1], p.g[b][1], p.g[a][2] * p.g[b][2]));
      const T diagonal = mul_add(p.g[a][0], p.h[b][0], mul_add(p.g[a][1], p.h[b][1], p.g[a][2] * p.h[b][2]));
      for (int j = 0; j < 3; ++j)
        for (int i = 0; i < 3; ++i) {
          double* to = block_of<T, kN>(tangent, a, b, i, j);
          T sum = mul_add(p.m.x[i][j], dot, i == j ? diagonal : T(0.0));
          if (!first) sum = sum + T::load(to);
          mul_add(p.u[a][i], p.wc[b][j], mul_add(p.w[a][j], p.uc[b][i], sum)).store(to);
        }
    }
}
