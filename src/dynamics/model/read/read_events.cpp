// The sections [inputs], [sensors] and [events].
#include <fmt/format.h>

#include <algorithm>
#include <cctype>

#include "dynamics/model/description.hpp"
#include "dynamics/model/units/unit_system.hpp"

namespace espalier::dynamics::model {
namespace {

void check_name(const std::string& name, const Place& place) {
  const auto allowed = [](char c) { return std::isalnum(static_cast<unsigned char>(c)) != 0 || c == '_'; };
  if (name.empty() || !std::all_of(name.begin(), name.end(), allowed))
    fail(place, fmt::format("the name '{}' may have letters, digits and _ only", name));
}

/// Calls `each` with every key of a section of plain values.
template <class Each>
void plain_values(Section& root, const char* key, const Each& each) {
  const Value* table = root.value(key);
  if (table == nullptr) return;
  if (!table->is_table()) fail(table->place, fmt::format("must be a section [{}] of names and values", key));
  Section s(*table);
  for (const auto& [name, value] : table->entries) {
    check_name(name, value.place);
    each(s, name, value);
  }
}

/// "a > b" and the like as a number that is not negative where the condition holds.
Formula read_condition(Section& s) {
  const std::string text = s.text("when");
  const Place& place = s.place("when");
  bool quoted = false;
  std::vector<std::size_t> signs;
  for (std::size_t k = 0; k < text.size(); ++k) {
    if (text[k] == '\'') quoted = !quoted;
    if (!quoted && (text[k] == '<' || text[k] == '>')) signs.push_back(k);
  }
  if (signs.size() != 1)
    fail(place,
         "must be one comparison: two expressions with < or > between them; of several conditions take min(..) > "
         "0 where all, max(..) > 0 where any of them shall hold");
  const std::size_t at = signs.front();
  const std::size_t next = at + (at + 1 < text.size() && text[at + 1] == '=' ? 2 : 1);
  const std::string left = text.substr(0, at), right = text.substr(next);
  const auto blank = [](const std::string& side) { return side.find_first_not_of(" \t") == std::string::npos; };
  if (blank(left) || blank(right)) fail(place, "an expression is missing beside < or >");
  Value difference = *s.value("when");
  difference.text = text[at] == '>' ? fmt::format("({}) - ({})", left, right) : fmt::format("({}) - ({})", right, left);
  return {place, Section::state_function(difference)};
}

EventSpec read_event(const std::string& name, const Value& value, const Description& model) {
  Section s(value);
  EventSpec e;
  e.place = value.place;
  e.name = name;
  if (s.has("contact")) {
    e.contact = s.text("contact");
    e.opens = s.choice("when", {"closes", "opens"}) == 1;
  } else {
    e.condition = read_condition(s);
  }
  e.stop = s.flag("stop", false);
  e.once = s.flag("once", false);
  e.on = s.texts("on");
  e.off = s.texts("off");
  e.tolerance = s.positive("tolerance", 0);
  e.position_tolerance = s.positive("position_tolerance", in_units(model.units, e.position_tolerance, "m"));
  if (const Value* table = s.value("set")) {
    if (!table->is_table()) fail(table->place, "must be a table { input = value }");
    for (const auto& [input, formula] : table->entries) {
      std::vector<std::string> names;
      for (const auto& known : model.inputs) names.push_back(known.first);
      if (std::find(names.begin(), names.end(), input) == names.end())
        fail(formula.place, fmt::format("unknown input '{}'{}", input, suggestion(input, names)));
      e.set.emplace_back(input, Formula{formula.place, Section::state_function(formula)});
    }
  }
  s.finish();
  return e;
}

/// Joints, forces and contacts that an event watches or switches must be there.
void check_switched(const EventSpec& event, const Description& model) {
  std::vector<std::string> contacts;
  for (const ContactSpec& contact : model.contacts) contacts.push_back(contact.name);
  if (!event.contact.empty() && std::find(contacts.begin(), contacts.end(), event.contact) == contacts.end())
    fail(event.place,
         fmt::format("there is no contact '{}' in [contacts]{}", event.contact, suggestion(event.contact, contacts)));
  std::vector<std::string> names;
  for (const JointSpec& joint : model.joints) names.push_back(joint.name);
  for (const ForceSpec& force : model.forces) names.push_back(force.name);
  for (const ContactSpec& contact : model.contacts) names.push_back(contact.name);
  for (const auto* list : {&event.on, &event.off})
    for (const std::string& name : *list) {
      if (std::find(names.begin(), names.end(), name) == names.end())
        fail(event.place,
             fmt::format("there is no joint, force or contact '{}' to be switched{}", name, suggestion(name, names)));
      if (list == &event.on && std::find(event.off.begin(), event.off.end(), name) != event.off.end())
        fail(event.place, fmt::format("switches '{}' on and off at once", name));
    }
}

}  // namespace

void read_events(Section& root, Description& model) {
  plain_values(root, "inputs", [&](Section& s, const std::string& name, const Value&) {
    model.inputs.emplace_back(name, s.number(name));
  });
  plain_values(root, "sensors", [&](Section&, const std::string& name, const Value& value) {
    model.sensors.emplace_back(name, Formula{value.place, Section::state_function(value)});
  });
  root.named("events", [&](const std::string& name, const Value& value) {
    model.events.push_back(read_event(name, value, model));
    check_switched(model.events.back(), model);
  });
}

}  // namespace espalier::dynamics::model
