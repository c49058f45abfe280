/// \file
/// Layout: pack, unpack, pack_transposed; and passes over panels: scale_columns, column_max.
#include "device/host/kernels/kernel_parts.hpp"

#undef HWY_TARGET_INCLUDE
#define HWY_TARGET_INCLUDE "device/host/kernels/layout.cpp"
#include "hwy/foreach_target.h"  // must precede highway.h
// clang-format off: the order matters
#include "device/host/kernels/micro_kernel-inl.hpp"
#include "device/host/kernels/transpose-inl.hpp"
// clang-format on
#include <limits>

HWY_BEFORE_NAMESPACE();
namespace espalier::device::host::HWY_NAMESPACE {
namespace {
namespace layout {

/// The lanes below `rows` of x (which may be negative), zero elsewhere.
template <class T>
HWY_INLINE Vector<T> first_lanes(Vector<T> x, std::int64_t rows) {
  return vn::IfThenElseZero(first_elements<T>(std::clamp<std::int64_t>(rows, 0, kLanes<T>)), x);
}

template <class T>
void pack(std::int64_t m, std::int64_t n, const T* c, std::int64_t ld, T* panels) {
  const Tag<T> t;
  constexpr std::int64_t p = kPanel<T>;
  for (std::int64_t i = 0; i < m; i += p, panels += p * n) {
    if (m - i >= p) {
      for (std::int64_t j = 0; j < n; ++j) {
        HWY_UNROLL(16)
        for (int v = 0; v < p; v += kLanes<T>) vn::StoreU(vn::LoadU(t, c + i + v + j * ld), t, panels + j * p + v);
      }
      continue;
    }
    for (std::int64_t j = 0; j < n; ++j) {
      for (int v = 0; v < p; v += kLanes<T>)
        vn::StoreU(first_lanes<T>(vn::LoadU(t, c + i + v + j * ld), m - i - v), t, panels + j * p + v);
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
      for (int v = 0; v < p; v += kLanes<T>) vn::StoreU(vn::LoadU(t, panels + j * p + v), t, c + i + v + j * ld);
    }
  }
}

/// Columns i .. i + kLanes of one panel of C^T, of which the lanes below `rows` are wanted; c points at C(i, j).
template <class T>
HWY_INLINE void load_transposed(const T* c, std::int64_t ld, std::int64_t rows, Vector<T>* v) {
  HWY_UNROLL(16)
  for (int j = 0; j < kLanes<T>; ++j) v[j] = vn::LoadU(Tag<T>(), c + j * ld);
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
          for (int l = 0; l < lanes; ++l) vn::StoreU(v[l], Tag<T>(), out + l * p);
        } else {
          for (int l = 0; l < columns; ++l) vn::StoreU(v[l], Tag<T>(), out + l * p);
        }
      }
    }
  }
}

template <class T, bool kConjugate>
void scale_columns(std::int64_t m, std::int64_t n, const T* b, const T* d1, const T* e, T* x) {
  const Tag<T> t;
  constexpr std::int64_t p = kPanel<T>;
  for (std::int64_t i = 0; i < m; i += p, b += p * n, x += p * n) {
    for (std::int64_t j = 0; j < n; ++j) {
      const Vector<T> d = vn::Set(t, d1[j]);
      if (j + 1 < n && e[j] != T(0)) {  // a 2x2 pivot
        const Vector<T> off = vn::Set(t, e[j]), next = vn::Set(t, d1[j + 1]);
        const Vector<T> above = vn::Set(t, conjugate<kConjugate>(e[j]));
        for (int v = 0; v < p; v += kLanes<T>) {
          const Vector<T> b0 = vn::LoadU(t, b + j * p + v), b1 = vn::LoadU(t, b + (j + 1) * p + v);
          vn::StoreU(vn::MulAdd(d, b0, vn::Mul(off, b1)), t, x + j * p + v);
          vn::StoreU(vn::MulAdd(above, b0, vn::Mul(next, b1)), t, x + (j + 1) * p + v);
        }
        ++j;
      } else {
        for (int v = 0; v < p; v += kLanes<T>) vn::StoreU(vn::Mul(d, vn::LoadU(t, b + j * p + v)), t, x + j * p + v);
      }
    }
  }
}

/// NaN and infinity are never lost: they leave a NaN in the products with zero.
template <class T>
void column_max(std::int64_t m, std::int64_t n, const T* x, Real<T>* out) {
  const RealTag<T> tag;
  const RealVector<T> zero = vn::Zero(tag);
  constexpr std::int64_t p = kPanel<T>;
  constexpr int group = 8;
  for (std::int64_t j = 0; j < n; j += group) {
    const int columns = static_cast<int>(std::min<std::int64_t>(group, n - j));
    RealVector<T> top[group], poison[group];
    for (int l = 0; l < group; ++l) top[l] = poison[l] = zero;
    for (std::int64_t i = 0; i < m; i += p) {
      const T* column = x + i * n + j * p;
      for (int l = 0; l < columns; ++l) {
        for (int v = 0; v < p; v += kLanes<T>) {
          const RealVector<T> size = magnitude_of<T>(vn::LoadU(Tag<T>(), column + l * p + v));
          top[l] = vn::Max(top[l], size);
          poison[l] = vn::MulAdd(size, zero, poison[l]);
        }
      }
    }
    for (int l = 0; l < columns; ++l) {
      const bool finite = vn::GetLane(vn::SumOfLanes(tag, poison[l])) == Real<T>(0);
      const Real<T> most = vn::GetLane(vn::MaxOfLanes(tag, top[l]));
      out[j + l] = finite ? std::max(out[j + l], most) : std::numeric_limits<Real<T>>::infinity();
    }
  }
}

template <class T, bool kConjugate>
void fill(Kernels<T>& table) {
  table.pack = pack<T>;
  table.unpack = unpack<T>;
  table.pack_transposed = pack_transposed<T>;
  table.scale_columns = scale_columns<T, kConjugate>;
  table.column_max = column_max<T>;
}
}  // namespace layout
ESPALIER_FILL_KERNELS(layout)

}  // namespace
}  // namespace espalier::device::host::HWY_NAMESPACE
HWY_AFTER_NAMESPACE();

#if HWY_ONCE
ESPALIER_KERNEL_PART(layout)
#endif
