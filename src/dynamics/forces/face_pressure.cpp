#include "dynamics/forces/face_pressure.hpp"

namespace espalier::dynamics {

void FacePressure::declare(PatternBuilder& w, PatternBuilder& /*phi_q*/) const {
  faces_->declare(w);
  pressure_.declare(faces_->rows(), w);
}

void FacePressure::bind(const SparsePattern& w, const SparsePattern& /*phi_q*/) {
  faces_->bind(w);
  pressure_.bind(faces_->rows(), w);
}

void FacePressure::declare_multipliers(PatternBuilder& f_lambda) const {
  pressure_.declare_multipliers(faces_->rows(), f_lambda);
}

void FacePressure::bind_multipliers(const SparsePattern& f_lambda) {
  pressure_.bind_multipliers(faces_->rows(), f_lambda);
}

std::vector<double> FacePressure::slope(ConstSpan q) const {
  std::vector<double> result = faces_->slope(q);
  for (double& x : result) x *= load_factor();
  return result;
}

void FacePressure::residual(const StateView& s, Span f) {
  if (!active_) return;
  const double p = function()->value(s);
  const std::vector<double> unit = slope(s.q);
  const std::vector<Index>& rows = faces_->rows();
  for (std::size_t i = 0; i < rows.size(); ++i) f[at(rows[i])] += p * unit[i];
}

void FacePressure::tangent(const StateView& s, const TangentWeights& weights, Span w_values) {
  if (!active_) return;
  if (weights.q != 0) faces_->add_tangent(s.q, weights.q * factor() * function()->value(s), w_values);
  if (!function()->coordinates().empty()) pressure_.add_tangent(s, 0, slope(s.q), weights, w_values);
}

void FacePressure::multiplier_tangent(const StateView& s, Span values) {
  if (active_ && !function()->multipliers().empty()) pressure_.add_multiplier_tangent(s, 0, slope(s.q), values);
}

namespace {

class ActingPressure final : public CompositeFunction {
 public:
  explicit ActingPressure(const FacePressure& pressure) : CompositeFunction({pressure.function()}), of_(pressure) {}
  [[nodiscard]] double value(const StateView& s) const override { return of_.factor() * parts().front()->value(s); }

 protected:
  void add_gradient(const StateView& s, StateGradient& out) const override { add_part(s, 0, of_.factor(), out); }

 private:
  const FacePressure& of_;
};

}  // namespace

StateFunctionPtr pressure_of(const FacePressure& pressure) { return std::make_shared<ActingPressure>(pressure); }

}  // namespace espalier::dynamics
