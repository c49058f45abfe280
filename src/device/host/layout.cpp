/// \file
/// Layout: pack, unpack, pack_transposed; and passes over panels: scale_columns, column_max.
#include "device/host/kernel_parts.hpp"

#undef HWY_TARGET_INCLUDE
#define HWY_TARGET_INCLUDE "device/host/layout.cpp"
#include "hwy/foreach_target.h"  // must precede highway.h
// clang-format off: the order matters
#include "device/host/micro_kernel-inl.hpp"
#include "device/host/transpose-inl.hpp"
// clang-format on
#include <limits>

HWY_BEFORE_NAMESPACE();
namespace espalier::device::host::HWY_NAMESPACE {
namespace {

/// The lanes below `rows` of x (which may be negative), zero elsewhere.
template <class T>
HWY_INLINE Vector<T> first_lanes(Vector<T> x, std::int64_t rows) {
  const std::int64_t lanes = std::clamp<std::int64_t>(rows, 0, kLanes<T>);
  return hn::IfThenElseZero(hn::FirstN(Tag<T>(), static_cast<std::size_t>(lanes)), x);
}

template <class T>
void pack(std::int64_t m, std::int64_t n, const T* c, std::int64_t ld, T* panels) {
  const Tag<T> t;
  constexpr std::int64_t p = kPanel<T>;
  for (std::int64_t i = 0; i < m; i += p, panels += p * n) {
    if (m - i >= p) {
      for (std::int64_t j = 0; j < n; ++j) {
        HWY_UNROLL(16)
        for (int v = 0; v < p; v += kLanes<T>) hn::StoreU(hn::LoadU(t, c + i + v + j * ld), t, panels + j * p + v);
      }
      continue;
    }
    for (std::int64_t j = 0; j < n; ++j) {
      for (int v = 0; v < p; v += kLanes<T>)
        hn::StoreU(first_lanes<T>(hn::LoadU(t, c + i + v + j * ld), m - i - v), t, panels + j * p + v);
    }
  }
}

template <class T>
void unpack(std::int64_t m, std::int64_t n, const T* panels, T* c, std::int64_t ld) {
  const Tag<T> t;
  constexpr std::int64_t p = kPanel<T>;
  for (std::int64_t i = 0; i < m; i += p, panels += p * n) {
    for (std::int64_t j = 0; j < n; ++j) {
      HWY_UNROLL(16)
      for (int v = 0; v < p; v += kLanes<T>) hn::StoreU(hn::LoadU(t, panels + j * p + v), t, c + i + v + j * ld);
    }
  }
}

/// Columns i .. i + kLanes of one panel of C^T, of which the lanes below `rows` are wanted; c points at C(i, j).
template <class T>
HWY_INLINE void load_transposed(const T* c, std::int64_t ld, std::int64_t rows, Vector<T>* v) {
  HWY_UNROLL(16)
  for (int j = 0; j < kLanes<T>; ++j) v[j] = hn::LoadU(Tag<T>(), c + j * ld);
  transpose<T>(v);
  if (rows < kLanes<T>) {
    HWY_UNROLL(16)
    for (int i = 0; i < kLanes<T>; ++i) v[i] = first_lanes<T>(v[i], rows);
  }
}

template <class T>
void pack_transposed(std::int64_t m, std::int64_t n, const T* c, std::int64_t ld, T* panels) {
  constexpr std::int64_t p = kPanel<T>;
  constexpr int lanes = kLanes<T>;
  for (std::int64_t j = 0; j < n; j += p, panels += p * m) {
    for (std::int64_t i = 0; i < m; i += lanes) {
      const int columns = static_cast<int>(std::min<std::int64_t>(lanes, m - i));
      for (int part = 0; part < p; part += lanes) {
        Vector<T> v[lanes];
        load_transposed<T>(c + i + (j + part) * ld, ld, n - j - part, v);
        T* out = panels + i * p + part;
        if (columns == lanes) {
          HWY_UNROLL(16)
          for (int l = 0; l < lanes; ++l) hn::StoreU(v[l], Tag<T>(), out + l * p);
        } else {
          for (int l = 0; l < columns; ++l) hn::StoreU(v[l], Tag<T>(), out + l * p);
        }
      }
    }
  }
}

template <class T>
void scale_columns(std::int64_t m, std::int64_t n, const T* b, const T* d1, const T* e, T* x) {
  const Tag<T> t;
  constexpr std::int64_t p = kPanel<T>;
  for (std::int64_t i = 0; i < m; i += p, b += p * n, x += p * n) {
    for (std::int64_t j = 0; j < n; ++j) {
      const Vector<T> d = hn::Set(t, d1[j]);
      if (j + 1 < n && e[j] != T(0)) {  // a 2x2 pivot
        const Vector<T> off = hn::Set(t, e[j]), next = hn::Set(t, d1[j + 1]);
        for (int v = 0; v < p; v += kLanes<T>) {
          const Vector<T> b0 = hn::LoadU(t, b + j * p + v), b1 = hn::LoadU(t, b + (j + 1) * p + v);
          hn::StoreU(hn::MulAdd(d, b0, hn::Mul(off, b1)), t, x + j * p + v);
          hn::StoreU(hn::MulAdd(off, b0, hn::Mul(next, b1)), t, x + (j + 1) * p + v);
        }
        ++j;
      } else {
        for (int v = 0; v < p; v += kLanes<T>) hn::StoreU(hn::Mul(d, hn::LoadU(t, b + j * p + v)), t, x + j * p + v);
      }
    }
  }
}

/// Magnitudes compare as integers, in which order NaN stands above infinity and is thus never lost.
template <class T>
void column_max(std::int64_t m, std::int64_t n, const T* x, T* out) {
  const Tag<T> t;
  const hn::RebindToSigned<Tag<T>> ti;
  constexpr std::int64_t p = kPanel<T>;
  constexpr int group = 8;
  for (std::int64_t j = 0; j < n; j += group) {
    const int columns = static_cast<int>(std::min<std::int64_t>(group, n - j));
    hn::Vec<hn::RebindToSigned<Tag<T>>> top[group];
    for (int l = 0; l < group; ++l) top[l] = hn::Zero(ti);
    for (std::int64_t i = 0; i < m; i += p) {
      const T* column = x + i * n + j * p;
      for (int l = 0; l < columns; ++l) {
        for (int v = 0; v < p; v += kLanes<T>)
          top[l] = hn::Max(top[l], hn::BitCast(ti, hn::Abs(hn::LoadU(t, column + l * p + v))));
      }
    }
    for (int l = 0; l < columns; ++l) {
      alignas(64) T lanes[kLanes<T>];
      hn::StoreU(hn::BitCast(t, top[l]), t, lanes);
      T largest = out[j + l];
      for (const T value : lanes) {
        if (!(value <= largest))
          largest = value <= std::numeric_limits<T>::max() ? value : std::numeric_limits<T>::infinity();
      }
      out[j + l] = largest;
    }
  }
}

template <class T>
void fill(Kernels<T>& table) {
  table.pack = pack<T>;
  table.unpack = unpack<T>;
  table.pack_transposed = pack_transposed<T>;
  table.scale_columns = scale_columns<T>;
  table.column_max = column_max<T>;
}
void fill_double(Kernels<double>& table) { fill(table); }
void fill_float(Kernels<float>& table) { fill(table); }

}  // namespace
}  // namespace espalier::device::host::HWY_NAMESPACE
HWY_AFTER_NAMESPACE();

#if HWY_ONCE
ESPALIER_KERNEL_PART(fill_layout)
#endif
