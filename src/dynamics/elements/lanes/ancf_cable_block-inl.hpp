/// \file
/// The formulas of ancf_cable.cpp for a lane type T, over lane_algebra-inl.hpp. Included once by the scalar kernel and
/// once per instruction set by the vectors', each in a namespace of its own, so there is no include guard and no
/// include here. Who includes it gives cable_tables(), the CableTables where they can be read.

template <class T>
struct LaneVector {
  T x[3];
};

template <class T>
ESPALIER_ANYWHERE LaneVector<T> operator+(const LaneVector<T>& a, const LaneVector<T>& b) {
  return {{a.x[0] + b.x[0], a.x[1] + b.x[1], a.x[2] + b.x[2]}};
}
template <class T>
ESPALIER_ANYWHERE LaneVector<T> operator-(const LaneVector<T>& a, const LaneVector<T>& b) {
  return {{a.x[0] - b.x[0], a.x[1] - b.x[1], a.x[2] - b.x[2]}};
}
template <class T>
ESPALIER_ANYWHERE LaneVector<T> operator*(T s, const LaneVector<T>& a) {
  return {{s * a.x[0], s * a.x[1], s * a.x[2]}};
}
template <class T>
ESPALIER_ANYWHERE T dot(const LaneVector<T>& a, const LaneVector<T>& b) {
  return mul_add(a.x[0], b.x[0], mul_add(a.x[1], b.x[1], a.x[2] * b.x[2]));
}
template <class T>
ESPALIER_ANYWHERE LaneVector<T> cross(const LaneVector<T>& a, const LaneVector<T>& b) {
  return {{a.x[1] * b.x[2] - a.x[2] * b.x[1], a.x[2] * b.x[0] - a.x[0] * b.x[2], a.x[0] * b.x[1] - a.x[1] * b.x[0]}};
}
template <class T>
ESPALIER_ANYWHERE LaneVector<T> zero_vector() {
  return {{T(0.0), T(0.0), T(0.0)}};
}

template <class T>
ESPALIER_ANYWHERE void clear(Tensor<T>& m) {
  for (auto& row : m.x)
    for (T& value : row) value = T(0.0);
}
/// m += s a b^T
template <class T>
ESPALIER_ANYWHERE void add_outer(T s, const LaneVector<T>& a, const LaneVector<T>& b, Tensor<T>& m) {
  for (int i = 0; i < 3; ++i) {
    const T left = s * a.x[i];
    for (int j = 0; j < 3; ++j) m.x[i][j] = mul_add(left, b.x[j], m.x[i][j]);
  }
}
/// m += s I
template <class T>
ESPALIER_ANYWHERE void add_identity(T s, Tensor<T>& m) {
  for (int i = 0; i < 3; ++i) m.x[i][i] = m.x[i][i] + s;
}
/// m += s [a]_x, [a]_x b = a x b
template <class T>
ESPALIER_ANYWHERE void add_cross(T s, const LaneVector<T>& a, Tensor<T>& m) {
  for (int i = 0; i < 3; ++i) {
    const int j = (i + 1) % 3, k = (i + 2) % 3;
    const T value = s * a.x[i];
    m.x[k][j] = m.x[k][j] + value;
    m.x[j][k] = m.x[j][k] - value;
  }
}
/// m += s a
template <class T>
ESPALIER_ANYWHERE void add_tensor(T s, const Tensor<T>& a, Tensor<T>& m) {
  for (int i = 0; i < 3; ++i)
    for (int j = 0; j < 3; ++j) m.x[i][j] = mul_add(s, a.x[i][j], m.x[i][j]);
}
/// m += a^T b
template <class T>
ESPALIER_ANYWHERE void add_transposed_product(const Tensor<T>& a, const Tensor<T>& b, Tensor<T>& m) {
  for (int i = 0; i < 3; ++i)
    for (int j = 0; j < 3; ++j)
      for (int k = 0; k < 3; ++k) m.x[i][j] = mul_add(a.x[k][i], b.x[k][j], m.x[i][j]);
}

/// Chord and slopes, and what belongs to them: forces, and blocks of the tangent by pairs.
template <class T>
struct CableWork {
  LaneVector<T> at[kCableParts], rate[kCableParts], force[kCableParts];
  Tensor<T> tangent[kCableParts][kCableParts];  // [column][row]; of a symmetric one those with row <= column
  T energy;
  typename T::Mask good;
  bool wanted, symmetric;  // the tangent
};

/// How the tangent is wanted, times the stiffness and the weight of a point (see ElementInput).
struct CableWeights {
  double stiffness, elastic, viscous, damping;
  ESPALIER_ANYWHERE CableWeights(double d, const BlockInput& in)
      : stiffness(d),
        elastic(in.position_weight),
        viscous(d * (in.position_weight + in.damping * in.velocity_weight)),
        damping(in.velocity == nullptr ? 0 : in.damping) {}
};

/// sum c_k v_k
template <class T>
ESPALIER_ANYWHERE LaneVector<T> sum_of_parts(const double (&c)[kCableParts], const LaneVector<T> (&v)[kCableParts]) {
  LaneVector<T> sum;
  for (int i = 0; i < 3; ++i) sum.x[i] = mul_add(T(c[0]), v[0].x[i], mul_add(T(c[1]), v[1].x[i], T(c[2]) * v[2].x[i]));
  return sum;
}

/// eps = |r'| - 1: eps' = t = r' / |r'|, eps'' = (I - t t^T) / |r'|.
template <class T>
ESPALIER_ANYWHERE void add_axial(const double (&c)[kCableParts], const CableWeights& w, CableWork<T>& work) {
  const LaneVector<T> slope = sum_of_parts(c, work.at);
  const T square = dot(slope, slope), length = square_root(square), over = T(1.0) / length;
  work.good = and_positive(work.good, square);
  const LaneVector<T> t = over * slope;
  const T strain = length - T(1.0);
  LaneVector<T> rate = zero_vector<T>();
  if (w.damping != 0) rate = sum_of_parts(c, work.rate);
  const T along = dot(t, rate), stress = T(w.stiffness) * mul_add(T(w.damping), along, strain);
  work.energy = mul_add(T(0.5 * w.stiffness) * strain, strain, work.energy);
  for (int a = 0; a < kCableParts; ++a) work.force[a] = work.force[a] + (T(c[a]) * stress) * t;
  if (!work.wanted) return;
  Tensor<T> h;
  clear(h);
  const T across = T(w.elastic) * stress * over;
  add_outer(T(w.viscous) - across, t, t, h);
  add_identity(across, h);
  if (w.damping != 0) add_outer(T(w.elastic * w.stiffness * w.damping) * over, t, rate - along * t, h);
  for (int b = 0; b < kCableParts; ++b)
    for (int a = 0; a <= (work.symmetric ? b : kCableParts - 1); ++a) add_tensor(T(c[a] * c[b]), h, work.tangent[b][a]);
}

/// kappa = q a x b with a = r', b = r'', q = 1 / |a|^2.
template <class T>
struct LaneCurvature {
  LaneVector<T> a, b, kappa, rate_a, rate_b, rate;
  T q;

  /// kappa' by a and b, applied to the rates: q v x b - 2 q (a . v) kappa and q a x v.
  [[nodiscard]] ESPALIER_ANYWHERE LaneVector<T> change() const {
    return q * (cross(rate_a, b) + cross(a, rate_b)) - (T(2.0) * q * dot(a, rate_a)) * kappa;
  }
  ESPALIER_ANYWHERE void derivative(Tensor<T> (&k)[2]) const {
    clear(k[0]);
    clear(k[1]);
    add_cross(T(0.0) - q, b, k[0]);
    add_outer(T(-2.0) * q, kappa, a, k[0]);
    add_cross(q, a, k[1]);
  }
  /// Derivatives of change() by a and b, times s, added to c.
  ESPALIER_ANYWHERE void add_rate_derivative(T s, const Tensor<T> (&k)[2], Tensor<T> (&c)[2]) const {
    const T along = dot(a, rate_a), sq = s * q, twice = T(-2.0) * sq;
    add_outer(twice * q, cross(rate_a, b) + cross(a, rate_b), a, c[0]);
    add_cross(T(0.0) - sq, rate_b, c[0]);
    add_outer(twice, kappa, rate_a, c[0]);
    add_outer(T(4.0) * sq * q * along, kappa, a, c[0]);
    add_tensor(twice * along, k[0], c[0]);
    add_cross(sq, rate_a, c[1]);
    add_tensor(twice * along, k[1], c[1]);
  }
  /// Second derivatives of m . kappa for a moment m held constant, times s, added to h[column][row]; `ga`, `gb` are its
  /// first ones.
  ESPALIER_ANYWHERE void add_second(T s, const LaneVector<T>& m, const LaneVector<T>& ga, const LaneVector<T>& gb,
                                    Tensor<T> (&h)[2][2]) const {
    const T work = dot(m, kappa), sq = s * q, twice = T(-2.0) * sq;
    add_outer(twice * q, cross(b, m), a, h[0][0]);
    add_outer(T(4.0) * sq * q * work, a, a, h[0][0]);
    add_outer(twice, a, ga, h[0][0]);
    add_identity(twice * work, h[0][0]);
    add_cross(T(0.0) - sq, m, h[1][0]);
    add_outer(twice, a, gb, h[1][0]);
    add_cross(sq, m, h[0][1]);
    add_outer(twice, gb, a, h[0][1]);
  }
};

/// h[column][row] by a and b: kappa'^T (viscous kappa' + damping (kappa'' rate)) + elastic (m . kappa)''.
template <class T>
ESPALIER_ANYWHERE void bending_tangent(const LaneCurvature<T>& c, const CableWeights& w, const LaneVector<T>& moment,
                                       const LaneVector<T>& ga, const LaneVector<T>& gb, Tensor<T> (&h)[2][2]) {
  Tensor<T> k[2], right[2];
  c.derivative(k);
  for (int y = 0; y < 2; ++y) {
    clear(right[y]);
    add_tensor(T(w.viscous), k[y], right[y]);
  }
  if (w.damping != 0) c.add_rate_derivative(T(w.elastic * w.stiffness * w.damping), k, right);
  for (int y = 0; y < 2; ++y)
    for (int x = 0; x < 2; ++x) {
      clear(h[y][x]);
      add_transposed_product(k[x], right[y], h[y][x]);
    }
  c.add_second(T(w.elastic), moment, ga, gb, h);
}

template <class T>
ESPALIER_ANYWHERE void add_bending(const double (&d)[kCableParts], const double (&dd)[kCableParts],
                                   const CableWeights& w, CableWork<T>& work) {
  LaneCurvature<T> c;
  c.a = sum_of_parts(d, work.at);
  c.b = sum_of_parts(dd, work.at);
  const T square = dot(c.a, c.a);
  work.good = and_positive(work.good, square);
  c.q = T(1.0) / square;
  c.kappa = c.q * cross(c.a, c.b);
  LaneVector<T> moment = T(w.stiffness) * c.kappa;
  if (w.damping != 0) {
    c.rate_a = sum_of_parts(d, work.rate);
    c.rate_b = sum_of_parts(dd, work.rate);
    moment = moment + T(w.stiffness * w.damping) * c.change();
  }
  work.energy = mul_add(T(0.5 * w.stiffness), dot(c.kappa, c.kappa), work.energy);
  // kappa'^T m
  const LaneVector<T> ga = c.q * cross(c.b, moment) - (T(2.0) * c.q * dot(moment, c.kappa)) * c.a,
                      gb = c.q * cross(moment, c.a);
  for (int k = 0; k < kCableParts; ++k) work.force[k] = work.force[k] + T(d[k]) * ga + T(dd[k]) * gb;
  if (!work.wanted) return;
  Tensor<T> h[2][2];
  bending_tangent(c, w, moment, ga, gb, h);
  for (int col = 0; col < kCableParts; ++col) {
    Tensor<T> column[2];  // H times the column's share in a and b
    for (int x = 0; x < 2; ++x) {
      clear(column[x]);
      add_tensor(T(d[col]), h[0][x], column[x]);
      add_tensor(T(dd[col]), h[1][x], column[x]);
    }
    for (int row = 0; row <= (work.symmetric ? col : kCableParts - 1); ++row) {
      add_tensor(T(d[row]), column[0], work.tangent[col][row]);
      add_tensor(T(dd[row]), column[1], work.tangent[col][row]);
    }
  }
}

template <class T>
ESPALIER_ANYWHERE void load_parts(const double* x, LaneVector<T> (&v)[kCableParts]) {
  for (int i = 0; i < 3; ++i) {
    v[0].x[i] = T::load(x + (6 + i) * T::kWidth) - T::load(x + i * T::kWidth);
    v[1].x[i] = T::load(x + (3 + i) * T::kWidth);
    v[2].x[i] = T::load(x + (9 + i) * T::kWidth);
  }
}

/// The part that vertex r1, r1_x, r2, r2_x has a share in: positive, but for r1.
ESPALIER_ANYWHERE constexpr int part_of(int vertex) { return vertex == 1 ? 1 : vertex == 3 ? 2 : 0; }

/// From the parts to the vertices.
template <class T>
ESPALIER_ANYWHERE void write_cable(const CableWork<T>& work, const BlockOutput& out) {
  work.energy.store(out.energy);
  for (int a = 0; a < kCableVertices; ++a)
    for (int i = 0; i < 3; ++i)
      (T(a == 0 ? -1.0 : 1.0) * work.force[part_of(a)].x[i]).store(out.force + (3 * a + i) * T::kWidth);
  for (int b = 0; b < kCableVertices && work.wanted; ++b)
    for (int a = 0; a <= (work.symmetric ? b : kCableVertices - 1); ++a) {
      const int column = part_of(b), row = part_of(a);
      const bool turned = work.symmetric && row > column;
      const Tensor<T>& k = turned ? work.tangent[row][column] : work.tangent[column][row];
      const T sign((a == 0) == (b == 0) ? 1.0 : -1.0);
      for (int j = 0; j < 3; ++j)
        for (int i = 0; i < 3; ++i)
          (sign * (turned ? k.x[j][i] : k.x[i][j])).store(block_of<T, kCableVertices>(out.tangent, a, b, i, j));
    }
}

template <class T>
ESPALIER_ANYWHERE unsigned evaluate_cable_block(const CableLaw& law, const BlockInput& in, const BlockOutput& out) {
  const CableTables& table = cable_tables();
  CableWork<T> work;
  work.wanted = out.tangent != nullptr;
  work.symmetric = in.damping == 0 || in.velocity == nullptr;
  work.good = T::all();
  work.energy = T(0.0);
  load_parts(in.position, work.at);
  if (in.velocity != nullptr) load_parts(in.velocity, work.rate);
  for (int a = 0; a < kCableParts; ++a) {
    work.force[a] = zero_vector<T>();
    for (int b = 0; b < kCableParts && work.wanted; ++b) clear(work.tangent[b][a]);
  }
  const double per[kCableParts] = {1 / law.length, 1, 1};  // of first derivatives; second ones: once more 1 / length
  ESPALIER_ROLLED
  for (int k = 0; k < 5; ++k) {
    double d[kCableParts];
    for (int p = 0; p < kCableParts; ++p) d[p] = per[p] * table.axial.d[k][p];
    add_axial(d, CableWeights(law.length * table.axial.weight[k] * law.section.axial, in), work);
  }
  ESPALIER_ROLLED
  for (int k = 0; k < 3; ++k) {
    double d[kCableParts], dd[kCableParts];
    for (int p = 0; p < kCableParts; ++p) {
      d[p] = per[p] * table.bending.d[k][p];
      dd[p] = per[p] * table.bending.dd[k][p] / law.length;
    }
    add_bending(d, dd, CableWeights(law.length * table.bending.weight[k] * law.section.bending, in), work);
  }
  write_cable(work, out);
  return T::bits(work.good);
}
