/// \file
/// What bodies need of the machine's memory, known before any of it is taken.
#pragma once

#include "dynamics/model/description.hpp"

namespace espalier::dynamics::model {

/// Memory for the meshes and matrices of bodies that are meshed here; the factor comes on top of it.
class MemoryDemand {
 public:
  /// @throws Error(out_of_memory) that names the body where this one and those before need more than the machine has
  void add(const BodySpec& body);

 private:
  double bytes_ = 0;
};

}  // namespace espalier::dynamics::model
