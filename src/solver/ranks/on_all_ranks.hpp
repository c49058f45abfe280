/// \file
/// Calls that all ranks make.
#pragma once

#include <functional>

#include "espalier/types.hpp"
#include "ranks/communicator.hpp"

namespace espalier::solver {

/// @returns how the call has ended, the same on all ranks. What `body` throws here is thrown on, when the others have
///          heard of it
Status on_all_ranks(ranks::Communicator& link, const std::function<Status()>& body);

}  // namespace espalier::solver
