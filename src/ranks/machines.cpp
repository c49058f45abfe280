#include "ranks/machines.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <span>

namespace espalier::ranks {

Machines Machines::agreed(Communicator& link) {
  std::vector<int> mine;
  for (int r = 0; r < link.size(); ++r) mine.push_back(link.machine_of(r));
  const auto all = link.all_gather_of(std::span<const int>(mine));
  for (std::size_t r = 0; r < all.size(); ++r)
    if (all[r] != all[0])
      throw Error(StatusCode::invalid_input,
                  fmt::format("{} and {} do not agree on which ranks are one machine: give all ranks the same --nodes, "
                              "or call set_nodes() with the same on all",
                              link.name_of(0), link.name_of(static_cast<int>(r))));
  return Machines(std::move(mine));
}

bool Machines::is_one() const {
  return std::all_of(machine_.begin(), machine_.end(), [&](int m) { return m == machine_.front(); });
}

std::uint32_t Machines::apart_from(int rank) const {
  std::uint32_t bits = 0;
  for (int r = 0; r < first_ranks(); ++r)
    if (!are_near(r, rank)) bits |= 1U << r;
  return bits;
}

std::uint32_t Machines::near_to(int rank) const {
  std::uint32_t bits = 0;
  for (int r = 0; r < first_ranks(); ++r)
    if (are_near(r, rank)) bits |= 1U << r;
  return bits;
}

}  // namespace espalier::ranks
