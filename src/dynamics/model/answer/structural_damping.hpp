/// \file
/// Structural damping of bodies, K_b (1 + i loss_factor), where equations are linearised.
#pragma once

#include <vector>

#include "dynamics/model/mechanism.hpp"
#include "espalier/matrix.hpp"

namespace espalier::dynamics::model {

/// While it lives, bodies are without the viscous damping that stands for structural damping in motions.
class StructuralDamping {
 public:
  explicit StructuralDamping(Mechanism& mechanism);
  ~StructuralDamping();
  StructuralDamping(const StructuralDamping&) = delete;
  StructuralDamping& operator=(const StructuralDamping&) = delete;

  [[nodiscard]] bool any() const { return !bodies_.empty(); }
  /// H = sum loss_factor_b K_b at a state of rest, in the pattern of W.
  [[nodiscard]] SparseMatrix matrix(const State& state) const;

 private:
  Mechanism& mechanism_;
  std::vector<BuiltBody*> bodies_;
  std::vector<RayleighDamping> before_;
};

}  // namespace espalier::dynamics::model
