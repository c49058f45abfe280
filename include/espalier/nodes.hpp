/// \file
/// What ranks take for one machine.
#pragma once

#include "espalier/ranks.hpp"

namespace espalier {

/// Ranks of one machine reach the memory of each other's GPUs; between machines, what kernels make goes by messages.
enum class Nodes {
  host,    ///< ranks on a host are one machine
  process  ///< each rank is a machine of its own: to try that on one host, or where GPUs do not reach each other
};

/// `host` unless this is called. A factor on GPUs keeps the machines that there were when its solver factorized first.
/// All ranks must say the same: a difference ends the first factorization on GPUs in invalid_input.
void set_nodes(const Ranks& ranks, Nodes nodes);

}  // namespace espalier
