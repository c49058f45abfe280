#include "dynamics/model/run/controls.hpp"

#include <algorithm>

namespace espalier::dynamics::model {

double* Controls::input(const std::string& name) {
  for (auto& [known, value] : inputs)
    if (known == name) return &value;
  return nullptr;
}

bool Controls::set(const std::string& name, bool on) {
  for (Switch& s : switches)
    if (s.name == name) return std::exchange(s.on, on) != on;
  return false;
}

void Controls::apply() {
  for (const Switch& s : switches) {
    for (FrameForce* force : s.forces) force->set_active(s.on);
    if (s.pressure != nullptr) s.pressure->set_active(s.on);
    if (s.cable != nullptr) s.cable->set_active(s.on);
    for (contact::Contact* c : s.contacts) c->set_active(s.on);
  }
}

std::vector<char> Controls::absent_rows(std::size_t m) const {
  std::vector<char> rows(m, 0);
  for (const Switch& s : switches)
    if (s.joint != nullptr && !s.on)
      std::fill_n(rows.begin() + s.joint->placement().c, s.joint->sizes().constraints, char{1});
  return rows;
}

void Controls::save(std::vector<double>& out) const {
  for (const auto& [name, value] : inputs) out.push_back(value);
  for (const Switch& s : switches) out.push_back(s.on ? 1 : 0);
  for (const Event& e : events) out.insert(out.end(), {e.held ? 1.0 : 0.0, e.spent ? 1.0 : 0.0});
  out.push_back(static_cast<double>(dropped.size()));
  out.insert(out.end(), dropped.begin(), dropped.end());
}

void Controls::restore(ConstSpan& in) {
  const auto need = [&in](std::size_t count) {
    if (in.size() < count) throw Error(StatusCode::invalid_input, "the restart file ends too early");
  };
  need(inputs.size() + switches.size() + 2 * events.size() + 1);
  const auto take = [&in] {
    const double value = in.front();
    in = in.subspan(1);
    return value;
  };
  for (auto& [name, value] : inputs) value = take();
  for (Switch& s : switches) s.on = take() != 0;
  for (Event& e : events) {
    e.held = take() != 0;
    e.spent = take() != 0;
  }
  const double marks = take();
  if (!(marks >= 0 && marks <= static_cast<double>(in.size())))
    throw Error(StatusCode::invalid_input, "the restart file is damaged");
  dropped.resize(static_cast<std::size_t>(marks));
  for (char& mark : dropped) mark = take() != 0 ? 1 : 0;
  apply();
}

}  // namespace espalier::dynamics::model
