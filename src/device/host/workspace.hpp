/// \file
/// How large the workers' own memory has to be for a plan, and which workers a device has.
#pragma once

#include "device/host/numeric_state.hpp"

namespace espalier::device::host {

/// Elements of a worker's largest tile (or whole front), and its widest block of columns.
struct Extent {
  Offset area = 0;
  Offset widest = 0;
};

template <class T>
Extent largest_tile(const plan::Plan& plan);

/// Teams are neighbouring threads: device d has the workers team_begin(d) .. team_begin(d + 1) - 1.
int team_begin(Index device, Index devices, int threads);

}  // namespace espalier::device::host
