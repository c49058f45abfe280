// What of a system goes to a GPU, and what the rest of it has to do with that.
#include <algorithm>

#include "base/parallel.hpp"
#include "dynamics/dae/assembled_system.hpp"

namespace espalier::dynamics {

bool AssembledSystem::fits_device(std::size_t component) const {
  const OnDevice* const c = on_device_[component];
  return c != nullptr && c->fits_device();
}

double AssembledSystem::host_share() const {
  Offset host = 0;
  bool any = false;
  for (std::size_t k = 0; k < components_.size(); ++k)
    if (fits_device(k))
      any = true;
    else
      host += declared_[k];
  return any ? static_cast<double>(host) / static_cast<double>(w_pattern_.nonzeros()) : 1.0;
}

bool AssembledSystem::use_device(DeviceAssembly& device, std::span<const Offset> k_ptr) {
  // Faces whose joints couple all their nodes: what they add to W goes over the link for each factorization, where a W
  // of the host would go as a whole. An engine has 0.1 to 0.75, a chain of many joints 0.84 to 0.97. Beyond that the
  // bodies have so few elements that waiting for the GPU takes longer.
  constexpr double kMostOfHost = 0.98;
  if (host_share() > kMostOfHost) return false;
  PatternBuilder of_host(sizes_.velocity, sizes_.velocity, true);
  PatternBuilder unused(sizes_.constraints, sizes_.velocity, false);
  for (std::size_t k = 0; k < components_.size(); ++k) {
    if (fits_device(k)) {
      on_device_[k]->use_device(device, k_ptr);
      continue;
    }
    const auto& c = components_[k];
    c->declare(of_host, unused);
    // The diagonal stands in W without being declared: masses.
    for (Index i = 0; i < c->sizes().velocity; ++i) of_host.add(c->placement().v + i, c->placement().v + i);
  }
  const SparsePattern entries = of_host.build(pool_);
  host_entries_.resize(entries.ind.size());
  constexpr std::int64_t kColumns = 256;
  base::for_each_range(pool_, entries.cols, kColumns, [&](std::int64_t begin, std::int64_t end) {
    for (auto j = static_cast<std::size_t>(begin); j < static_cast<std::size_t>(end); ++j) {
      Offset p = w_pattern_.ptr[j];  // both columns ascend
      for (Offset e = entries.ptr[j]; e < entries.ptr[j + 1]; ++e, ++p) {
        while (w_pattern_.ind[static_cast<std::size_t>(p)] != entries.ind[static_cast<std::size_t>(e)]) ++p;
        host_entries_[static_cast<std::size_t>(e)] = p;
      }
    }
  });
  divide_coordinates(entries);
  return true;
}

// Where the host has a large part of the coordinates, or looks at surfaces as a whole, vectors stay with it.
void AssembledSystem::divide_coordinates(const SparsePattern& w_of_host) {
  constexpr Index kFewer = 8;  // coordinates of the host than of bodies
  share_.reset();
  DeviceShare share;
  std::vector<char> mark(static_cast<std::size_t>(sizes_.velocity), 0);  // 1: of the host, 2: seen
  if (!changing_.empty()) return;                                        // reads more than it declares
  for (std::size_t k = 0; k < components_.size(); ++k) {
    const Component& c = *components_[k];
    const Sizes own = c.sizes();
    const Placement at = c.placement();
    if (own.velocity == 0) continue;
    if (!fits_device(k)) {
      share.owners.emplace_back(c);
      std::fill_n(mark.begin() + at.v, own.velocity, char{1});
    } else if (!share.ranges.empty() && share.ranges.back().v + share.ranges.back().count == at.v &&
               share.ranges.back().q + share.ranges.back().count == at.q) {
      share.ranges.back().count += own.velocity;
    } else {
      share.ranges.push_back({at.q, at.v, own.velocity});
    }
  }
  const auto mark_seen = [&](Index coordinate) {
    char& m = mark[static_cast<std::size_t>(coordinate)];
    if (m == 0) m = 2;
  };
  for (Index j = 0; j < w_of_host.cols; ++j)
    for (Offset p = w_of_host.ptr[static_cast<std::size_t>(j)]; p < w_of_host.ptr[static_cast<std::size_t>(j) + 1];
         ++p) {
      mark_seen(j);
      mark_seen(w_of_host.ind[static_cast<std::size_t>(p)]);
    }
  for (const auto* pattern : {&phi_q_pattern_, &f_lambda_pattern_})
    for (const Index coordinate : pattern->ind) mark_seen(coordinate);
  for (std::size_t j = 0; j < mark.size(); ++j)
    if (mark[j] == 1) share.own.push_back(static_cast<Index>(j));
  for (const DeviceShare::Range& r : share.ranges)
    for (Index k = 0; k < r.count; ++k)
      if (mark[static_cast<std::size_t>(r.v + k)] == 2) {
        share.seen.push_back(r.v + k);
        share.seen_q.push_back(r.q + k);
      }
  if (kFewer * static_cast<Index>(share.own.size()) <= sizes_.velocity) share_ = std::move(share);
}

void AssembledSystem::leave_device() {
  host_entries_.clear();
  share_.reset();
  for (OnDevice* const c : on_device_)
    if (c != nullptr) c->leave_device();
}

}  // namespace espalier::dynamics
