// The page of a run.
#include <fmt/format.h>

#include <algorithm>
#include <complex>
#include <set>

#include "base/stopwatch.hpp"
#include "dynamics/model/run/runner.hpp"
#include "harmonic/table.hpp"

namespace espalier::dynamics::model {

namespace {

/// Something to look at: where the first bodies are, energies, forces of the first joints.
std::vector<Quantity> usual_quantities(Mechanism& mechanism) {
  constexpr std::size_t kMost = 6;
  std::vector<std::string> requests;
  for (std::size_t b = 0; b < std::min(kMost, mechanism.bodies.size()); ++b)
    for (const char* what : {".position", ".velocity"}) requests.push_back(mechanism.bodies[b].spec.name + what);
  for (std::size_t j = 0; j < std::min(kMost, mechanism.joints.size()); ++j)
    requests.push_back(mechanism.joints[j]->name() + ".force");
  for (const char* energy : {"energy.kinetic", "energy.potential", "energy.total"}) requests.emplace_back(energy);
  std::set<std::string> known;  // velocities are not, in linear statics
  for (SimulationQuantity& q : list_quantities(mechanism)) known.insert(std::move(q.name));
  std::vector<Quantity> all;
  for (const std::string& request : requests)
    if (known.contains(request) || known.contains(request + ".x"))
      for (Quantity& q : find_quantities(mechanism, request, {})) all.push_back(std::move(q));
  return all;
}

}  // namespace

void Runner::begin_page(const Sample& s, const State& initial) {
  const bool in_folder = options_.page && model_.output.page && !options_.out.empty();
  if (!in_folder && !options_.keep_page) return;
  if (!page_) {
    page_ = std::make_unique<page::LivePage>(*mechanism_, model_, in_folder ? options_.out : "",
                                             s.load ? 0 : summary_.t_begin, end_time(), model_.output.vtu_interval);
    std::vector<std::string> names = files_->columns();
    if (quantities_.empty() && (names.empty() || options_.keep_series)) {
      usual_quantities_ = usual_quantities(*mechanism_);
      std::vector<std::string> usual;
      for (const Quantity& q : usual_quantities_) usual.push_back(q.name);
      if (names.empty()) names = usual;
      usual_rows_.begin(std::move(usual));
    }
    page_->rows().begin(std::move(names));
    page_->film().begin(s, initial);
  }
  if (!files_->columns().empty())
    files_->tell_rows([this](double t, const std::vector<double>& values) { page_->rows().add(t, values); });
}

// A run is not worse for a page that has no room.
void Runner::show(const Sample& s) {
  if (!page_) return;
  bool due = false;
  try {
    if (!usual_quantities_.empty() && !usual_rows_.ends_at(s.time())) {
      std::vector<double> row;
      for (const Quantity& q : usual_quantities_) row.push_back(q.value(s));
      usual_rows_.add(s.time(), row);
      if (files_->columns().empty()) page_->rows().add(s.time(), row);
    }
    due = page_->step(s);
  } catch (const std::bad_alloc&) {
    page_.reset();
    files_->tell_rows({});
    summary_.notices.emplace_back("the page of the run was given up: there is no memory for it");
  }
  if (due) write_page({}, true);
}

const SimulationSeries& Runner::series() {
  if (!options_.keep_series || usual_quantities_.empty()) return series_;
  usual_series_ = usual_rows_.series();
  return usual_series_;
}

void Runner::show_shapes() {
  if (!page_ || shapes_.empty()) return;
  std::vector<page::Swing> swings;
  for (std::size_t k = 0; k < shapes_.size(); ++k) {
    page::Swing swing{fmt::format("mode {}", k + 1), 0, shapes_[k], {}};
    if (k < summary_.modes.size()) swing.frequency = summary_.modes[k].frequency;
    swings.push_back(std::move(swing));
  }
  page_->film().swing(state_, swings);
}

void Runner::show_response() {
  if (!page_) return;
  const HarmonicResult& r = response_.response;
  const auto size = at(r.n), n = state_.v.size();
  std::vector<page::Swing> swings;
  for (std::size_t k = 0; k < r.shape_frequencies.size(); ++k)
    for (std::size_t load = 0; load < response_.loads.size(); ++load) {
      const std::complex<double>* x = r.shapes.data() + (k * response_.loads.size() + load) * size;
      page::Swing swing{
          fmt::format("{} at {:.6g}", response_.loads[load], r.shape_frequencies[k]), r.shape_frequencies[k], {}, {}};
      bool finite = true;
      for (std::size_t i = 0; i < n; ++i) {
        swing.shift.push_back(x[i].real());
        swing.shift90.push_back(-x[i].imag());
        finite = finite && std::isfinite(std::abs(x[i]));
      }
      if (finite) swings.push_back(std::move(swing));
    }
  page_->film().swing(current(), swings);
}

namespace {

page::RunOfPage::Response response_of(const ModelHarmonicResult& response) {
  page::RunOfPage::Response out;
  const HarmonicResult& r = response.response;
  for (const HarmonicPoint& point : r.points) out.frequencies.push_back(point.frequency);
  if (out.frequencies.empty()) return out;
  for (const bool phases : {false, true})
    for (std::size_t load = 0; load < response.loads.size(); ++load)
      for (std::size_t i = 0; i < response.quantities.size(); ++i) {
        out.names.push_back(
            fmt::format("{} of {} ({})", phases ? "phase" : "amplitude", response.quantities[i], response.loads[load]));
        for (std::size_t p = 0; p < r.points.size(); ++p) {
          const std::complex<double> x = r.response(p, static_cast<Index>(load), static_cast<Index>(i));
          out.columns.push_back(phases ? harmonic::degrees(x) : std::abs(x));
        }
      }
  return out;
}

}  // namespace

page::RunOfPage Runner::run_of_page(bool running) const {
  page::RunOfPage run{summary_, {}, running, model_.file, model_.text, options_.set, 0, 0, {}, {}, {}};
  run.gravity = {model_.gravity.x(), model_.gravity.y(), model_.gravity.z()};
  run.begin = model_.statics ? 0 : summary_.t_begin;
  run.end = end_time();
  run.quantities = all_quantities();
  run.response = response_of(response_);
  return run;
}

std::string Runner::page(const Status& status) {
  if (!page_) {
    const Sample s = sample(last_report_);
    page::LivePage still(*mechanism_, model_, "", time(), time(), 0);
    still.film().begin(s, reference_);
    page::RunOfPage run = run_of_page(false);
    run.status = status;
    return still.text(run, page::rows_of(series_));
  }
  page_->film().end(sample(last_report_));
  page::RunOfPage run = run_of_page(false);
  run.status = status;
  return page_->text(run, page::rows_of(series_));
}

void Runner::write_page(const Status& status, bool running) noexcept {
  if (!page_) return;
  try {
    double seconds = 0;  // counted by the caller, where the run goes on
    {
      const base::Stopwatch watch(seconds);
      if (running) finish();
      page_->film().end(sample(last_report_));
      summary_.stress_peaks = page_->film().peaks();
      page::RunOfPage run = run_of_page(running);
      run.status = status;
      page_->write(run);
    }
    if (running) return;
    summary_.phases.output += seconds;
    summary_.phases.total += seconds;
    if (std::find(summary_.files.begin(), summary_.files.end(), page_->written()) == summary_.files.end())
      summary_.files.push_back(page_->written());
  } catch (const std::exception& error) {
    try {
      summary_.notices.push_back(fmt::format("the page of the run was not written: {}", error.what()));
    } catch (...) {  // no memory for it
    }
  } catch (...) {
  }
}

}  // namespace espalier::dynamics::model
