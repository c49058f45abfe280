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

/// In the anonymous namespace of a part's source, where part::fill<T, kConjugate>(table) fills its entries: what is
/// exported of it.
#define ESPALIER_FILL_KERNELS(part)                                                                             \
  void part##_double(Kernels<double>& table, bool) { part::fill<double, false>(table); }                        \
  void part##_float(Kernels<float>& table, bool) { part::fill<float, false>(table); }                           \
  void part##_complex_double(Kernels<std::complex<double>>& table, bool hermitian) {                            \
    hermitian ? part::fill<std::complex<double>, true>(table) : part::fill<std::complex<double>, false>(table); \
  }                                                                                                             \
  void part##_complex_float(Kernels<std::complex<float>>& table, bool hermitian) {                              \
    hermitian ? part::fill<std::complex<float>, true>(table) : part::fill<std::complex<float>, false>(table);   \
  }

/// The end of a part's source, inside `#if HWY_ONCE`: fill_<part>, for the instruction set of this processor.
#define ESPALIER_KERNEL_PART(part)                                         \
  namespace espalier::device::host {                                       \
  HWY_EXPORT(part##_double);                                               \
  HWY_EXPORT(part##_float);                                                \
  HWY_EXPORT(part##_complex_double);                                       \
  HWY_EXPORT(part##_complex_float);                                        \
  template <>                                                              \
  void fill_##part(Kernels<double>& table, bool hermitian) {               \
    HWY_DYNAMIC_DISPATCH(part##_double)(table, hermitian);                 \
  }                                                                        \
  template <>                                                              \
  void fill_##part(Kernels<float>& table, bool hermitian) {                \
    HWY_DYNAMIC_DISPATCH(part##_float)(table, hermitian);                  \
  }                                                                        \
  template <>                                                              \
  void fill_##part(Kernels<std::complex<double>>& table, bool hermitian) { \
    HWY_DYNAMIC_DISPATCH(part##_complex_double)(table, hermitian);         \
  }                                                                        \
  template <>                                                              \
  void fill_##part(Kernels<std::complex<float>>& table, bool hermitian) {  \
    HWY_DYNAMIC_DISPATCH(part##_complex_float)(table, hermitian);          \
  }                                                                        \
  }  // namespace espalier::device::host
