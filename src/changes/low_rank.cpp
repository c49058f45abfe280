#include "changes/low_rank.hpp"

#include <cmath>
#include <limits>

#include "dense/dense.hpp"

namespace espalier::changes {

namespace {

template <class T>
using CoreOf = Eigen::Matrix<T, Eigen::Dynamic, Eigen::Dynamic>;
// C = Q diag(values) Q^T, or Q^H where it is Hermitian.
template <class T>
using Factors = dense::SpectrumOf<T>;

// The factors of a complex symmetric matrix C = R + iS, Q unitary (Takagi 1925; Horn and Johnson 2013, section 4.4): C
// conj(q) = s q for q = a + ib means [R S; S -R] [a; b] = s [a; b]. Its eigenvalues stand there with both signs.
Factors<std::complex<double>> by_singular_values(const CoreOf<std::complex<double>>& c) {
  const Eigen::Index n = c.rows();
  Eigen::MatrixXd real(2 * n, 2 * n);
  real << c.real(), c.imag(), c.imag(), -c.real();
  const dense::Spectrum eigen = dense::symmetric_eigen(real);
  Factors<std::complex<double>> f{eigen.values.tail(n), {n, n}};
  f.vectors.real() = eigen.vectors.topRightCorner(n, n);
  f.vectors.imag() = eigen.vectors.bottomRightCorner(n, n);
  // For zeros any vectors are found, not those of Q.
  const double zero = 4 * static_cast<double>(n) * std::numeric_limits<double>::epsilon() * eigen.values[2 * n - 1];
  for (double& s : f.values) s = s <= zero ? 0 : s;
  return f;
}

template <class T>
Factors<T> symmetric_factors(const CoreOf<T>& c, [[maybe_unused]] bool hermitian) {
  if constexpr (base::ScalarTraits<T>::is_complex)
    if (!hermitian) return by_singular_values(c);
  return dense::hermitian_eigen(c);
}

/// @param factors  `stride` apart
template <class T>
SparseVector<T> combined(const std::vector<SparseVector<T>>& of, const T* factors, Eigen::Index stride) {
  SparseVector<T> sum;
  for (std::size_t k = 0; k < of.size(); ++k, factors += stride)
    for (std::size_t q = 0; q < of[k].size(); ++q)
      if (const T x = *factors * of[k].value[q]; x != T(0)) sum.push(of[k].place[q], x);
  sum.sort();
  return sum;
}

template <class T>
bool mirrors(const std::vector<SparseVector<T>>& u, const std::vector<SparseVector<T>>& v, bool hermitian) {
  for (std::size_t k = 0; k < u.size(); ++k)
    if (!(v[k] == u[k].mirrored(hermitian))) return false;
  return true;
}

}  // namespace

template <class T>
std::vector<Item<T>> low_rank_items(const std::vector<SparseVector<T>>& u, std::span<const T> c,
                                    const std::vector<SparseVector<T>>& v, bool hermitian) {
  const auto rank = static_cast<Eigen::Index>(u.size());
  const CoreOf<T> core = c.empty() ? CoreOf<T>(CoreOf<T>::Identity(rank, rank))
                                   : CoreOf<T>(Eigen::Map<const CoreOf<T>>(c.data(), rank, rank));
  const CoreOf<T> turned = hermitian ? CoreOf<T>(core.adjoint()) : CoreOf<T>(core.transpose());
  std::vector<Item<T>> items;
  const auto push = [&](SparseVector<T> column, SparseVector<T> row, T corner) {
    if (!std::isfinite(std::abs(corner))) return;  // nothing changes
    if (corner == T(0))
      throw Error(StatusCode::invalid_input, "C has an eigenvalue above the largest number; scale U and C");
    items.push_back({std::move(column), std::move(row), corner, true});
  };
  if (core == turned && mirrors(u, v, hermitian)) {  // one row and column for each eigenvalue, which the inertia needs
    const Factors<T> f = symmetric_factors<T>(core, hermitian);
    for (Eigen::Index k = 0; k < rank; ++k) {
      const SparseVector<T> column = combined(u, &f.vectors(0, k), 1);
      push(column, column.mirrored(hermitian), T(-1 / f.values[k]));
    }
  } else {
    for (Eigen::Index k = 0; k < rank; ++k) push(u[static_cast<std::size_t>(k)], combined(v, &core(k, 0), rank), T(-1));
  }
  return items;
}

#define ESPALIER_INSTANTIATE(T)                                                                         \
  template std::vector<Item<T>> low_rank_items(const std::vector<SparseVector<T>>&, std::span<const T>, \
                                               const std::vector<SparseVector<T>>&, bool);
ESPALIER_FOR_NUMBERS(ESPALIER_INSTANTIATE)
#undef ESPALIER_INSTANTIATE

}  // namespace espalier::changes
