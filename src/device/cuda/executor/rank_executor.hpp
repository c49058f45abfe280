/// \file
/// The CUDA backend in one of several processes that share a plan: a rank, with one GPU.
#pragma once

#include <memory>

#include "device/backend.hpp"

namespace espalier::device::cuda {

/// Carries out the part of this rank's GPU (Job::devices, by rank) of a plan that is made for as many devices as there
/// are ranks, and whole on each. Kernels, flags and bits are those of one process with all these GPUs. The memory of
/// others of a machine is opened by CUDA IPC; what goes between machines goes by messages (tile_exchange.hpp). Two
/// ranks may have the same GPU, which then takes them in turns: for tests.
///
/// All calls are collective, with the same arguments on every rank. Every rank gets the same outcome, and solve() the
/// whole solution.
///
/// @throws Error on all ranks when one of them lacks memory, fails, is lost, does not reach another's memory, or has
///         come to another plan
template <class T>
std::unique_ptr<Executor<T>> make_rank_executor(const Job& job);

}  // namespace espalier::device::cuda
