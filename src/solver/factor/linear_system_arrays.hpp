/// \file
/// What a device is given of a linear system that it keeps beside the factor.
#pragma once

#include <span>

#include "base/thread_pool.hpp"
#include "device/device_linear_system.hpp"
#include "solver/analysis/analysis.hpp"

namespace espalier::solver {

/// Views: all arguments outlive the arrays. @pre system.rows
/// @param order  position -> unknown
/// @param diagonal  llt: by position, the place of the diagonal entry; else empty
/// @param epsilon  of the factor's scalar
/// @param values  of the factorizations to come
device::LinearSystemArrays arrays_of(const System& system, std::span<const Index> order,
                                     std::span<const Offset> diagonal, double epsilon, std::span<const double> values,
                                     base::ThreadPool& pool);

}  // namespace espalier::solver
