/// \file
/// A mark of what all ranks that share a plan must have come to alike.
#pragma once

#include <cstdint>

#include "plan/plan.hpp"

namespace espalier::plan {

/// A fingerprint of the tree, who makes what, and the order in which each does it.
/// @param kind      of the factorization
/// @param maker_of  (front, tile column): who makes it
template <class MakerOf>
std::int64_t fingerprint(const Plan& plan, int kind, MakerOf&& maker_of) {
  std::uint64_t h = 14695981039346656037ULL;
  const auto add = [&h](std::uint64_t x) { h = (h ^ x) * 1099511628211ULL; };
  add(static_cast<std::uint64_t>(kind));
  for (const Index v : plan.tree.order) add(static_cast<std::uint64_t>(v));
  for (const Index v : plan.tree.first) add(static_cast<std::uint64_t>(v));
  for (const FrontLayout& l : plan.layout) {
    add(static_cast<std::uint64_t>(l.rows));
    add(static_cast<std::uint64_t>(l.pivot_width) << 32 | static_cast<std::uint64_t>(l.below_width));
  }
  for (Index f = 0; f < plan.fronts(); ++f)
    for (Index j = 0; j < plan.layout[at(f)].tiles; ++j) add(static_cast<std::uint64_t>(maker_of(f, j)));
  add(static_cast<std::uint64_t>(plan.options.interleave));
  return static_cast<std::int64_t>(h);
}

}  // namespace espalier::plan
