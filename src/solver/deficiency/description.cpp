#include "solver/deficiency/description.hpp"

#include <algorithm>
#include <cmath>
#include <complex>
#include <utility>
#include <vector>

#include "base/scalar.hpp"

namespace espalier::solver {

namespace {

// Vectors of numbers, column by column.
template <class Value>
struct Columns {
  Index rows = 0, columns = 0;
  std::vector<Value> values;

  Value* column(Index c) { return values.data() + Offset{c} * rows; }
};

// One row for each null vector, by elimination with complete pivoting: without these rows (and as many columns) the
// rest is regular.
template <class Value>
std::vector<Index> leading_rows(Columns<Value> v) {
  std::vector<Index> rows;
  for (Index k = 0; k < v.columns; ++k) {
    Index column = k;
    Offset at = -1;
    double most = -1;
    for (Index c = k; c < v.columns; ++c)
      for (Index i = 0; i < v.rows; ++i)
        if (std::abs(v.column(c)[i]) > most) {
          most = std::abs(v.column(c)[i]);
          at = i;
          column = c;
        }
    if (!(most > 0)) break;
    std::swap_ranges(v.column(k), v.column(k) + v.rows, v.column(column));
    for (Index c = k + 1; c < v.columns; ++c) {
      const Value factor = v.column(c)[at] / v.column(k)[at];
      for (Index i = 0; i < v.rows; ++i) v.column(c)[i] -= factor * v.column(k)[i];
      v.column(c)[at] = 0;
    }
    rows.push_back(static_cast<Index>(at));
  }
  std::sort(rows.begin(), rows.end());
  return rows;
}

Columns<std::complex<double>> first_complex(const Block& q, Index columns) {
  const auto* values = base::as_complex(q.values.data());
  return {q.rows / 2, columns, {values, values + Offset{columns} * (q.rows / 2)}};
}

// Complex vectors that span what the real ones (twice as many, in the real space) span: the longest rest of them next.
Columns<std::complex<double>> complex_basis(const Block& q, Index columns) {
  using Value = std::complex<double>;
  Columns<Value> rest{q.rows / 2, q.columns, {}}, basis{q.rows / 2, columns, {}};
  rest.values.assign(base::as_complex(q.values.data()), base::as_complex(q.values.data()) + q.values.size() / 2);
  const auto dot = [&](const Value* x, const Value* y) {
    Value sum = 0;
    for (Index i = 0; i < rest.rows; ++i) sum += std::conj(x[i]) * y[i];
    return sum;
  };
  for (Index k = 0; k < columns; ++k) {
    Index next = 0;
    double most = -1;
    for (Index c = 0; c < rest.columns; ++c)
      if (const double length = std::real(dot(rest.column(c), rest.column(c))); length > most) {
        most = length;
        next = c;
      }
    std::vector<Value> chosen(rest.column(next), rest.column(next) + rest.rows);
    for (Value& v : chosen) v /= std::sqrt(most);
    basis.values.insert(basis.values.end(), chosen.begin(), chosen.end());
    for (Index c = 0; c < rest.columns; ++c) {
      const Value part = dot(chosen.data(), rest.column(c));
      for (Index i = 0; i < rest.rows; ++i) rest.column(c)[i] -= part * chosen[static_cast<std::size_t>(i)];
    }
  }
  return basis;
}

Columns<double> real_basis(const Block& q) { return {q.rows, q.columns, q.values}; }

// In the caller's units, the largest number 1 in magnitude.
template <class Value>
std::vector<double> callers_vectors(const ScaledMatrix& b, Columns<Value> q, bool transpose) {
  constexpr Index kParts = base::ScalarTraits<Value>::is_complex ? 2 : 1;
  for (Index c = 0; c < q.columns; ++c) {
    double most = 0;
    for (Index i = 0; i < q.rows; ++i) {
      q.column(c)[i] *= b.unscaled(kParts * i, 1, transpose);
      most = std::max(most, std::abs(q.column(c)[i]));
    }
    for (Index i = 0; i < q.rows && most > 0; ++i) q.column(c)[i] /= most;
  }
  const double* parts = reinterpret_cast<const double*>(q.values.data());
  return {parts, parts + q.values.size() * kParts};
}

template <class Value>
void describe_basis(const ScaledMatrix& b, Columns<Value> null, Columns<Value> left, Deficiency& found) {
  for (Value& v : left.values) v = base::conjugate(v);  // of A^H: the caller's are those of A^T
  if (found.by_pivots) {
    found.null_vectors = callers_vectors(b, std::move(null), false);
    found.left_vectors = callers_vectors(b, std::move(left), true);
    return;
  }
  found.null_vectors = callers_vectors(b, null, false);
  if (left.columns == 0) {
    found.rows = leading_rows(std::move(null));
    return;
  }
  found.left_vectors = callers_vectors(b, left, true);
  found.rows = leading_rows(std::move(left));
  found.columns = leading_rows(std::move(null));
}

}  // namespace

void describe(const ScaledMatrix& b, const Block& null, const Block& left, Deficiency& found) {
  if (b.parts() == 1) return describe_basis(b, real_basis(null), real_basis(left), found);
  // Random vectors are as independent over the complex numbers: so many of them are a basis.
  const auto basis = [&](const Block& q) {
    const Index columns = q.columns > 0 ? found.zeros : 0;
    return found.by_pivots ? first_complex(q, columns) : complex_basis(q, columns);
  };
  describe_basis(b, basis(null), basis(left), found);
}

void describe_all(const NullSpaceIteration& search, double work, Block null, Block left, Deficiency& found) {
  found.by_pivots = work > static_cast<double>(kMostVectorWork);
  const auto make_orthonormal = [&](Block& x, bool transpose) {
    (void)normalize(search.job().pool, x);
    if (found.by_pivots || x.columns == 0) return;
    orthonormalize(search.job().pool, x);
    if (!found.reduced) search.clean(x, transpose);
  };
  make_orthonormal(null, false);
  make_orthonormal(left, true);
  describe(search.matrix(), null, left, found);
}

}  // namespace espalier::solver
