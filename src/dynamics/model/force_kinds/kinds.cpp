#include <stdexcept>

#include "dynamics/model/force_kinds/kind.hpp"

namespace espalier::dynamics::model {

const ForceKind& force_kind(ForceType type) {
  for (const ForceKind* row : kForceKinds)
    if (row->type == type) return *row;
  throw std::logic_error("a type of force has no row");
}

}  // namespace espalier::dynamics::model
