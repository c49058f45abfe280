#include "matrix/generators/random.hpp"

#include <numeric>
#include <utility>

#include "base/at.hpp"

namespace espalier::matrix {

std::vector<Index> random_permutation(Index n, std::uint64_t seed) {
  std::vector<Index> order(at(n));
  std::iota(order.begin(), order.end(), 0);
  for (std::size_t k = order.size(); k > 1; --k) std::swap(order[k - 1], order[random_below(seed, k, k)]);
  return order;
}

}  // namespace espalier::matrix
