// Values as they go into a factorization.
#include <algorithm>
#include <atomic>
#include <cmath>
#include <complex>
#include <limits>

#include "base/scalar.hpp"
#include "solver/analysis/prepared_matrix.hpp"

namespace espalier::solver {

namespace {

// a s r by its exponents: no product on the way overflows or vanishes.
double wide_product(double a, double s, double r) {
  int of_a = 0, of_s = 0, of_r = 0;
  const double mantissa = std::frexp(a, &of_a) * std::frexp(s, &of_s) * std::frexp(r, &of_r);
  return std::ldexp(mantissa, of_a + of_s + of_r);
}

// FP64: the squares of such entries are numbers still. FP32: the entries are, and so are pivots that count.
template <class T>
bool fits(double largest) {
  constexpr double kFar = base::keeps_fp64<T> ? 0x1p480 : 0x1p100;
  return largest == 0 || (largest < kFar && largest > 1 / kFar);
}

// What stands at (row, column) of the matrix that is eliminated: of a Hermitian one the conjugate where the order turns
// the entry around.
template <class T>
T scaled_entry(const double* value, double s, double r, bool wide, bool turn) {
  const auto product = [&](double v) { return wide ? wide_product(v, s, r) : v * s * r; };
  if constexpr (base::ScalarTraits<T>::is_complex) {
    using Real = base::RealOf<T>;
    return {static_cast<Real>(product(value[0])), static_cast<Real>(product(turn ? -value[1] : value[1]))};
  } else {
    return static_cast<T>(product(value[0]));
  }
}
template <class T>
double size_of(T x) {
  if constexpr (base::ScalarTraits<T>::is_complex) {
    const auto re = static_cast<double>(std::abs(x.real())), im = static_cast<double>(std::abs(x.imag()));
    const bool finite = std::isfinite(re) && std::isfinite(im);  // max() would lose NaN
    return finite ? std::max(re, im) : std::numeric_limits<double>::infinity();
  } else {
    return std::abs(static_cast<double>(x));
  }
}

// Scales entries and looks at them.
template <class T>
class EntryScaling {
 public:
  EntryScaling(const PreparedMatrix& p, const Scales& scales, std::span<const double> values,
               std::span<const Index> position)
      : p_(p),
        scales_(scales),
        values_(values),
        position_(position),
        turns_(p.numbers == base::Numbers::hermitian && !position.empty()) {}

  // Entry q, of column c.
  T scaled(Offset q, std::size_t c) {
    constexpr std::size_t kParts = base::ScalarTraits<T>::is_complex ? 2 : 1;
    const bool hermitian = p_.numbers == base::Numbers::hermitian;
    const auto at = static_cast<std::size_t>(q), row = static_cast<std::size_t>(p_.a.row_ind[at]);
    const double s = scales_.col.empty() ? 1.0 : scales_.col[c], r = scales_.row.empty() ? 1.0 : scales_.row[row];
    const double* value = &values_[kParts * at];
    const T made = scaled_entry<T>(value, s, r, scales_.wide, turns_ && position_[row] < position_[c]);
    const double magnitude = size_of(made);
    most_ = std::max(most_, magnitude);
    fine_ = fine_ && magnitude <= std::numeric_limits<double>::max();
    if constexpr (kParts == 2) fine_ = fine_ && !(hermitian && row == c && value[1] != 0);
    return made;
  }
  // The largest of what it has seen; infinite where an entry is not finite.
  [[nodiscard]] double largest() const { return fine_ ? most_ : std::numeric_limits<double>::infinity(); }

 private:
  const PreparedMatrix& p_;
  const Scales& scales_;
  std::span<const double> values_;
  std::span<const Index> position_;
  bool turns_;  // entries of the upper triangle in that order
  double most_ = 0;
  bool fine_ = true;
};

void raise(std::atomic<double>& largest, double most) {
  double known = largest.load();
  while (most > known && !largest.compare_exchange_weak(known, most)) {
  }
}

}  // namespace

template <class T>
void expect_in_range(const PreparedMatrix& p, std::span<const double> values, double largest) {
  if (!fits<T>(largest)) refuse_entry(p, values);
}

template <class T>
double scale_values(const PreparedMatrix& p, const Scales& scales, std::span<const double> values, T* scaled,
                    base::ThreadPool& pool, std::span<const Index> position) {
  constexpr std::int64_t kColumnsPerRange = 4096;
  std::atomic<double> largest{0};
  pool.for_each_range(p.n(), kColumnsPerRange, [&](std::int64_t begin, std::int64_t end) {
    EntryScaling<T> entry(p, scales, values, position);
    for (auto c = static_cast<std::size_t>(begin); c < static_cast<std::size_t>(end); ++c)
      for (Offset q = p.a.col_ptr[c]; q < p.a.col_ptr[c + 1]; ++q)
        scaled[static_cast<std::size_t>(q)] = entry.scaled(q, c);
    raise(largest, entry.largest());
  });
  expect_in_range<T>(p, values, largest);
  return largest;
}

template <class T>
double scale_values(const PreparedMatrix& p, const Scales& scales, std::span<const double> values,
                    std::span<const Offset> entries, T* scaled, base::ThreadPool& pool,
                    std::span<const Index> position) {
  constexpr std::int64_t kEntriesPerRange = 1 << 15;
  std::atomic<double> largest{0};
  pool.for_each_range(
      static_cast<std::int64_t>(entries.size()), kEntriesPerRange, [&](std::int64_t begin, std::int64_t end) {
        EntryScaling<T> entry(p, scales, values, position);
        const auto& ptr = p.a.col_ptr;
        auto c = static_cast<std::size_t>(
            std::upper_bound(ptr.begin(), ptr.end(), entries[static_cast<std::size_t>(begin)]) - ptr.begin() - 1);
        for (auto k = static_cast<std::size_t>(begin); k < static_cast<std::size_t>(end); ++k) {
          while (ptr[c + 1] <= entries[k]) ++c;
          scaled[k] = entry.scaled(entries[k], c);
        }
        raise(largest, entry.largest());
      });
  return largest;
}

#define ESPALIER_INSTANTIATE(T)                                                                                        \
  template void expect_in_range<T>(const PreparedMatrix&, std::span<const double>, double);                            \
  template double scale_values(const PreparedMatrix&, const Scales&, std::span<const double>, T*, base::ThreadPool&,   \
                               std::span<const Index>);                                                                \
  template double scale_values(const PreparedMatrix&, const Scales&, std::span<const double>, std::span<const Offset>, \
                               T*, base::ThreadPool&, std::span<const Index>);
ESPALIER_FOR_SCALARS(ESPALIER_INSTANTIATE)
#undef ESPALIER_INSTANTIATE

}  // namespace espalier::solver
