/// \file
/// The border between exceptions inside and statuses outside.
#pragma once

#include <functional>
#include <string_view>

#include "base/interruption.hpp"
#include "espalier/types.hpp"

namespace espalier::solver {

/// Runs body() and turns its failure into a value. Meanwhile the caller may interrupt.
/// @param remedy  what the caller can do where the machine refuses memory
Status status_of(base::Interruption& interruption, std::string_view remedy, const std::function<void()>& body);

}  // namespace espalier::solver
