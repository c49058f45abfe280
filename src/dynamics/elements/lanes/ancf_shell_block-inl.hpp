/// \file
/// ancf_shell.hpp for a lane type T: the hexahedron with nodes r_a -/+ h/2 d_a. Included after
/// hex8_strain_block-inl.hpp, in the same places; who includes it gives shell_tables() too, in which the nodes stand in
/// pairs, so that each pair is mapped where it is.

/// r, d -> r - half d, r + half d of all pairs of vertices.
template <class T>
ESPALIER_ANYWHERE void to_hexahedron(double half, T (&x)[kDofs]) {
  for (int a = 0; a < kN; a += 2)
    for (int i = 0; i < 3; ++i) {
      const T r = x[3 * a + i], d = T(half) * x[3 * a + 3 + i];
      x[3 * a + i] = r - d;
      x[3 * a + 3 + i] = r + d;
    }
}

/// The transposed map, for forces: f_r = bottom + top, f_d = half (top - bottom).
template <class T>
ESPALIER_ANYWHERE void from_hexahedron(double half, T& bottom, T& top) {
  const T sum = bottom + top;
  top = T(half) * (top - bottom);
  bottom = sum;
}

/// The tangent, rows and columns. Of a symmetric one, which has the blocks a <= b alone, those in the middle of a pair
/// are completed first.
template <class T>
ESPALIER_ANYWHERE void map_tangent(double half, bool symmetric, double* tangent) {
  for (int a = 0; a < kN && symmetric; a += 2)
    for (int j = 0; j < 3; ++j)
      for (int i = 0; i < 3; ++i)
        T::load(block_of<T, kN>(tangent, a, a + 1, j, i)).store(block_of<T, kN>(tangent, a + 1, a, i, j));
  for (int a = 0; a < kN; a += 2)
    for (int b = symmetric ? a : 0; b < kN; b += 2)
      for (int j = 0; j < 3; ++j)
        for (int i = 0; i < 3; ++i) {
          T k[2][2];  // [column][row]
          for (int c = 0; c < 2; ++c)
            for (int r = 0; r < 2; ++r) k[c][r] = T::load(block_of<T, kN>(tangent, a + r, b + c, i, j));
          for (int c = 0; c < 2; ++c) from_hexahedron(half, k[c][0], k[c][1]);
          for (int r = 0; r < 2; ++r) from_hexahedron(half, k[0][r], k[1][r]);
          for (int c = 0; c < 2; ++c)
            for (int r = 0; r < 2; ++r) k[c][r].store(block_of<T, kN>(tangent, a + r, b + c, i, j));
        }
}

template <class T>
ESPALIER_ANYWHERE unsigned evaluate_shell_block(const ShellLaw& law, const BlockInput& in, const BlockOutput& out) {
  const double half = 0.5 * law.thickness;
  StrainWork<T> w;
  T force[kDofs];
  load_strain_state(in, w);
  to_hexahedron(half, w.reference);
  to_hexahedron(half, w.displacement);
  to_hexahedron(half, w.velocity);
  const typename T::Mask good = evaluate_strains(law.hexahedra, Assumed(Hex8Formulation::shell, shell_tables()), in, w,
                                                 force, out.energy, out.tangent);
  for (int a = 0; a < kN; a += 2)
    for (int i = 0; i < 3; ++i) from_hexahedron(half, force[3 * a + i], force[3 * a + 3 + i]);
  for (int d = 0; d < kDofs; ++d) force[d].store(out.force + d * T::kWidth);
  if (out.tangent != nullptr) map_tangent<T>(half, in.damping == 0 || in.velocity == nullptr, out.tangent);
  return T::bits(good);
}
