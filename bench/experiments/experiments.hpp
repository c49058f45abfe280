/// \file
/// The experiments of `espalier bench`, one function each. All share one engine (bench.hpp): rivals and settings of our
/// own are contestants alike, each in its own process, every answer judged by the same residual.
#pragma once

#include <string>
#include <vector>

#include "experiments/bench.hpp"

namespace espalier::bench {

/// One experiment.
struct Experiment {
  const char* name;
  const char* description;  ///< one line
  const char* points;       ///< what --points means here; empty: the experiment sweeps nothing
  void (*run)(Bench&);
};

/// All of them, in the order of the help.
const std::vector<Experiment>& experiments();

/// Solvers side by side.
void run_peers(Bench& bench);
/// Time against the widest block (the paper's experiment).
void run_block_size(Bench& bench);
/// Time against the memory budget of a device, from above the need down.
void run_memory(Bench& bench);
/// Time and idle fraction against the number of devices, with timelines.
void run_scaling(Bench& bench);
/// What each idea of how tiles are dealt to devices brings.
void run_ablation(Bench& bench);
/// One Newton step (refactorization and solve) from 1,000 unknowns up.
void run_refactor(Bench& bench);
/// Time and memory against n, with fitted exponents.
void run_growth(Bench& bench);
/// The limits of this machine.
void run_ceilings(Bench& bench);
/// What the benchmark itself adds to what it times.
void run_overhead(Bench& bench);

}  // namespace espalier::bench
