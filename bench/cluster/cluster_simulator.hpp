/// \file
/// A factorization on machines of GPUs in virtual time, block column by block column: who owns what is the plan's own
/// cut, machines first, then their GPUs; panels of the top cross NVLink and the network in queues.
///
/// Coarser than gpu/gpu_simulator.hpp, which takes single tiles of the CUDA tables (and needs the whole plan of them):
/// here a GPU works at the rate of its machine model, and what bounds it besides is what it waits for. So it takes the
/// tree alone, and 160^3 fits the memory of a small machine.
#pragma once

#include <vector>

#include "plan/plan.hpp"
#include "plan/plan_bytes.hpp"

namespace espalier::bench {

/// What machines are made of. Seconds and bytes per second; rates of H200s.
struct ClusterRates {
  plan::MachineModel gpu = plan::h200();
  /// Over plan::front_seconds(): fits elasticity 64^3 and 96^3 on 1, 2 and 4 H200s (docs/notebook/clusters.md).
  double speed = 1.09;
  Index per_machine = 8;
  /// Out of one GPU over NVLink: what 1 of 2 H200s stores into the other while both factorize.
  double nvlink = 3.95e11;
  /// Each way through the network interface that every GPU has: nine tenths of 400 Gb/s.
  double network = 4.5e10;
  /// A diagonal tile of 64 columns after the one before it: on one GPU, and what another GPU of the machine adds
  /// (measured: 50 and 72 microseconds, plan/machine_model.cpp).
  double diagonal = 5.0e-5, hop = 2.2e-5;
  /// What the network adds to that: assumed, nothing was measured. Host-driven messages.
  double network_hop = 4.0e-5;
  bool relay = false;  ///< panels go from machine to machine along a binary tree; else their maker sends to each
};

/// What bounds a run is the largest of work, chain and network.
struct ClusterRun {
  double seconds = 0;
  double busy = 0;           ///< mean part of the time in which a GPU works
  double work = 0;           ///< seconds of all work, spread evenly over all GPUs
  double chain = 0;          ///< seconds of the longest chain of diagonal tiles from a leaf to the root, on these GPUs
  double network = 0;        ///< seconds that the busiest interface sends or receives
  double network_bytes = 0;  ///< of all
  double factor_bytes = 0;   ///< largest of all GPUs, FP64: sub-trees, and all of the top above them
};

/// A plan without rows, entries, tasks and places in memory: the tree's sizes, layout and owners.
/// @param tree  of single vertices; `unknowns` of them stand for each
plan::Plan plan_of_tree(const analysis::AssemblyTree& tree, Index unknowns, const plan::PlanOptions& options);

/// @pre plan.options.devices are those of whole machines, or of a part of one
ClusterRun simulate(const plan::Plan& plan, const ClusterRates& rates);

/// Bytes of the factor that each device keeps, padding included: its sub-trees, and copies of all of the top above
/// them.
struct KeptFactor {
  double subtrees = 0, top = 0;
};
std::vector<KeptFactor> kept_factors(const plan::Plan& plan);

/// What the plan of each rank takes: make_plan()'s part for it, by counting alone. Places in memory are those of llt.
/// @param plan  of plan_of_tree(), with one device a rank
/// @param nodes, tree  the graph of single vertices in both triangles, with its diagonal, and its tree
std::vector<plan::PlanBytes> planned_bytes(const plan::Plan& plan, const MatrixView& nodes,
                                           const analysis::AssemblyTree& tree, Index unknowns);

/// The nodes of "elasticity n" (n x n x n bricks, one face held) as unknowns: what compression makes of it. Both
/// triangles, no values.
SparseMatrix brick_nodes(Index n);

}  // namespace espalier::bench
