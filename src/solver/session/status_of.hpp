/// \file
/// The border between exceptions inside and statuses outside.
#pragma once

#include <functional>
#include <string_view>

#include "base/interruption.hpp"
#include "espalier/types.hpp"

namespace espalier::solver {

Status status_of_function(base::Interruption& interruption, std::string_view remedy, const std::function<void()>& body);

/// Runs body() and turns its failure into a value. Meanwhile the caller may interrupt.
/// @param remedy  what the caller can do where the machine refuses memory
template <class Body>
Status status_of(base::Interruption& interruption, std::string_view remedy, Body&& body) {
  return status_of_function(interruption, remedy, std::ref(body));  // a copy would take memory, outside of everything
}

}  // namespace espalier::solver
