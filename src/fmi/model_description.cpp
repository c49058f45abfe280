#include "fmi/model_description.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <charconv>
#include <pugixml.hpp>
#include <set>

#include "espalier/types.hpp"

namespace espalier::fmi {
namespace {

using Type = ForeignVariable::Type;

[[noreturn]] void refuse(const std::string& fmu, const std::string& what) {
  throw Error(StatusCode::invalid_input, fmt::format("{}: {}", fmu, what));
}

Type type_of(std::string_view name) {
  static constexpr std::array<std::pair<std::string_view, Type>, 17> kNames = {{{"Real", Type::real},
                                                                                {"Float64", Type::real},
                                                                                {"Float32", Type::float32},
                                                                                {"Int8", Type::int8},
                                                                                {"UInt8", Type::uint8},
                                                                                {"Int16", Type::int16},
                                                                                {"UInt16", Type::uint16},
                                                                                {"Integer", Type::int32},
                                                                                {"Int32", Type::int32},
                                                                                {"UInt32", Type::uint32},
                                                                                {"Int64", Type::int64},
                                                                                {"UInt64", Type::uint64},
                                                                                {"Boolean", Type::boolean},
                                                                                {"String", Type::text},
                                                                                {"Binary", Type::other},
                                                                                {"Clock", Type::other},
                                                                                {"Enumeration", Type::other}}};
  for (const auto& [known, type] : kNames)
    if (known == name) return type;
  return Type::other;
}

ForeignVariable read_variable(const pugi::xml_node& node, int version, const std::string& fmu) {
  ForeignVariable v;
  v.name = node.attribute("name").as_string();
  const pugi::xml_attribute reference = node.attribute("valueReference");
  if (v.name.empty() || reference.empty()) refuse(fmu, "modelDescription.xml has a variable without name or reference");
  const std::string_view digits = reference.value();
  const auto [end, error] = std::from_chars(digits.data(), digits.data() + digits.size(), v.reference);
  if (error != std::errc() || end != digits.data() + digits.size())
    refuse(fmu, fmt::format("modelDescription.xml: the reference of '{}' is no number of 32 bits: {}", v.name,
                            std::string(digits.substr(0, 40))));
  v.causality = node.attribute("causality").as_string("local");
  pugi::xml_node typed = node;
  if (version == 2) {
    typed = {};
    for (const pugi::xml_node child : node.children())
      if (const std::string_view name = child.name(); name != "Annotations") typed = child;
  }
  v.type = type_of(typed.name());
  if (std::string_view(typed.name()) == "Enumeration") v.type = version == 2 ? Type::int32 : Type::int64;
  v.array = !node.child("Dimension").empty();
  return v;
}

}  // namespace

const ForeignVariable* ModelDescription::find(std::string_view name) const {
  const auto it = std::find_if(variables.begin(), variables.end(), [&](const auto& v) { return v.name == name; });
  return it == variables.end() ? nullptr : &*it;
}

ModelDescription read_description(const std::string& xml, const std::string& fmu) {
  pugi::xml_document document;
  const pugi::xml_parse_result parsed = document.load_buffer(xml.data(), xml.size());
  if (!parsed) refuse(fmu, fmt::format("modelDescription.xml is damaged: {}", parsed.description()));
  const pugi::xml_node root = document.child("fmiModelDescription");
  if (root.empty()) refuse(fmu, "modelDescription.xml describes no FMU");
  const std::string version = root.attribute("fmiVersion").as_string();
  ModelDescription d;
  d.version = version.starts_with("2.") ? 2 : version.starts_with("3.") ? 3 : 0;
  if (d.version == 0)
    refuse(fmu, fmt::format("it is of FMI {}; FMUs of FMI 2 and 3 are read", version.empty() ? "no version" : version));
  d.token = root.attribute(d.version == 2 ? "guid" : "instantiationToken").as_string();
  const pugi::xml_node steps = root.child("CoSimulation");
  if (steps.empty())
    refuse(fmu, fmt::format("it is for {} alone; an FMU for co-simulation is needed, which brings its own integrator",
                            root.child("ModelExchange").empty() ? "scheduled execution" : "model exchange"));
  d.identifier = steps.attribute("modelIdentifier").as_string();
  if (d.identifier.empty() || d.identifier.find('/') != std::string::npos)
    refuse(fmu, "modelDescription.xml names no binary (modelIdentifier)");
  const char* serializes = d.version == 2 ? "canSerializeFMUstate" : "canSerializeFMUState";
  const char* has = d.version == 2 ? "canGetAndSetFMUstate" : "canGetAndSetFMUState";
  d.serializes_state = steps.attribute(serializes).as_bool() && steps.attribute(has).as_bool();
  std::set<std::string> names;
  for (const pugi::xml_node node : root.child("ModelVariables").children()) {
    if (node.type() != pugi::node_element) continue;
    d.variables.push_back(read_variable(node, d.version, fmu));
    if (const std::string& name = d.variables.back().name; !names.insert(name).second)
      refuse(fmu, fmt::format("modelDescription.xml has two variables '{}'", name));
  }
  return d;
}

}  // namespace espalier::fmi
