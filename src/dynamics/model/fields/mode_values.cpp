#include "dynamics/model/fields/mode_values.hpp"

#include <algorithm>
#include <cmath>

#include "base/at.hpp"

namespace espalier::dynamics::model {

ModeValues::ModeValues(Mechanism& mechanism, const State& state, const std::vector<Quantity>& quantities,
                       std::optional<double> load)
    : mechanism_(mechanism), state_(state), load_(load) {
  for (const Quantity& q : quantities) {
    if (q.field && q.name.find(".direction_") == std::string::npos) fields_.push_back(q);
    if (q.name.ends_with(".strain_energy")) energies_.push_back(q);
  }
  if (fields_.empty() && energies_.empty()) return;
  linearised_.mass = tangent_matrices(mechanism.system, state).mass;
  linearised_.n = linearised_.mass.cols;
  observer_ = std::make_unique<HarmonicObserver>(mechanism, state_, linearised_, fields_,
                                                 std::vector<std::vector<DrivenNumber>>{}, 1.0, load);
}

// Half the second derivative along the shape.
double ModeValues::energy(const Quantity& q, const std::vector<double>& shape, double step) const {
  const auto value = [&](double by) {
    State s = state_;
    std::vector<double> way = shape;
    for (double& x : way) x *= by;
    mechanism_.system.retract(state_.q, way, s.q);
    Sample sample{&s, {}};
    sample.load = load_;
    return q.value(sample);
  };
  return (value(step) + value(-step) - 2 * value(0)) / (2 * step * step);
}

void ModeValues::add(const std::vector<double>& shape, SimulationMode& mode) const {
  if (observer_ == nullptr) return;
  const SparseMatrix& m = linearised_.mass;
  double mass = 0;
  for (Index j = 0; j < m.cols; ++j)
    for (Offset k = m.col_ptr[at(j)]; k < m.col_ptr[at(j) + 1]; ++k)
      mass += shape[at(m.row_ind[at(k)])] * m.values[at(k)] * shape[at(j)];
  if (!(mass > 0)) return;
  std::vector<double> unit = shape;
  for (double& x : unit) x /= std::sqrt(mass);
  State moved = state_;
  moved.v = unit;
  Scene scene(mechanism_);
  const double extent = scene.extent_over_speed(moved);  // places it, too
  for (std::size_t k = 0; k < scene.velocity().size(); k += 3)
    mode.displacement =
        std::max(mode.displacement, std::hypot(scene.velocity()[k], scene.velocity()[k + 1], scene.velocity()[k + 2]));
  const std::vector<std::complex<double>> x(unit.begin(), unit.end());
  std::vector<std::complex<double>> y(fields_.size());
  observer_->observe(0, -1, x.data(), y.data());
  for (std::size_t i = 0; i < fields_.size(); ++i) mode.values.emplace_back(fields_[i].name, y[i].real());
  constexpr double kShareOfExtent = 1e-6;  // of the extent: slender bodies stretch with the square of their turns
  for (const Quantity& q : energies_)
    mode.values.emplace_back(q.name, energy(q, unit, kShareOfExtent * (extent > 0 ? extent : 1)));
}

}  // namespace espalier::dynamics::model
