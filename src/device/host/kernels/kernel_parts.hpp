/// \file
/// The parts that make up a table of kernels; each fills its entries for the instruction set chosen at run time.
#pragma once

#include "base/vector_targets.hpp"  // before Highway
#include "device/host/kernels/kernels.hpp"

namespace espalier::device::host {

/// Each is defined for the scalars of kernels(). @param hermitian  see there
template <class T>
void fill_products(Kernels<T>& table, bool hermitian);
template <class T>
void fill_layout(Kernels<T>& table, bool hermitian);
template <class T>
void fill_substitution(Kernels<T>& table, bool hermitian);
template <class T>
void fill_cholesky(Kernels<T>& table, bool hermitian);
template <class T>
void fill_ldlt(Kernels<T>& table, bool hermitian);
template <class T>
void fill_lu(Kernels<T>& table, bool hermitian);
template <class T>
void fill_inverse(Kernels<T>& table, bool hermitian);

}  // namespace espalier::device::host

/// In the anonymous namespace of a part's source, where fill<T, kConjugate>(table) fills its entries: what is exported
/// of it.
#define ESPALIER_FILL_KERNELS                                                                       \
  void fill_double(Kernels<double>& table, bool) { fill<double, false>(table); }                    \
  void fill_float(Kernels<float>& table, bool) { fill<float, false>(table); }                       \
  void fill_complex_double(Kernels<std::complex<double>>& table, bool hermitian) {                  \
    hermitian ? fill<std::complex<double>, true>(table) : fill<std::complex<double>, false>(table); \
  }                                                                                                 \
  void fill_complex_float(Kernels<std::complex<float>>& table, bool hermitian) {                    \
    hermitian ? fill<std::complex<float>, true>(table) : fill<std::complex<float>, false>(table);   \
  }

/// The end of a part's source, inside `#if HWY_ONCE`: `part`, for the instruction set of this processor.
#define ESPALIER_KERNEL_PART(part)                                  \
  namespace espalier::device::host {                                \
  HWY_EXPORT(fill_double);                                          \
  HWY_EXPORT(fill_float);                                           \
  HWY_EXPORT(fill_complex_double);                                  \
  HWY_EXPORT(fill_complex_float);                                   \
  template <>                                                       \
  void part(Kernels<double>& table, bool hermitian) {               \
    HWY_DYNAMIC_DISPATCH(fill_double)(table, hermitian);            \
  }                                                                 \
  template <>                                                       \
  void part(Kernels<float>& table, bool hermitian) {                \
    HWY_DYNAMIC_DISPATCH(fill_float)(table, hermitian);             \
  }                                                                 \
  template <>                                                       \
  void part(Kernels<std::complex<double>>& table, bool hermitian) { \
    HWY_DYNAMIC_DISPATCH(fill_complex_double)(table, hermitian);    \
  }                                                                 \
  template <>                                                       \
  void part(Kernels<std::complex<float>>& table, bool hermitian) {  \
    HWY_DYNAMIC_DISPATCH(fill_complex_float)(table, hermitian);     \
  }                                                                 \
  }  // namespace espalier::device::host
