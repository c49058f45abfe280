/// \file
/// The formulas of solid_block.hpp for a lane type T, over lane_algebra-inl.hpp. Included once by the scalar kernels
/// and once per instruction set by the vectors', each in a namespace of its own, so there is no include guard and no
/// include here.

/// What one point gives: the first Piola stress and the tangent of PointResponse.
template <class T>
struct LaneResponse {
  Tensor<T> p, u, w, h, m;
  T c1, c2, energy;
};

template <class T>
struct LanePoint {
  Tensor<T> inverse;  // dxi_k / dX_d at [k][d]
  Tensor<T> h, rate;  // displacement and velocity gradients
  T volume;
};

/// St. Venant-Kirchhoff, as respond_svk(): `elastic` = false leaves the viscous part alone.
template <class T>
ESPALIER_ANYWHERE void respond_linear(const SolidConstants& law, const BlockInput& in, bool elastic, bool damped,
                                      const LanePoint<T>& p, LaneResponse<T>& r) {
  const Tensor<T> f = plus_identity(p.h);
  T strain[6], stress[6];
  for (T& e : strain) e = T(0.0);
  if (elastic) green_lagrange(p.h, strain);
  linear_stress(law.lambda, law.mu, strain, stress);
  r.energy = T(0.5) * inner(stress, strain);
  if (damped) {
    strain_rate(f, p.rate, in.damping, strain);
    T viscous[6];
    linear_stress(law.lambda, law.mu, strain, viscous);
    for (int m = 0; m < 6; ++m) stress[m] = stress[m] + viscous[m];
  }
  Tensor<T> s;
  tensor_of(stress, s);
  product(f, s, r.p);
  // W = (wq + beta wv) F + beta wq dF/dt
  const T keep((elastic ? in.position_weight : 0.0) + in.damping * in.velocity_weight);
  const T by_rate(in.damping * in.position_weight), weight(in.position_weight);
  for (int i = 0; i < 3; ++i)
    for (int j = 0; j < 3; ++j) {
      r.w.x[i][j] = keep * f.x[i][j];
      if (damped) r.w.x[i][j] = mul_add(by_rate, p.rate.x[i][j], r.w.x[i][j]);
      r.h.x[i][j] = weight * s.x[i][j];
    }
  r.u = f;
  product_transposed(f, r.w, r.m);
  for (auto& row : r.m.x)
    for (T& value : row) value = T(law.mu) * value;
  r.c1 = T(law.lambda);
  r.c2 = T(law.mu);
}

/// Compressible neo-Hookean, as respond_neo_hookean(): U = F^-T, W = wq U, H = wq mu I, M = 0.
template <class T>
ESPALIER_ANYWHERE void respond_neo_hookean(const SolidConstants& law, const BlockInput& in, const LanePoint<T>& p,
                                           LaneResponse<T>& r) {
  const T log_j = log_one_plus(volume_change_of(p.h)), weight(in.position_weight);
  const Tensor<T> f = plus_identity(p.h);
  Tensor<T> inverse;
  static_cast<void>(invert_tensor(f, inverse));
  T trace(0.0);  // of E
  const T factor = mul_add(T(law.lambda), log_j, T(-law.mu));
  for (int i = 0; i < 3; ++i)
    for (int j = 0; j < 3; ++j) {
      const T h = p.h.x[i][j];
      trace = mul_add(T(0.5) * h, h, i == j ? trace + h : trace);
      r.p.x[i][j] = mul_add(factor, inverse.x[j][i], T(law.mu) * f.x[i][j]);
      r.u.x[i][j] = inverse.x[j][i];
      r.w.x[i][j] = weight * inverse.x[j][i];
      r.h.x[i][j] = T(i == j ? in.position_weight * law.mu : 0.0);
      r.m.x[i][j] = T(0.0);
    }
  r.c1 = T(law.lambda);
  r.c2 = T(0.0) - factor;
  r.energy = mul_add(T(law.mu), trace - log_j, T(0.5 * law.lambda) * log_j * log_j);
}

template <class T, int kN>
ESPALIER_ANYWHERE void add_tangent(const LaneResponse<T>& r, const LanePoint<T>& p, const double (&dn)[3][kN],
                                   bool symmetric, bool first, double* tangent) {
  PointVectors<T, kN> v;
  gradients<T, kN>(p.inverse, dn, v.g);
  apply<T, kN>(r.u, v.g, v.u);
  apply<T, kN>(r.w, v.g, v.w);
  Tensor<T> h;
  for (int i = 0; i < 3; ++i)
    for (int j = 0; j < 3; ++j) {
      h.x[i][j] = p.volume * r.h.x[i][j];
      v.m.x[i][j] = p.volume * r.m.x[i][j];
    }
  apply<T, kN>(h, v.g, v.h);
  const T c1 = p.volume * r.c1, c2 = p.volume * r.c2;
  for (int a = 0; a < kN; ++a)
    for (int i = 0; i < 3; ++i) {
      v.wc[a][i] = c1 * v.w[a][i];
      v.uc[a][i] = c2 * v.u[a][i];
    }
  add_pairs<T, kN>(v, symmetric, first, tangent);
}

template <class T, int kN>
ESPALIER_ANYWHERE void load_field(const double* from, T (&field)[3 * kN]) {
  for (int k = 0; k < 3 * kN; ++k) field[k] = T::load(from + k * T::kWidth);
}

template <class T, int kN, int kMostPoints>
ESPALIER_ANYWHERE unsigned evaluate_solid_block(const SolidConstants& law, const ShapeTable<kN, kMostPoints>& table,
                                                const BlockInput& in, const BlockOutput& out) {
  const bool damped = in.damping != 0 && in.velocity != nullptr;
  const bool neo_hookean = law.neo_hookean, viscous_too = neo_hookean && in.damping != 0;
  T reference[3 * kN], displacement[3 * kN], velocity[3 * kN], force[3 * kN];
  load_field<T, kN>(in.reference, reference);
  load_field<T, kN>(in.position, displacement);
  if (damped) load_field<T, kN>(in.velocity, velocity);
  for (int k = 0; k < 3 * kN; ++k) {
    displacement[k] = displacement[k] - reference[k];
    force[k] = T(0.0);
  }
  typename T::Mask good = T::all();
  T energy(0.0);
  for (int q = 0; q < table.points; ++q) {
    const double(&dn)[3][kN] = table.gradient[q];
    LanePoint<T> p;
    LaneResponse<T> r;
    Tensor<T> local;
    const T det = invert_jacobian<T, kN>(reference, dn, p.inverse);
    p.volume = T(table.weight[q]) * det;
    local_gradient<T, kN>(displacement, dn, local);
    product(local, p.inverse, p.h);
    if (damped) {
      local_gradient<T, kN>(velocity, dn, local);
      product(local, p.inverse, p.rate);
    }
    good = and_positive(and_positive(good, det), T(1.0) + volume_change_of(p.h));
    for (int part = 0; part < (viscous_too ? 2 : 1); ++part) {
      if (neo_hookean && part == 0)
        respond_neo_hookean(law, in, p, r);
      else
        respond_linear(law, in, part == 0, damped, p, r);
      if (part == 0) energy = mul_add(p.volume, r.energy, energy);
      add_force<T, kN>(r.p, p.inverse, p.volume, dn, force);
      if (out.tangent != nullptr) add_tangent<T, kN>(r, p, dn, !damped, q == 0 && part == 0, out.tangent);
    }
  }
  for (int k = 0; k < 3 * kN; ++k) force[k].store(out.force + k * T::kWidth);
  energy.store(out.energy);
  return T::bits(good);
}

template <class T>
SolidKernels solid_kernels() {
  SolidKernels kernels;
  kernels.width = T::kWidth;
#define ESPALIER_KERNEL(kind, nodes, points) kernels.kind = &evaluate_solid_block<T, nodes, points>;
  ESPALIER_FOR_SOLIDS(ESPALIER_KERNEL)
#undef ESPALIER_KERNEL
  return kernels;
}
