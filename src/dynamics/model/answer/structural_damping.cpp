#include "dynamics/model/answer/structural_damping.hpp"

#include <algorithm>

namespace espalier::dynamics::model {
namespace {

RayleighDamping replaced_damping(BuiltBody& body, const RayleighDamping& by) {
  RayleighDamping before;
  if (body.reduced != nullptr) {
    before = body.reduced->damping();
    body.reduced->set_damping(by);
  } else {
    before = body.flexible->damping();
    body.flexible->set_damping(by);
  }
  return before;
}

}  // namespace

StructuralDamping::StructuralDamping(Mechanism& mechanism) : mechanism_(mechanism) {
  for (BuiltBody& body : mechanism.bodies) {
    if (body.spec.loss_factor == 0) continue;
    bodies_.push_back(&body);
    before_.push_back(replaced_damping(body, body.spec.damping));
  }
}

StructuralDamping::~StructuralDamping() {
  for (std::size_t k = 0; k < bodies_.size(); ++k) replaced_damping(*bodies_[k], before_[k]);
}

// Viscous damping of the stiffness by a factor of loss_factor is that matrix.
SparseMatrix StructuralDamping::matrix(const State& state) const {
  const SparsePattern& p = mechanism_.system.tangent_pattern();
  SparseMatrix h;
  h.rows = h.cols = p.cols;
  h.col_ptr = p.ptr;
  h.row_ind = p.ind;
  h.values.resize(at(p.nonzeros()));
  State rest = state;
  std::fill(rest.v.begin(), rest.v.end(), 0.0);
  std::fill(rest.a.begin(), rest.a.end(), 0.0);
  for (BuiltBody* body : bodies_) {
    const RayleighDamping own = replaced_damping(*body, {0, body->spec.loss_factor});
    Component& component = body->reduced != nullptr ? static_cast<Component&>(*body->reduced) : *body->flexible;
    component.tangent(rest.view(), {0, 1, 0}, h.values);
    replaced_damping(*body, own);
  }
  return h;
}

}  // namespace espalier::dynamics::model
