/// \file
/// Places in a host's code, by the return addresses of its calls.
#pragma once

#include <set>

#include "common/handles.hpp"

namespace espalier::hosts {

/// Where a host analyses matrices for the sake of the factors' entries, which we do not hand out: from the second time
/// on the real library serves such a place at once, or each matrix would be factorized twice.
class CallSites {
 public:
  bool has(const void* site) const {
    const std::lock_guard lock(table_lock());
    return sites_.contains(site);
  }
  void add(const void* site) {
    const std::lock_guard lock(table_lock());
    sites_.insert(site);
  }

 private:
  std::set<const void*> sites_;
};

}  // namespace espalier::hosts
