// Texts of models. Private: espalier/_models/model.py gives them types and exceptions.
#include "espalier/model_text.hpp"

#include <nanobind/stl/map.h>
#include <nanobind/stl/string.h>
#include <nanobind/stl/vector.h>

#include "arrays.hpp"
#include "bindings.hpp"
#include "dynamics/mesh/text_file.hpp"
#include "dynamics/model/decks/take.hpp"
#include "dynamics/model/robots/robots.hpp"

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
  m.def(
      "robot_text",
      [](const std::string& path, const std::string& keyframe, bool free_base, bool geometry,
         const std::map<std::string, double>& positions, const std::map<std::string, double>& velocities,
         const std::map<std::string, std::string>& packages) {
        dynamics::model::robots::RobotOptions options;
        options.keyframe = keyframe;
        options.free_base = free_base;
        options.geometry = geometry;
        options.positions = positions;
        options.velocities = velocities;
        options.packages = packages;
        auto robot = dynamics::model::robots::robot_as_model(dynamics::read_whole_file(path), path, options);
        return nb::make_tuple(robot.text, robot.notices);
      },
      "path"_a, "keyframe"_a, "free_base"_a, "geometry"_a, "positions"_a, "velocities"_a, "packages"_a);
  m.def("model_as_json", &model_as_json, "text"_a, "name"_a);
  m.def("model_part_keys", [] {
    nb::list rows;
    for (const ModelPartKeys& row : model_part_keys()) rows.append(nb::make_tuple(row.section, row.type, row.keys));
    return rows;
  });
}

}  // namespace espalier::python
