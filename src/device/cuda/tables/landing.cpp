#include "device/cuda/tables/landing.hpp"

#include <bit>

namespace espalier::device::cuda {

namespace {

// One of the bits; none if there is none.
int chosen(std::uint32_t bits, std::size_t key) {
  if (bits == 0) return -1;
  for (std::size_t left = key % static_cast<std::size_t>(std::popcount(bits)); left > 0; --left) bits &= bits - 1;
  return std::countr_zero(bits);
}

}  // namespace

std::vector<int> ranks_of(unsigned bits) {
  std::vector<int> list;
  for (; bits != 0; bits &= bits - 1) list.push_back(std::countr_zero(bits));
  return list;
}

Landing::Landing(const ranks::Machines& machines, int rank)
    : rank_(rank), near_(machines.near_to(rank)), apart_(machines.apart_from(rank)) {
  for (std::uint32_t left = apart_; left != 0; left &= ~others_.back())
    others_.push_back(machines.near_to(std::countr_zero(left)));
}

std::vector<int> Landing::elsewhere(std::uint32_t receivers, std::size_t key) const {
  std::vector<int> list;
  for (const std::uint32_t machine : others_)
    if ((receivers & machine) != 0) list.push_back(chosen(receivers & machine, key));
  return list;
}

int Landing::here(std::uint32_t receivers, std::size_t key) const { return chosen(receivers & near_, key); }

void Arrivals::add(const Landing& landing, int self, std::uint32_t receivers, std::size_t key) {
  const int lands = landing.here(receivers, key);
  if (lands == self) {
    ++missing;
    for_others |= receivers & landing.beside();
  } else if (lands >= 0 && (receivers >> self & 1) != 0) {
    from_others |= 1U << lands;
  }
}

}  // namespace espalier::device::cuda
