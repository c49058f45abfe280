// The public entry of checks of a model's text: failures become a status.
#include <algorithm>
#include <cmath>
#include <filesystem>

#include "dynamics/guarded.hpp"
#include "dynamics/mesh/text_file.hpp"
#include "dynamics/model/check/part_keys.hpp"
#include "dynamics/model/description.hpp"
#include "dynamics/model/read/expand.hpp"
#include "dynamics/page/json_text.hpp"
#include "espalier/model_text.hpp"

namespace espalier {
namespace {

using dynamics::guarded;
using dynamics::model::Description;
using dynamics::model::Section;
using dynamics::model::Value;

/// Nobody has written the text that a part comes in.
void forget_lines(Value& value) {
  value.place.line = 0;
  for (Value& item : value.items) forget_lines(item);
  for (auto& [key, entry] : value.entries) forget_lines(entry);
}

std::vector<std::string> words_of(const Value* list) {
  std::vector<std::string> out;
  if (list != nullptr && list->type == Value::Type::text) out.push_back(list->text);
  for (std::size_t k = 0; list != nullptr && k < list->items.size(); ++k) out.push_back(list->items[k].text);
  return out;
}

/// What a part names, as if it were there.
void take_as_there(const Value& part, Value& root, Description& model) {
  if (const Value* material = part.find("material"); material != nullptr && material->type == Value::Type::text)
    root.entries.emplace_back("materials", dynamics::model::parse_toml("x = { young = 1 }", ""))
        .second.entries.front()
        .first = material->text;
  for (const char* key : {"on", "off", "contact"})
    for (const std::string& name : words_of(part.find(key))) model.contacts.emplace_back().name = name;
  if (const Value* set = part.find("set"); set != nullptr)
    for (const auto& [input, value] : set->entries) model.inputs.emplace_back(input, 0.0);
}

void read_parts(const Value& root_value, Description& model) {
  Section root(root_value);
  read_bodies(root, model);
  root.named("markers", [](const std::string& name, const Value& value) { (void)read_marker(value, name); });
  read_splines(root, model);
  read_joints(root, model);
  read_forces(root, model);
  read_supports(root, model);
  read_surfaces(root, model);
  read_events(root, model);
  read_controllers(root, model);
}

/// A name in an expression that may be a parameter of the model to come: one that is not near to one that is there.
bool may_come(const std::string& message, const Value& root) {
  const std::size_t at = message.find("unknown name '");
  if (at == std::string::npos || message.find("without a unit") != std::string::npos) return false;
  const Value* parameters = root.find("parameters");
  for (std::size_t k = 0; parameters != nullptr && k < parameters->entries.size(); ++k)
    if (message.find("did you mean '" + parameters->entries[k].first + "'", at) != std::string::npos) return false;
  return true;
}

/// Names of bodies, markers and surfaces that other parts have must be there. A run looks for them, too, when it
/// assembles the bodies.
class References {
 public:
  explicit References(const Description& model) : model_(model) {
    for (const auto& body : model.bodies) bodies_.push_back(body.name);
    bodies_.emplace_back("ground");
    markers_ = bodies_;
    for (const auto& [name, marker] : model.markers) markers_.push_back(name);
    for (const auto& surface : model.surfaces) surfaces_.push_back(surface.name);
  }
  void check() const {
    for (const auto& [name, marker] : model_.markers) check_marker(marker);
    for (const auto& joint : model_.joints)
      for (const auto& frame : joint.frames) check_marker(frame);
    for (const auto& force : model_.forces) {
      for (const auto& frame : force.frames) check_marker(frame);
      if (!force.body.empty()) expect(force.body, bodies_, "body", force.place);
    }
    for (const auto& support : model_.supports) expect(support.where.body, bodies_, "body", support.place);
    for (const auto& surface : model_.surfaces) expect(surface.body, bodies_, "body", surface.place);
    for (const auto& contact : model_.contacts)
      for (const auto* list : {&contact.surfaces, &contact.against})
        for (const std::string& name : *list) expect(name, surfaces_, "surface", contact.place);
  }

 private:
  void check_marker(const dynamics::model::MarkerSpec& marker) const {
    if (marker.reference.empty())
      expect(marker.body, bodies_, "body", marker.place);
    else if (marker.reference.find('.') == std::string::npos)  // of a part that has markers of its own
      expect(marker.reference, markers_, "marker", marker.place);
  }
  /// Patterns, with a star, are looked up by the run.
  static void expect(const std::string& name, const std::vector<std::string>& known, const char* what,
                     const dynamics::model::Place& place) {
    if (name.find('*') == std::string::npos && std::find(known.begin(), known.end(), name) == known.end())
      fail(place, std::string("unknown ") + what + " '" + name + "'" + dynamics::model::suggestion(name, known));
  }

  const Description& model_;
  std::vector<std::string> bodies_, markers_, surfaces_;
};

std::string json(const Value& value) {
  using dynamics::page::json_text;
  std::vector<std::string> parts;
  switch (value.type) {
    case Value::Type::boolean:
      return value.boolean ? "true" : "false";
    case Value::Type::integer:
      return std::to_string(value.integer);
    case Value::Type::text:
      return json_text(value.text);
    case Value::Type::real: {
      if (std::isnan(value.real)) return "NaN";
      if (std::isinf(value.real)) return value.real > 0 ? "Infinity" : "-Infinity";
      const std::string digits = dynamics::page::json_number(value.real);
      return digits.find_first_of(".e") == std::string::npos ? digits + ".0" : digits;
    }
    case Value::Type::array:
      for (const Value& item : value.items) parts.push_back(json(item));
      return dynamics::page::json_list(parts);
    case Value::Type::table:
      break;
  }
  dynamics::page::JsonObject object;
  for (const auto& [key, entry] : value.entries) object.raw(key, json(entry));
  return object.done();
}

}  // namespace

Status check_model_text(const std::string& text, const std::string& name, const std::vector<std::string>& set) {
  return guarded([&] {
    Value root = dynamics::model::parse_toml(text, name);
    dynamics::model::expand(root, set);
    if (root.find("integrator") == nullptr && root.find("statics") == nullptr && root.find("harmonic") == nullptr)
      root.entries.emplace_back("statics", Value{});
    const Description model = dynamics::model::read_description(root, name);
    References(model).check();
  });
}

Status check_model(const std::string& path, const std::vector<std::string>& set) {
  std::string text;
  const Status status = guarded([&] { text = dynamics::read_whole_file(path); });
  return status.ok() ? check_model_text(text, path, set) : status;
}

Status check_model_part(const std::string& section, const std::string& name, const std::string& text,
                        const std::string& file) {
  Value given;
  const Status status = guarded([&] {
    Value root = given = dynamics::model::parse_toml(text, "");
    forget_lines(root);
    dynamics::model::expand(root, {});
    Description model;
    model.file = file;
    model.folder = std::filesystem::path(file).parent_path().string();
    model.statics.emplace().options.path =
        dynamics::StaticPath::linear;  // whether a density is needed is the model's matter
    Value* parts = root.find(section);
    Value* part = parts == nullptr ? nullptr : parts->find(name);
    if (part == nullptr) throw std::logic_error("check_model_part: the text has no such part");
    take_as_there(Value(*part), root, model);
    read_parts(root, model);
  });
  return !status.ok() && may_come(status.message, given) ? Status{} : status;
}

std::string model_as_json(const std::string& text, const std::string& name) {
  return json(dynamics::model::parse_toml(text, name));
}

std::vector<ModelPartKeys> model_part_keys() {
  std::vector<ModelPartKeys> out;
  for (const dynamics::model::PartKeys& row : dynamics::model::all_part_keys()) {
    ModelPartKeys& keys = out.emplace_back(ModelPartKeys{std::string(row.section), std::string(row.type), {}});
    for (std::string_view rest = row.keys; !rest.empty();) {
      const std::size_t end = std::min(rest.find(' '), rest.size());
      keys.keys.emplace_back(rest.substr(0, end));
      rest.remove_prefix(std::min(end + 1, rest.size()));
    }
  }
  return out;
}

}  // namespace espalier
