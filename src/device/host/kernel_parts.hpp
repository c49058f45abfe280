/// \file
/// The parts that make up a table of kernels; each fills its entries for the instruction set chosen at run time.
#pragma once

#include "device/host/kernels.hpp"

/// Scalable vectors cannot stand in arrays; x86 before SSE4 and other processors take the scalar target.
#define HWY_DISABLED_TARGETS \
  (HWY_SSSE3 | HWY_SVE | HWY_SVE2 | HWY_SVE_256 | HWY_SVE2_128 | HWY_RVV | HWY_PPC8 | HWY_WASM | HWY_WASM_EMU256)

namespace espalier::device::host {

/// Each is defined for T = double and float.
template <class T>
void fill_products(Kernels<T>& table);
template <class T>
void fill_layout(Kernels<T>& table);
template <class T>
void fill_substitution(Kernels<T>& table);
template <class T>
void fill_cholesky(Kernels<T>& table);
template <class T>
void fill_ldlt(Kernels<T>& table);
template <class T>
void fill_lu(Kernels<T>& table);
template <class T>
void fill_inverse(Kernels<T>& table);

}  // namespace espalier::device::host

/// The end of a part's source, inside `#if HWY_ONCE`: `part`, defined by what fill_double and fill_float are for the
/// instruction set of this processor.
#define ESPALIER_KERNEL_PART(part)            \
  namespace espalier::device::host {          \
  HWY_EXPORT(fill_double);                    \
  HWY_EXPORT(fill_float);                     \
  template <>                                 \
  void part(Kernels<double>& table) {         \
    HWY_DYNAMIC_DISPATCH(fill_double)(table); \
  }                                           \
  template <>                                 \
  void part(Kernels<float>& table) {          \
    HWY_DYNAMIC_DISPATCH(fill_float)(table);  \
  }                                           \
  }  // namespace espalier::device::host
