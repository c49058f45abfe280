/// \file
/// How many values of the matrix a plan reads.
#pragma once

#include "base/thread_pool.hpp"
#include "plan/plan.hpp"

namespace espalier::device::cuda {

/// One more than the largest place of a value that the plan assembles. @param pool  null: on the calling thread
Offset values_of(const plan::Plan& plan, base::ThreadPool* pool);

}  // namespace espalier::device::cuda
