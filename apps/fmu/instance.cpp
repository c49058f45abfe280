#include "instance.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <limits>
#include <utility>

#include "dynamics/mesh/file_source.hpp"
#include "dynamics/model/read/expand.hpp"

namespace espalier::fmu {

using fmi::Variable;
using Kind = Variable::Kind;

namespace {

[[noreturn]] void refuse(const std::string& what) { throw Error(StatusCode::invalid_input, what); }

/// Files of the model, which lie in resources/files.
class HeldFiles final : public dynamics::FileSource {
 public:
  HeldFiles(std::string folder, const fmi::Contents& contents) : folder_(std::move(folder)), contents_(contents) {}
  std::string read(const std::string& path) override {
    for (const auto& [asked, file] : contents_.files)
      if (asked == path) return dynamics::read_from_disk(folder_ + "/files/" + file);
    refuse(fmt::format("{}: the FMU does not hold this file", path));
  }
  bool exists(const std::string& path) override {
    return std::any_of(contents_.files.begin(), contents_.files.end(), [&](const auto& f) { return f.first == path; });
  }

 private:
  std::string folder_;
  const fmi::Contents& contents_;
};

/// Bytes of a state, written and read in the same order.
class Packer {
 public:
  void number(double value) { bytes_.append(reinterpret_cast<const char*>(&value), sizeof value); }
  void text(std::string_view text) {
    number(static_cast<double>(text.size()));
    bytes_ += text;
  }
  void numbers(const std::vector<double>& list) {
    number(static_cast<double>(list.size()));
    for (const double x : list) number(x);
  }
  [[nodiscard]] std::string done() { return std::move(bytes_); }

 private:
  std::string bytes_;
};

class Unpacker {
 public:
  explicit Unpacker(std::string_view bytes) : rest_(bytes) {}
  double number() {
    double value = 0;
    const std::string_view raw = take(sizeof value);
    std::copy(raw.begin(), raw.end(), reinterpret_cast<char*>(&value));
    return value;
  }
  std::string_view text() { return take(size(1)); }
  std::vector<double> numbers() {
    std::vector<double> list(size(sizeof(double)));
    for (double& x : list) x = number();
    return list;
  }

 private:
  std::size_t size(std::size_t each) {
    const double count = number();
    if (!(count >= 0 && count <= std::floor(static_cast<double>(rest_.size()) / static_cast<double>(each))))
      refuse("the state of the FMU is damaged, or of another FMU");
    return static_cast<std::size_t>(count);
  }
  std::string_view take(std::size_t count) {
    if (rest_.size() < count) refuse("the state of the FMU is damaged: it ends too early");
    const std::string_view found = rest_.substr(0, count);
    rest_.remove_prefix(count);
    return found;
  }
  std::string_view rest_;
};

constexpr std::string_view kStateOf = "state of espalier-fmu 1";

/// What an FMU writes, shows or asks for at the start of a run is nobody's.
void keep_to_motion(dynamics::model::Description& model) {
  auto& out = model.output;
  out.quantities.clear();
  out.envelopes.clear();
  out.paths.clear();
  out.page = false;
  model.harmonic.reset();
}

}  // namespace

Instance::Instance(const std::string& resources, std::string_view token, bool model_exchange)
    : folder_(resources), model_exchange_(model_exchange) {
  contents_ = fmi::parse_contents(dynamics::read_from_disk(folder_ + "/espalier.txt"));
  if (contents_.token != token)
    refuse(fmt::format("the FMU is {}, the caller asks for {}: its binary or its description is of another FMU",
                       contents_.token, token));
  text_ = dynamics::read_from_disk(folder_ + "/model.toml");
  for (std::size_t k = 0; k < contents_.variables.size(); ++k) {
    const Variable& v = contents_.variables[k];
    values_.push_back(v.start);
    if (v.kind == Kind::output) outputs_.push_back(k);
    if (v.kind == Kind::state) states_.push_back(k);
    if (v.kind == Kind::derivative) derivatives_.push_back(k);
  }
  if (model_exchange && states_.empty()) refuse("this FMU has no model exchange; instantiate it for co-simulation");
}

const Variable& Instance::variable(fmi::ValueReference reference) const {
  if (reference >= contents_.variables.size())
    refuse(fmt::format("there is no variable {}; the last one is {}", reference, contents_.variables.size() - 1));
  return contents_.variables[reference];
}

std::vector<std::string> Instance::take_notices() {
  return run_ ? std::exchange(run_->summary.notices, {}) : std::vector<std::string>{};
}

void Instance::set_times(std::optional<double> tolerance, double start, std::optional<double> stop) {
  if (mode_ != Mode::instantiated) refuse("times and tolerance are set before the initialization");
  if (!std::isfinite(start) || (stop && !(*stop >= start)))
    refuse(fmt::format("the run cannot go from {} to {}", start, stop.value_or(start)));
  if (tolerance && !(*tolerance > 0 && *tolerance < 1))
    refuse(fmt::format("a tolerance of {} is none; it lies between 0 and 1", *tolerance));
  tolerance_ = tolerance;
  stop_ = stop;
  values_[0] = start;
}

void Instance::enter_initialization() {
  if (mode_ != Mode::instantiated) refuse("the initialization was entered already; reset the FMU before");
  mode_ = Mode::initialization;
}

void Instance::exit_initialization() {
  if (mode_ != Mode::initialization) refuse("the initialization was not entered");
  need_run();
  mode_ = Mode::running;
}

void Instance::reset() {
  run_.reset();
  mode_ = Mode::instantiated;
  tolerance_.reset();
  stop_.reset();
  for (std::size_t k = 0; k < values_.size(); ++k) values_[k] = contents_.variables[k].start;
}

std::unique_ptr<Instance::Run> Instance::load(const std::vector<double>& values) const {
  std::vector<std::string> set = contents_.set;
  SimulationOptions options;
  options.page = false;
  for (std::size_t k = 0; k < values.size(); ++k) {
    const Variable& v = contents_.variables[k];
    if (v.kind == Kind::time && values[k] != v.start) {
      set.push_back(fmt::format("integrator.start={}", values[k]));
      if (!(contents_.end > values[k])) set.push_back(fmt::format("integrator.end={}", values[k] + 1));
    }
    if (v.kind == Kind::output) options.quantities.push_back(v.name);
    if (values[k] == v.start) continue;  // the model says it itself
    if (v.kind == Kind::input) set.push_back(fmt::format("inputs.{}={}", v.name, values[k]));
    if (v.kind == Kind::parameter) set.push_back(fmt::format("{}={}", v.name, values[k]));
  }
  if (tolerance_ && contents_.adaptive) set.push_back(fmt::format("integrator.relative={}", *tolerance_));
  auto run = std::make_unique<Run>();
  HeldFiles files(folder_, contents_);
  const dynamics::FileSource::Scope scope(files);
  dynamics::model::Value root = dynamics::model::parse_toml(text_, contents_.model);
  dynamics::model::expand(root, set);
  dynamics::model::Description model = dynamics::model::read_description(root, contents_.model);
  keep_to_motion(model);
  run->runner = std::make_unique<dynamics::model::Runner>(std::move(model), std::move(options), run->summary);
  if (run->summary.values.size() != outputs_.size()) refuse("the model's quantities are not those of the FMU");
  run->loaded_with = values;
  return run;
}

void Instance::need_run() {
  if (run_) return;
  run_ = load(values_);
  take_run();
}

void Instance::read_out(const Run& run, std::vector<double>& values) const {
  for (std::size_t k = 0; k < outputs_.size(); ++k) values[outputs_[k]] = run.summary.values[k].second;
  const dynamics::State& s = run.runner->state();
  for (std::size_t k = 0; k < states_.size(); ++k) {
    values[states_[k]] = k < s.q.size() ? s.q[k] : s.v[k - s.q.size()];
    values[derivatives_[k]] = k < s.q.size() ? s.v[k] : s.a[k - s.q.size()];
  }
}

// Takes the run's state.
void Instance::take_run() {
  read_out(*run_, values_);
  current_ = !model_exchange_;
}

StepEnd Instance::step(double from, double length) {
  if (mode_ != Mode::running || model_exchange_) refuse("a step is made after the initialization, in co-simulation");
  dynamics::model::Runner& runner = *run_->runner;
  const double now = runner.time(), to = from + length, close = 1e-6 * std::max(length, 1e-9 * std::abs(now));
  if (!(length >= 0) || !std::isfinite(to)) refuse(fmt::format("a step of {} cannot be made", length));
  if (!(std::abs(from - now) <= close))
    refuse(fmt::format("the step begins at {}, but the FMU is at {}; go back by an FMU state", from, now));
  if (stop_ && to > *stop_ + 1e-9 * std::max(std::abs(*stop_), length))
    refuse(fmt::format("the step ends at {}, behind the stop time {}", to, *stop_));
  for (std::size_t k = 0; k < values_.size(); ++k)
    if (contents_.variables[k].kind == Kind::input) runner.set_input(contents_.variables[k].name, values_[k]);
  if (to > now) runner.step_to(to, {});
  values_[0] = runner.time();
  take_run();
  const bool short_of_it = !(std::abs(runner.time() - to) <= close) && to > now;  // an event, or integrator.steps
  return {runner.time(), !run_->summary.stopped_by.empty() || short_of_it};
}

double Instance::get(fmi::ValueReference reference) {
  const Variable& v = variable(reference);
  const bool found = v.kind == Kind::output || v.kind == Kind::derivative || v.kind == Kind::state;
  if (found && mode_ == Mode::instantiated) refuse(fmt::format("'{}' has no value before the initialization", v.name));
  if (found) need_run();
  if (found && v.kind != Kind::state && !current_) respond();
  return values_[reference];
}

void Instance::set(fmi::ValueReference reference, double value) {
  const Variable& v = variable(reference);
  if (!std::isfinite(value)) refuse(fmt::format("'{}': {} is no number to set", v.name, value));
  const bool starting = mode_ == Mode::instantiated || mode_ == Mode::initialization;
  if (v.kind == Kind::parameter && !starting)
    refuse(fmt::format("the parameter '{}' is fixed after the initialization", v.name));
  if (v.kind == Kind::state && model_exchange_ && mode_ == Mode::running) {
    current_ = false;
  } else if (v.kind != Kind::parameter && v.kind != Kind::input) {
    refuse(fmt::format("'{}' is no input or parameter, it cannot be set", v.name));
  }
  if (values_[reference] == value) return;
  values_[reference] = value;
  if (starting) run_.reset();  // loaded anew where it is needed
  if (model_exchange_) current_ = false;
}

std::string Instance::save() {
  Packer out;
  out.text(kStateOf);
  out.text(contents_.token);
  out.number(static_cast<double>(mode_));
  out.number(tolerance_.value_or(0));
  out.number(stop_.value_or(std::numeric_limits<double>::infinity()));
  out.numbers(values_);
  out.numbers(run_ ? run_->loaded_with : std::vector<double>{});
  out.text(run_ && !model_exchange_ ? run_->runner->save() : std::string());
  return out.done();
}

void Instance::restore(std::string_view bytes) {
  Unpacker in(bytes);
  if (in.text() != kStateOf || in.text() != contents_.token) refuse("the state is one of another FMU");
  const double mode = in.number(), tolerance = in.number(), stop = in.number();
  std::vector<double> values = in.numbers();
  const std::vector<double> loaded_with = in.numbers();
  const std::string_view run = in.text();
  if (values.size() != values_.size() || (!loaded_with.empty() && loaded_with.size() != values.size()) ||
      !(mode >= 0 && mode <= static_cast<double>(Mode::terminated)) ||
      (mode == static_cast<double>(Mode::running) && loaded_with.empty()))
    refuse("the state of the FMU is damaged");
  const std::optional<double> wanted = tolerance > 0 ? std::optional(tolerance) : std::nullopt;
  if (loaded_with.empty()) {
    run_.reset();
  } else if (!run_ || run_->loaded_with != loaded_with || tolerance_ != wanted) {
    const std::optional<double> before = std::exchange(tolerance_, wanted);
    try {
      run_ = load(loaded_with);
    } catch (const Error&) {
      tolerance_ = before;
      throw;
    }
  }
  if (!run.empty()) run_->runner->restore(run);
  tolerance_ = wanted;
  stop_ = std::isfinite(stop) ? std::optional(stop) : std::nullopt;
  mode_ = static_cast<Mode>(mode);
  values_ = std::move(values);
  current_ = !model_exchange_;
}

}  // namespace espalier::fmu
