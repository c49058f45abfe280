// The section [controllers].
#include <fmt/format.h>

#include <algorithm>
#include <filesystem>

#include "dynamics/model/description.hpp"

namespace espalier::dynamics::model {
namespace {

/// Calls `each` with the names and values of a table inside of a controller.
template <class Each>
void of_table(const Value* table, const char* words, const Each& each) {
  if (table == nullptr) return;
  if (!table->is_table()) fail(table->place, fmt::format("must be a table {}", words));
  for (const auto& [name, value] : table->entries) each(name, value);
}

void check_output(const std::string& name, const std::vector<std::pair<std::string, std::string>>& outputs,
                  const Place& place) {
  const auto allowed = [](unsigned char c) { return std::isalnum(c) != 0 || c == '_'; };
  if (name.empty() || !std::all_of(name.begin(), name.end(), allowed))
    fail(place, fmt::format("the name '{}' of an output may have letters, digits and _ only; outputs = {{ name = "
                            "\"its name in the FMU\" }} gives another one",
                            name));
  if (std::any_of(outputs.begin(), outputs.end(), [&](const auto& known) { return known.first == name; }))
    fail(place, fmt::format("the output '{}' is there twice", name));
}

ControllerSpec read_controller(const std::string& name, const Value& value, const std::string& folder) {
  Section s(value);
  ControllerSpec c;
  c.place = value.place;
  c.name = name;
  (void)s.choice("type", {"fmu"});
  c.path = (std::filesystem::path(folder) / s.text("file")).string();
  c.step = s.positive("step");
  of_table(s.value("inputs"), "{ variable of the FMU = expression }",
           [&](const std::string& variable, const Value& formula) {
             c.inputs.emplace_back(variable, Formula{formula.place, Section::state_function(formula)});
           });
  if (const Value* outputs = s.value("outputs"); outputs == nullptr) {
    c.all_outputs = true;
  } else if (outputs->is_table()) {
    for (const auto& [own, variable] : outputs->entries) {
      check_output(own, c.outputs, variable.place);
      if (variable.type != Value::Type::text) fail(variable.place, "must be the name of a variable of the FMU, a text");
      c.outputs.emplace_back(own, variable.text);
    }
  } else {
    for (const std::string& variable : s.texts("outputs")) {
      check_output(variable, c.outputs, s.place("outputs"));
      c.outputs.emplace_back(variable, variable);
    }
  }
  of_table(s.value("start"), "{ variable of the FMU = value }", [&](const std::string& variable, const Value& given) {
    if (given.type == Value::Type::boolean)
      c.start.emplace_back(variable, given.boolean ? 1.0 : 0.0);
    else if (given.type == Value::Type::text)
      c.start.emplace_back(variable, given.text);
    else
      c.start.emplace_back(variable, Section::plain_number(given));
  });
  s.finish();
  return c;
}

}  // namespace

void read_controllers(Section& root, Description& model) {
  root.named("controllers", [&](const std::string& name, const Value& value) {
    model.controllers.push_back(read_controller(name, value, model.folder));
  });
}

}  // namespace espalier::dynamics::model
