// The adjoint methods of a sensitivity run.
#include <algorithm>
#include <cmath>

#include "base/stage.hpp"
#include "dynamics/model/derivatives/motion_adjoint.hpp"
#include "dynamics/model/derivatives/sensitivity_run.hpp"
#include "dynamics/model/derivatives/static_adjoint.hpp"

namespace espalier::dynamics::model {

bool SensitivityRun::differentiate_backward() {
  constexpr double kExact = 1e-4;
  Mechanism& mechanism = nominal_->mechanism();
  Options solver;
  solver.threads = mechanism.pool.size();
  const double load = nominal_->time();
  StaticAdjoint adjoint(mechanism, nominal_->equations(), nominal_->state(), quantities_, load, solver);
  if (method_ == SensitivityMethod::automatic && !(adjoint.defect() <= kExact)) return false;
  result_.t = {load};
  result_.values = adjoint.values(quantities_);
  result_.adjoint = true;
  result_.defect = adjoint.defect();
  result_.derivatives.assign(quantities_.size() * given_.size(), 0.0);
  base::Stage stage("derivatives", static_cast<double>(given_.size()), "parameters");
  for (std::size_t p = 0; p < given_.size(); ++p, stage.add(1)) {
    std::vector<double> residual[2], values[2];
    for (int a = 0; a < 2; ++a)
      with_end(given_[p], a, [&](const Description& model) {
        const std::unique_ptr<Mechanism> side = build(model, mechanism.pool.size());
        compare(*side, given_[p].path);
        State start(side->system.sizes());
        side->system.initial(start.q, start.v);
        side->system.set_load_factor(load);
        std::vector<Quantity> quantities;
        for (const Quantity& q : quantities_)
          for (Quantity& found : find_quantities(*side, q.name, {})) quantities.push_back(std::move(found));
        residual[a] = adjoint.residual(*side);
        values[a] = adjoint.values(quantities);
      });
    const double over = 1 / (2 * given_[p].step());
    for (std::size_t i = 0; i < residual[0].size(); ++i) residual[1][i] = over * (residual[1][i] - residual[0][i]);
    const std::vector<double> through = adjoint.along(residual[1]);
    for (std::size_t q = 0; q < quantities_.size(); ++q)
      result_.derivatives[q * given_.size() + p] = over * (values[1][q] - values[0][q]) - through[q];
  }
  return true;
}

void SensitivityRun::differentiate_motion_backward() {
  Mechanism& mechanism = nominal_->mechanism();
  MotionRecord record(mechanism);
  std::vector<double> t, values;
  const auto add = [&](int order) {
    const State& state = nominal_->state();
    record.add(state, order);
    t.push_back(state.t);
    for (const Quantity& q : quantities_) values.push_back(q.value(Sample{&state, {}}));
  };
  add(0);
  nominal_->run([&](const SimulationStep& step) {
    add(step.order);
    return true;
  });
  const std::size_t last = record.size() - 1, nq = quantities_.size();
  std::vector<double> slopes;
  if (objective_) slopes = slopes_of_objective(t, values);
  const std::size_t targets = objective_ ? 1 : nq;
  MotionAdjoint adjoint(mechanism, nominal_->equations().dropped(), record, quantities_);
  const auto weight = [&](std::size_t target, std::size_t step, std::size_t q) {
    return objective_ ? slopes[step * nq + q] : target == q && step == last ? 1.0 : 0.0;
  };
  const auto go_on = [this] {
    if (options_.interrupted && options_.interrupted())
      throw Error(StatusCode::cancelled, "the derivatives were interrupted on the way back");
  };
  adjoint.go_back(targets, weight, go_on);
  result_.t = {t.back()};
  if (!objective_) result_.values.assign(values.end() - static_cast<std::ptrdiff_t>(nq), values.end());
  result_.adjoint = true;
  result_.defect = adjoint.defect();
  result_.derivatives.assign(targets * given_.size(), 0.0);
  base::Stage stage("derivatives", static_cast<double>(given_.size()), "parameters");
  for (std::size_t p = 0; p < given_.size(); ++p, stage.add(1)) {
    go_on();
    std::vector<double> beside[2];
    for (int a = 0; a < 2; ++a) {
      SimulationSummary summary;
      const std::unique_ptr<Runner> side = beside_nominal(given_[p], a, summary);
      beside[a] = adjoint.lagrangian(side->mechanism(), side->state(), side->chosen());
    }
    for (std::size_t k = 0; k < targets; ++k)
      result_.derivatives[k * given_.size() + p] = (beside[1][k] - beside[0][k]) / (2 * given_[p].step());
  }
  check_by_other_runs();
}

std::vector<double> SensitivityRun::slopes_of_objective(const std::vector<double>& t,
                                                        const std::vector<double>& values) {
  std::vector<double> slopes(values.size(), 0.0);
  const double value = objective_(t, values, slopes);
  if (slopes.size() != values.size())
    throw Error(StatusCode::invalid_input,
                fmt::format("the objective gave {} slopes for {} values", slopes.size(), values.size()));
  if (!std::isfinite(value) || !std::all_of(slopes.begin(), slopes.end(), [](double x) { return std::isfinite(x); }))
    throw Error(StatusCode::invalid_input, "the objective, or one of its slopes, is no finite number");
  result_.quantities = {"objective"};
  result_.values = {value};
  return slopes;
}

void SensitivityRun::take_objective() {
  if (!objective_) return;
  const std::vector<double> of_quantities = std::move(result_.derivatives);
  const std::vector<double> slopes = slopes_of_objective(result_.t, std::vector<double>(result_.values));
  const std::size_t np = given_.size();
  result_.derivatives.assign(np, 0.0);
  for (std::size_t q = 0; q < slopes.size(); ++q)
    for (std::size_t p = 0; p < np; ++p) result_.derivatives[p] += slopes[q] * of_quantities[q * np + p];
}

}  // namespace espalier::dynamics::model
