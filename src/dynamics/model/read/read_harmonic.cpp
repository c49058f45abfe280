// The section [harmonic].
#include <fmt/format.h>

#include <algorithm>
#include <cctype>
#include <numbers>

#include "dynamics/model/description.hpp"
#include "dynamics/model/force_kinds/kind.hpp"

namespace espalier::dynamics::model {
namespace {

void check_rising(const std::vector<double>& frequencies, const Place& place, bool strictly) {
  for (std::size_t i = 0; i < frequencies.size(); ++i) {
    if (!(frequencies[i] >= 0)) fail(place, fmt::format("{:g}: frequencies are not negative", frequencies[i]));
    if (strictly && i > 0 && !(frequencies[i] > frequencies[i - 1]))
      fail(place, fmt::format("{:g} follows {:g}; frequencies must rise", frequencies[i], frequencies[i - 1]));
  }
}

void read_range(Section& s, HarmonicOptions& o) {
  if (s.has("frequencies")) {
    o.frequencies = s.numbers("frequencies");
    for (const char* other : {"from", "to", "points", "logarithmic"})
      if (s.has(other)) fail(s.place(other), "does not go with 'frequencies', which say where to solve; leave one out");
    if (o.frequencies.empty()) fail(s.place("frequencies"), "is empty; name frequencies, or give 'from' and 'to'");
    check_rising(o.frequencies, s.place("frequencies"), true);
    return;
  }
  o.from = s.number("from", o.from);
  if (!(o.from >= 0)) fail(s.place("from"), "must not be negative");
  o.to = s.positive("to");
  if (!(o.to > o.from)) fail(s.place("to"), fmt::format("must be above 'from', {:g}", o.from));
  o.points = s.integer("points", 2, o.points);
  o.logarithmic = s.flag("logarithmic", false);
  if (o.logarithmic && !(o.from > 0))
    fail(s.place("from"), "must be above 0 where 'logarithmic' asks for equal ratios");
}

/// A number, or { amplitude, phase } with the phase in degrees.
std::complex<double> read_amplitude(const Value& value) {
  if (value.is_table()) {
    Section s(value);
    const double amplitude = s.number("amplitude", 1), phase = s.number("phase", 0);
    s.finish();
    return std::polar(1.0, phase * std::numbers::pi / 180) * amplitude;
  }
  return Section::plain_number(value);
}

void read_loads(Section& s, HarmonicSpec& out) {
  const Value* given = s.value("loads");
  if (given == nullptr) fail(s.place(), "needs 'loads': names of forces, motors or inputs, [\"shaker\"]");
  if (given->is_table()) {
    for (const auto& [name, value] : given->entries) {
      HarmonicSpec::Load load{value.place, name, {}};
      if (value.is_table() && !Section(value).has("amplitude") && !Section(value).has("phase"))
        for (const auto& [of, amplitude] : value.entries)
          load.parts.push_back({amplitude.place, of, read_amplitude(amplitude)});
      else
        load.parts.push_back({value.place, name, read_amplitude(value)});
      out.loads.push_back(std::move(load));
    }
  } else {
    for (const std::string& name : s.texts("loads"))
      out.loads.push_back({given->place, name, {{given->place, name, 1}}});
  }
  if (out.loads.empty()) fail(given->place, "is empty; name a force, a motor or an input");
  for (std::size_t i = 0; i < out.loads.size(); ++i) {
    const std::string& name = out.loads[i].name;  // of files, too
    const auto allowed = [](char c) {
      return std::isalnum(static_cast<unsigned char>(c)) != 0 || c == '-' || c == '_';
    };
    const std::string_view plain = std::string_view(name).substr(name.starts_with("inputs.") ? 7 : 0);
    if (plain.empty() || !std::all_of(plain.begin(), plain.end(), allowed))
      fail(out.loads[i].place, fmt::format("the name '{}' may have letters, digits, - and _ only", name));
    if (out.loads[i].parts.empty()) fail(out.loads[i].place, "is empty; give names with amplitudes, shaker = 1");
    for (std::size_t k = 0; k < i; ++k)
      if (out.loads[k].name == out.loads[i].name) fail(out.loads[i].place, "is there twice: " + out.loads[i].name);
  }
}

bool drives(JointType type) {
  return type == JointType::rotation_motor || type == JointType::translation_motor || type == JointType::prescribed;
}

/// What a part acts on must be there, and be something that can be driven.
void check_part(const HarmonicSpec::Excitation& part, const Description& model) {
  std::vector<std::string> names;
  for (const ForceSpec& force : model.forces) {
    names.push_back(force.name);
    if (force.name != part.of) continue;
    if (!force_kind(force.type).driven)
      fail(part.place, fmt::format("'{}' is a {}, which nothing drives; loads are forces of the types load, line-load, "
                                   "pressure, spring (its actuator), torque-motor and force-motor, motors, and inputs",
                                   part.of, force_kind(force.type).name));
    if (!force.active) fail(part.place, fmt::format("the force '{}' is switched off (active = false)", part.of));
    return;
  }
  for (const JointSpec& joint : model.joints) {
    if (drives(joint.type)) names.push_back(joint.name);
    if (joint.name != part.of) continue;
    if (!drives(joint.type))
      fail(part.place, fmt::format("the joint '{}' prescribes no motion; a rotation-motor, a translation-motor or a "
                                   "joint of the type prescribed does",
                                   part.of));
    if (!joint.active) fail(part.place, fmt::format("the joint '{}' is switched off (active = false)", part.of));
    return;
  }
  for (const auto& [name, value] : model.inputs) {
    names.push_back("inputs." + name);
    if (part.of == name || part.of == "inputs." + name) return;
  }
  fail(part.place, fmt::format("there is no force, motor or input '{}'{}", part.of, suggestion(part.of, names)));
}

}  // namespace

HarmonicSpec read_harmonic(Section s, const Description& model) {
  HarmonicSpec out;
  out.place = s.place();
  HarmonicOptions& o = out.options;
  read_range(s, o);
  o.tolerance = s.number("tolerance", 0);
  if (o.tolerance != 0 && !(o.tolerance >= 1e-8 && o.tolerance <= 0.1))
    fail(s.place("tolerance"), "must be 0 (a solve at each frequency), or from 1e-8 to 0.1");
  if (o.tolerance > 0 && o.frequencies.size() == 1)
    fail(s.place("tolerance"), "needs a range of frequencies to interpolate in, and one alone is given");
  o.max_solves = s.integer("max_solves", 16, o.max_solves);
  o.loss_factor = s.number("loss_factor", o.loss_factor);
  if (!(o.loss_factor >= 0)) fail(s.place("loss_factor"), "must not be negative");
  read_loads(s, out);
  out.quantities = s.texts("quantities");
  if (s.has("shapes")) o.shapes_at = s.numbers("shapes");
  check_rising(o.shapes_at, s.place("shapes"), false);
  constexpr int kMostPhases = 10000;  // pictures of a period, all in memory at once
  out.phases = s.integer("phases", 1, out.phases, kMostPhases);
  s.finish();
  for (const HarmonicSpec::Load& load : out.loads)
    for (const HarmonicSpec::Excitation& part : load.parts) check_part(part, model);
  return out;
}

}  // namespace espalier::dynamics::model
