#include "dynamics/model/mechanism.hpp"

#include <fmt/format.h>

#include <algorithm>

namespace espalier::dynamics::model {

Mechanism::Mechanism(int threads) : pool(threads > 0 ? threads : base::available_cores()) { system.set_pool(&pool); }

const BuiltBody* Mechanism::body(const std::string& name) const {
  for (const BuiltBody& b : bodies)
    if (b.spec.name == name) return &b;
  return nullptr;
}

Joint* Mechanism::joint(const std::string& name) const {
  for (Joint* j : joints)
    if (j->name() == name) return j;
  return nullptr;
}

FacePressure* Mechanism::pressure(const std::string& name) const {
  for (FacePressure* p : pressures)
    if (p->name() == name) return p;
  return nullptr;
}

const BuiltContact* Mechanism::surface_contact(const std::string& name) const {
  for (const BuiltContact& c : surface_contacts)
    if (c.name == name) return &c;
  return nullptr;
}

const BuiltForce* Mechanism::force(const std::string& name) const {
  for (const BuiltForce& f : forces)
    if (f.force->name() == name) return &f;
  return nullptr;
}

const Support* Mechanism::support(const std::string& name) const {
  for (const Support* s : supports)
    if (s->name() == name) return s;
  return nullptr;
}

void Mechanism::load_functions_of_state(double factor) {
  const auto depends = [](const StateFunctionPtr& f) { return !f->coordinates().empty() || !f->multipliers().empty(); };
  for (const BuiltForce& f : forces)
    if (const auto& inputs = f.force->inputs().functions(); std::any_of(inputs.begin(), inputs.end(), depends))
      f.force->set_load_factor(factor);
  for (FacePressure* p : pressures)
    if (depends(p->function())) p->set_load_factor(factor);
}

std::string Mechanism::inverted_elements() const {
  std::string text;
  for (const BuiltBody& b : bodies)
    if (b.flexible != nullptr && b.flexible->inverted_element() >= 0)
      text += fmt::format("; element {} of '{}' has turned inside out", b.flexible->inverted_element(), b.spec.name);
  return text;
}

}  // namespace espalier::dynamics::model
