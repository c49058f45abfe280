#include "dynamics/model/controllers/controllers.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <cstring>
#include <limits>

#include "dynamics/mesh/text_file.hpp"
#include "dynamics/model/build/builders.hpp"
#include "dynamics/model/run/runner.hpp"

namespace espalier::dynamics::model {
namespace {

using fmi::ForeignVariable;

/// A variable that a model names, with near names where it is not there.
ForeignVariable named_variable(const fmi::ForeignFmu& fmu, const std::string& name, const Place& place,
                               std::string_view causality, bool text_allowed) {
  const ForeignVariable* v = fmu.description().find(name);
  if (v == nullptr) {
    std::vector<std::string> known;
    for (const ForeignVariable& other : fmu.description().variables)
      if (causality.empty() ? other.causality != "local" : other.causality == causality) known.push_back(other.name);
    fail(place, fmt::format("{} has no {} '{}'{}", fmu.title(), causality.empty() ? "variable" : causality, name,
                            suggestion(name, known)));
  }
  if (causality == "input" && v->causality != "input")
    fail(place, fmt::format("'{}' of {} is no input but {}; 'start' sets what it begins with", name, fmu.title(),
                            v->causality));
  const bool text = v->type == ForeignVariable::Type::text;
  if (v->array)
    fail(place, fmt::format("'{}' of {} is an array; FMUs are coupled by single numbers", name, fmu.title()));
  if (v->type == ForeignVariable::Type::other || (text && !text_allowed))
    fail(place, fmt::format("'{}' of {} is no number", name, fmu.title()));
  return *v;
}

/// As names of quantities may be.
bool plain_name(const std::string& name) {
  return !name.empty() && std::all_of(name.begin(), name.end(), [](char c) {
    return c == '_' || (c >= '0' && c <= '9') || (c >= 'a' && c <= 'z') || (c >= 'A' && c <= 'Z');
  });
}

}  // namespace

void Controllers::Controller::give_inputs(const StateView& s) {
  for (std::size_t k = 0; k < inputs.size(); ++k) fmu->set(variables[k], inputs[k]->value(s));
}

bool Controllers::Controller::take_outputs() {
  bool changed = false;
  for (Output& output : outputs) {
    const double value = fmu->get(output.variable);
    if (!std::isfinite(value))
      throw Error(StatusCode::invalid_input,
                  fmt::format("{}: its output '{}' is {}, no number", fmu->title(), output.variable.name, value));
    changed = changed || value != output.value;
    output.value = value;
  }
  return changed;
}

void Controllers::add(const ControllerSpec& spec, double begin) {
  auto part = std::make_unique<Controller>();
  part->name = spec.name;
  part->begin = begin;
  part->step = spec.step;
  std::vector<std::pair<ForeignVariable, fmi::ForeignFmu::Value>> start;
  part->fmu = fmi::ForeignFmu::load(spec.name, spec.path, read_whole_file(spec.path));
  const fmi::ForeignFmu& fmu = *part->fmu;
  for (const auto& [name, formula] : spec.inputs)
    part->variables.push_back(named_variable(fmu, name, formula.place, "input", false));
  for (const auto& [name, variable] : spec.outputs)
    part->outputs.push_back({name, named_variable(fmu, variable, spec.place, "output", false)});
  if (spec.all_outputs)
    for (const ForeignVariable& v : fmu.description().variables)
      if (v.causality == "output" && !v.array && v.type < ForeignVariable::Type::text && plain_name(v.name))
        part->outputs.push_back({v.name, v});
  if (part->outputs.empty())
    fail(spec.place, fmt::format("{} tells nothing: it has no outputs that are single numbers with plain names; "
                                 "outputs = {{ force = \"its.name\" }} gives them names",
                                 fmu.title()));
  for (const auto& [name, value] : spec.start) {
    const bool text = std::holds_alternative<std::string>(value);
    const ForeignVariable v = named_variable(fmu, name, spec.place, "", text);
    if (text != (v.type == ForeignVariable::Type::text))
      fail(spec.place, fmt::format("start: '{}' of {} is {}", name, fmu.title(), text ? "a number" : "a text"));
    start.emplace_back(v, value);
  }
  part->fmu->begin(begin, start);
  part->take_outputs();
  parts_.push_back(std::move(part));
}

const Controllers::Controller* Controllers::part(const std::string& name) const {
  const auto it = std::find_if(parts_.begin(), parts_.end(), [&](const auto& p) { return p->name == name; });
  return it == parts_.end() ? nullptr : it->get();
}

bool Controllers::begin(const StateView& s) {
  bool changed = false;
  for (const auto& part : parts_) {
    part->give_inputs(s);
    part->fmu->end_initialization();
    changed = part->take_outputs() || changed;
  }
  return changed;
}

double Controllers::next() const {
  double time = std::numeric_limits<double>::infinity();
  for (const auto& part : parts_) time = std::min(time, part->next());
  return time;
}

// All of them get the state before any of them steps: the order of the text does not matter.
std::string Controllers::exchange(const StateView& s) {
  const auto due = [&](const Controller& part) {
    return !(part.next() - s.t > 4e-16 * std::max(std::abs(s.t), std::abs(part.next())));
  };
  std::string ends;
  for (const auto& part : parts_)
    if (due(*part)) part->give_inputs(s);
  for (const auto& part : parts_)
    while (ends.empty() && due(*part)) {
      const double from = part->begin + static_cast<double>(part->done) * part->step;
      if (!part->fmu->step(from, part->next() - from)) ends = part->name;
      ++part->done;
      part->take_outputs();
    }
  return ends;
}

void Controllers::save(std::vector<double>& out) const {
  for (const auto& part : parts_) {
    out.push_back(static_cast<double>(part->done));
    for (const Output& output : part->outputs) out.push_back(output.value);
    const bool gives = part->fmu->description().serializes_state;
    const std::string bytes = gives ? part->fmu->save() : std::string();
    out.push_back(gives ? static_cast<double>(bytes.size()) : -1);
    std::vector<double> packed((bytes.size() + sizeof(double) - 1) / sizeof(double));
    if (!bytes.empty()) std::memcpy(packed.data(), bytes.data(), bytes.size());
    out.insert(out.end(), packed.begin(), packed.end());
  }
}

void Controllers::restore(ConstSpan& in) {
  const auto take = [&in] {
    if (in.empty()) throw Error(StatusCode::invalid_input, "the restart file ends too early");
    const double value = in.front();
    in = in.subspan(1);
    return value;
  };
  for (const auto& part : parts_) {
    part->done = static_cast<long>(take());
    for (Output& output : part->outputs) output.value = take();
    const double size = take();
    if (size < 0)
      throw Error(
          StatusCode::invalid_input,
          fmt::format("{} does not give its state (canSerializeFMUState in modelDescription.xml): a run with it "
                      "begins anew, and cannot go back",
                      part->fmu->title()));
    if (!(size <= static_cast<double>(8 * in.size())))
      throw Error(StatusCode::invalid_input, "the restart file is damaged");
    const auto bytes = static_cast<std::size_t>(size);
    part->fmu->restore({reinterpret_cast<const char*>(in.data()), bytes});
    in = in.subspan((bytes + sizeof(double) - 1) / sizeof(double));
  }
}

void build_controllers(const Description& model, Mechanism& out) {
  if (model.controllers.empty()) return;
  auto controllers = std::make_unique<Controllers>();
  for (const ControllerSpec& spec : model.controllers)
    at_place(spec.place, [&] { controllers->add(spec, model.integrator.start); });
  out.controllers = &out.system.add(std::move(controllers));
}

// Accelerations and reactions follow what FMUs tell when they know the state.
void Runner::begin_controllers() {
  if (mechanism_->controllers == nullptr) return;
  if (mechanism_->controllers->begin(state_.view())) make_consistent(*equations_, state_);
}

bool Runner::exchange() {
  if (mechanism_->controllers == nullptr) return true;
  const std::string ends = mechanism_->controllers->exchange(current().view());
  if (ends.empty()) return true;
  stopped_ = true;
  summary_.stopped_by = ends;
  return false;
}

double Runner::next_exchange() const {
  return mechanism_->controllers == nullptr ? std::numeric_limits<double>::infinity() : mechanism_->controllers->next();
}

}  // namespace espalier::dynamics::model
