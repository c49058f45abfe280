/// \file
/// Plans in which unknowns stand in pairs: those of the real form of a complex system, before pivots are moved.
#pragma once

#include "plan/plan.hpp"

namespace espalier::device::cuda {

/// Whether columns 2k and 2k + 1 stand next to each other in this order, in one front, and in the same rows of all
/// others: what kernels want that make one column of a pair from the other one (kernels/half_products.cuh).
bool stands_in_pairs(const plan::Plan& plan);

}  // namespace espalier::device::cuda
