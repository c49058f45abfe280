#include "dynamics/model/run_files.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <filesystem>
#include <limits>

namespace espalier::dynamics::model {

bool RunFiles::Clock::strikes(double t) {
  if (interval < 0) return false;
  if (interval == 0) return true;
  // Round-off of a due time that a step was to meet must not delay it to the next step.
  const double slack = 1e-9 * interval;
  if (t < due() - slack) return false;
  next = static_cast<long>(std::floor((t - start + slack) / interval)) + 1;
  return true;
}

RunFiles::RunFiles(const OutputSpec& spec, std::string folder, Mechanism& mechanism,
                   const std::vector<Quantity>& quantities, Integrator& integrator)
    : spec_(spec), folder_(std::move(folder)), mechanism_(mechanism), chosen_(quantities), integrator_(integrator) {
  if (folder_.empty()) return;
  std::error_code error;
  std::filesystem::create_directories(folder_, error);
  if (error)
    throw Error(StatusCode::invalid_input, fmt::format("cannot make the folder '{}': {}", folder_, error.message()));
  columns_ = chosen_;
  const auto add = [&](const std::string& request) {
    for (Quantity& q : find_quantities(mechanism_, request, spec_.place)) columns_.push_back(std::move(q));
  };
  if (spec_.reactions)
    for (const Joint* joint : mechanism_.joints) {
      add(joint->name() + ".force");
      add(joint->name() + ".moment");
    }
  if (spec_.energies)
    for (const char* name : {"energy.kinetic", "energy.potential", "energy.total"}) add(name);
  if (spec_.constraints)
    for (const char* name : {"constraints.position", "constraints.velocity", "constraints.acceleration"}) add(name);
  if (spec_.step_data)
    for (const char* name : {"step.h", "step.order", "step.newton", "step.factorizations", "step.error"}) add(name);
  csv_clock_.interval = spec_.csv_interval;
}

void RunFiles::write_csv(const Sample& s) {
  if (csv_time_ == s.state->t) return;
  sample_ = &s;
  csv_->write(s.state->view());
  csv_time_ = s.state->t;
}

void RunFiles::begin(const Sample& s) {
  if (folder_.empty()) return;
  csv_clock_.start = s.state->t;
  csv_clock_.next = 1;
  if (spec_.csv_interval >= 0) {
    std::vector<CsvColumn> columns;
    for (const Quantity& q : columns_)
      columns.push_back({q.name, [this, &q](const StateView&) { return q.value(*sample_); }});
    const std::string path = folder_ + "/quantities.csv";
    csv_ = std::make_unique<CsvWriter>(path, std::move(columns));
    written_.push_back(path);
    write_csv(s);
  }
}

void RunFiles::step(const Sample& s) {
  if (csv_ && csv_clock_.strikes(s.state->t)) write_csv(s);
}

void RunFiles::end(const Sample& s) {
  if (csv_) write_csv(s);
}

void RunFiles::emergency(const Sample& s) noexcept {
  try {
    end(s);
  } catch (...) {  // the failure that brought us here is the one to report
  }
}

double RunFiles::next_exact_time(double /*t*/) const {
  double next = std::numeric_limits<double>::infinity();
  if (!spec_.exact_times || folder_.empty()) return next;
  for (const Clock* clock : {&csv_clock_})
    if (clock->interval > 0) next = std::min(next, clock->due());
  return next;
}

}  // namespace espalier::dynamics::model
