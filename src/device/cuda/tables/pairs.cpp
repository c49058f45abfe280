#include "device/cuda/tables/pairs.hpp"

#include <algorithm>

namespace espalier::device::cuda {

bool stands_in_pairs(const plan::Plan& plan) {
  const analysis::AssemblyTree& t = plan.tree;
  const auto even = [](auto x) { return x % 2 == 0; };
  const auto in_pairs = [&](const auto& list) {
    if (!even(list.size())) return false;
    for (std::size_t k = 0; k < list.size(); k += 2)
      if (!even(list[k]) || list[k + 1] != list[k] + 1) return false;
    return true;
  };
  return t.border == 0 && in_pairs(t.order) && in_pairs(t.rows) && std::all_of(t.first.begin(), t.first.end(), even) &&
         std::all_of(t.row_ptr.begin(), t.row_ptr.end(), even);
}

}  // namespace espalier::device::cuda
