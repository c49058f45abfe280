// Texts of models. Private: espalier/_model.py gives them types and exceptions.
#include "espalier/model_text.hpp"

#include <nanobind/stl/string.h>
#include <nanobind/stl/vector.h>

#include "arrays.hpp"
#include "bindings.hpp"
#include "dynamics/model/decks/take.hpp"

namespace espalier::python {

using namespace nb::literals;

void bind_model_text(nb::module_& m) {
  m.def(
      "check_model",
      [](const std::string& text, const std::string& name, const std::vector<std::string>& set) {
        return status_of(check_model_text(text, name, set));
      },
      "text"_a, "name"_a, "set"_a);
  m.def(
      "check_model_part",
      [](const std::string& section, const std::string& name, const std::string& text, const std::string& file) {
        return status_of(check_model_part(section, name, text, file));
      },
      "section"_a, "name"_a, "text"_a, "file"_a);
  m.def("read_text", &dynamics::model::read_model_text, "path"_a);
  m.def("model_as_json", &model_as_json, "text"_a, "name"_a);
  m.def("model_part_keys", [] {
    nb::list rows;
    for (const ModelPartKeys& row : model_part_keys()) rows.append(nb::make_tuple(row.section, row.type, row.keys));
    return rows;
  });
}

}  // namespace espalier::python
