#include "dynamics/model/run/run_files.hpp"

#include <fcntl.h>
#include <fmt/format.h>
#include <sys/file.h>
#include <unistd.h>

#include <algorithm>
#include <cerrno>
#include <cmath>
#include <filesystem>
#include <limits>

#include "base/output_file.hpp"
#include "dynamics/model/answer/harmonic_run.hpp"
#include "dynamics/model/run/restart.hpp"
#include "harmonic/table.hpp"

namespace espalier::dynamics::model {

HeldFolder::HeldFolder(const std::string& path) {
  std::error_code error;
  std::filesystem::create_directories(path, error);
  if (error)
    throw Error(StatusCode::invalid_input, fmt::format("cannot make the folder '{}': {}", path, error.message()));
  descriptor_ = ::open(path.c_str(), O_RDONLY | O_DIRECTORY | O_CLOEXEC);
  // File systems without locks are taken as they are.
  if (descriptor_ < 0 || ::flock(descriptor_, LOCK_EX | LOCK_NB) == 0 || errno != EWOULDBLOCK) return;
  ::close(descriptor_);
  throw Error(StatusCode::invalid_input,
              fmt::format("another run is writing into the folder '{}'; give this one a folder of its own", path));
}

HeldFolder::~HeldFolder() {
  if (descriptor_ >= 0) ::close(descriptor_);
}

RunFiles::RunFiles(const OutputSpec& spec, std::string folder, Mechanism& mechanism,
                   const std::vector<Quantity>& quantities, const std::unique_ptr<Integrator>& integrator)
    : spec_(spec), folder_(std::move(folder)), mechanism_(mechanism), chosen_(quantities), integrator_(integrator) {
  if (folder_.empty()) return;
  held_ = std::make_unique<HeldFolder>(folder_);
  base::remove_abandoned(folder_);
  columns_ = chosen_;
  const auto add = [&](const std::string& request) {
    for (Quantity& q : find_quantities(mechanism_, request, spec_.place)) columns_.push_back(std::move(q));
  };
  if (spec_.reactions) {
    std::vector<std::string> names;
    for (const Joint* joint : mechanism_.joints) names.push_back(joint->name());
    for (const Support* support : mechanism_.supports) names.push_back(support->name());
    for (const std::string& name : names) {
      add(name + ".force");
      add(name + ".moment");
    }
  }
  if (spec_.energies)
    for (const char* name : {"energy.kinetic", "energy.potential", "energy.total"}) add(name);
  if (spec_.energies && mechanism_.erosion != nullptr) add("energy.failed");
  if (spec_.constraints)
    for (const char* name : {"constraints.position", "constraints.velocity", "constraints.acceleration"}) add(name);
  if (spec_.step_data)
    for (const char* name : {"step.h", "step.order", "step.newton", "step.factorizations", "step.error"}) add(name);
  csv_clock_.interval = spec_.csv_interval;
  vtu_clock_.interval = spec_.vtu_interval;
  restart_clock_.interval = spec_.restart_interval;
}

void RunFiles::write_csv(const Sample& s) {
  if (csv_time_ == s.time()) return;
  sample_ = &s;
  StateView row = s.state->view();
  row.t = s.time();
  row_.clear();
  csv_->write(row);
  csv_time_ = s.time();
  if (told_) told_(s.time(), row_);
}

void RunFiles::write_picture(const State& picture, const Sample& s) {
  if (vtu_time_ == picture.t) return;
  std::vector<double> values;
  if (spec_.format == PictureFormat::vtkhdf) {
    State state = picture;
    Sample at{&state, s.report};
    if (s.load) {
      at.load = picture.t;
      state.t = s.state->t;
    }
    for (const Quantity& q : columns_) values.push_back(q.value(at));
  }
  pictures_->write(picture, picture.t, std::move(values));
  vtu_time_ = picture.t;
}

void RunFiles::write_due_pictures(const Sample& s) {
  const State end = s.pictured();
  vtu_clock_.visit(mechanism_.system, before_, end, [&](const State& due) { write_picture(due, s); });
  before_ = end;
}

void RunFiles::write_restart_file(const Sample& s) {
  if (integrator_ == nullptr || restart_time_ == s.time()) return;
  const std::string path = folder_ + "/state.restart";
  write_restart(path, mechanism_, *integrator_);
  if (!restart_time_) written_.push_back(path);
  restart_time_ = s.time();
}

void RunFiles::begin_csv(const Sample& s, double keep_until) {
  std::vector<CsvColumn> columns;
  for (const Quantity& q : columns_)
    columns.push_back({q.name, [this, &q](const StateView&) { return row_.emplace_back(q.value(*sample_)); }});
  const std::string path = folder_ + "/quantities.csv";
  csv_ = std::make_unique<CsvWriter>(path, std::move(columns), keep_until);
  written_.push_back(path);
  if (!std::isnan(csv_->kept())) csv_time_ = csv_->kept();
  if (!csv_time_) write_csv(s);
}

void RunFiles::begin(const Sample& s, const State& initial, bool restarted) {
  if (folder_.empty()) return;
  for (DueTimes* clock : {&csv_clock_, &vtu_clock_, &restart_clock_}) {
    clock->start = s.load ? 0 : initial.t;
    clock->wind_to(s.time());
  }
  const double keep_until = restarted ? s.time() : std::numeric_limits<double>::quiet_NaN();
  if (spec_.csv_interval >= 0) begin_csv(s, keep_until);
  if (spec_.vtu_interval >= 0) {
    std::vector<std::string> names;
    for (const Quantity& q : columns_) names.push_back(q.name);
    pictures_ =
        std::make_unique<Pictures>(folder_, "motion", spec_.format, mechanism_, initial, keep_until, std::move(names));
    written_.push_back(pictures_->path());
    if (restarted) vtu_time_ = pictures_->kept();
    if (!restarted) write_picture(s.pictured(), s);
    before_ = s.pictured();
  }
}

std::vector<std::string> RunFiles::columns() const {
  std::vector<std::string> names;
  if (!folder_.empty() && spec_.csv_interval >= 0)
    for (const Quantity& q : columns_) names.push_back(q.name);
  return names;
}

void RunFiles::modes(const State& state, const std::vector<std::vector<double>>& shapes) {
  if (folder_.empty() || shapes.empty()) return;
  State shown = state;
  std::fill(shown.v.begin(), shown.v.end(), 0.0);
  Pictures pictures(folder_, "modes", spec_.format, mechanism_, shown, std::numeric_limits<double>::quiet_NaN());
  for (std::size_t k = 0; k < shapes.size(); ++k) {
    shown.q = state.q;
    shown.v = shapes[k];
    const double scale = 0.05 * pictures.extent_over_speed(shown);
    std::vector<double> step = shapes[k];
    for (double& x : step) x *= scale;
    mechanism_.system.retract(state.q, step, shown.q);
    pictures.write(shown, static_cast<double>(k + 1));
  }
  pictures.finish();
  written_.push_back(pictures.path());
}

void RunFiles::harmonic(const State& state, const ModelHarmonicResult& response, int phases) {
  if (folder_.empty()) return;
  base::OutputFile table(folder_ + "/harmonic.csv");
  harmonic::write_table(response.response, response.quantities, response.loads,
                        [&](std::string_view line) { table.write(line); });
  table.commit();
  written_.push_back(folder_ + "/harmonic.csv");
  const auto finite = [](const std::complex<double>& x) { return std::isfinite(x.real()) && std::isfinite(x.imag()); };
  const auto& shapes = response.response.shapes;
  if (shapes.empty() || !std::all_of(shapes.begin(), shapes.end(), finite)) return;
  for (std::size_t load = 0; load < response.loads.size(); ++load) {
    std::string name = response.loads[load];
    std::replace(name.begin(), name.end(), '.', '_');  // of an input
    State shown = state;
    std::fill(shown.v.begin(), shown.v.end(), 0.0);
    Pictures pictures(folder_, "harmonic_" + name, spec_.format, mechanism_, shown,
                      std::numeric_limits<double>::quiet_NaN());
    const std::vector<HarmonicPicture> all =
        harmonic_pictures(response, load, phases, static_cast<Index>(state.v.size()));
    const auto each = static_cast<std::size_t>(phases);
    for (std::size_t first = 0; first < all.size(); first += each) {
      // One scale for a whole period: that of its largest picture.
      double scale = std::numeric_limits<double>::infinity();
      shown.q = state.q;
      for (std::size_t k = first; k < first + each; ++k) {
        shown.v = all[k].shift;
        if (const double way = pictures.extent_over_speed(shown); way > 0) scale = std::min(scale, 0.05 * way);
      }
      for (std::size_t k = first; k < first + each; ++k) {
        std::vector<double> step = all[k].shift;
        for (double& x : step) x *= std::isfinite(scale) ? scale : 0;
        mechanism_.system.retract(state.q, step, shown.q);
        shown.v = all[k].v;
        pictures.write(shown, all[k].time);
      }
    }
    pictures.finish();
    written_.push_back(pictures.path());
  }
}

void RunFiles::step(const Sample& s) {
  if (csv_ && csv_clock_.strikes(s.time())) write_csv(s);
  if (pictures_) write_due_pictures(s);
  if (folder_.empty() || !restart_clock_.strikes(s.time())) return;
  if (csv_) csv_->catch_up();
  if (pictures_) pictures_->catch_up();
  write_restart_file(s);
}

void RunFiles::end(const Sample& s) {
  if (csv_) {
    write_csv(s);
    csv_->finish();
  }
  if (pictures_) {
    write_picture(s.pictured(), s);
    pictures_->finish();
  }
  if (!folder_.empty()) write_restart_file(s);
  held_.reset();
}

void RunFiles::emergency(const Sample& s) noexcept {
  const auto save = [](const auto& write) {
    try {
      write();
    } catch (...) {  // the failure that brought us here is the one to report
    }
  };
  if (!folder_.empty()) save([&] { write_restart_file(s); });
  if (csv_) save([&] { write_csv(s); });
  if (csv_) save([&] { csv_->catch_up(); });
  if (pictures_) save([&] { write_picture(s.pictured(), s); });
  if (pictures_) save([&] { pictures_->catch_up(); });
  held_.reset();
}

double RunFiles::next_exact_time() const {
  double next = std::numeric_limits<double>::infinity();
  if (!spec_.exact_times || folder_.empty()) return next;
  for (const DueTimes* clock : {&csv_clock_, &vtu_clock_, &restart_clock_})
    if (clock->interval > 0) next = std::min(next, clock->due());
  return next;
}

}  // namespace espalier::dynamics::model
