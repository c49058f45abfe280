/// \file
/// Products of a GPU's tiles with vectors, on the host: a chunk of 16 columns stands in panels of eight rows.
#pragma once

#include "espalier/types.hpp"

namespace espalier::device::cuda {

/// A panel holds 8 rows of 16 columns; a row's columns stand in two groups of eight, each in this order.
inline constexpr int kPanelOrder[8] = {0, 4, 1, 5, 2, 6, 3, 7};

/// Columns 0 .. 15 of x in panel order: out[c * 16 + k].
template <class T>
void order_chunk(const T* x, Index columns, T* out) {
  for (Index c = 0; c < columns; ++c)
    for (int h = 0; h < 2; ++h)
      for (int k = 0; k < 8; ++k) out[c * 16 + h * 8 + k] = x[(h * 8 + kPanelOrder[k]) * columns + c];
}

/// v -= A x of `panels` panels one below another, in each of `chunks` chunks that are `stride` apart; x as
/// order_chunk() leaves it.
void panels_forward(const double* a, Offset stride, Index chunks, Index panels, const double* x, Index columns,
                    double* v);
void panels_forward(const float* a, Offset stride, Index chunks, Index panels, const float* x, Index columns, float* v);
/// sum (16 columns, panel order) += A^T v of `panels` panels one below another.
void panels_backward(const double* a, Index panels, const double* v, Index columns, double* sum);
void panels_backward(const float* a, Index panels, const float* v, Index columns, float* sum);

/// Adds a sum in panel order to 16 rows of v, times sign.
template <class T>
void put_chunk(const T* sum, Index columns, T sign, T* v) {
  for (Index c = 0; c < columns; ++c)
    for (int h = 0; h < 2; ++h)
      for (int k = 0; k < 8; ++k) v[(h * 8 + kPanelOrder[k]) * columns + c] += sign * sum[c * 16 + h * 8 + k];
}

}  // namespace espalier::device::cuda
