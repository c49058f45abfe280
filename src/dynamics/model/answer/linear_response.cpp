#include "dynamics/model/answer/linear_response.hpp"

#include <algorithm>
#include <array>
#include <cmath>
#include <utility>

#include "dynamics/integrators/initial.hpp"

namespace espalier::dynamics::model {
namespace {

// The bound of the largest displacement, of the extent of the model, at the outermost point: strains of bent bodies are
// the square of that times slenderness, elements at a load many times as much.
constexpr double kOutermost = 1e-3;

// p(s) = sum c_j s^j through p(0) = 0 and p(1..4): c_1 and c_2 by divided differences.
constexpr std::array<double, 4> kFirst = {4, -3, 4.0 / 3, -1.0 / 4};
constexpr std::array<double, 4> kSecond = {-13.0 / 3, 19.0 / 4, -7.0 / 3, 11.0 / 24};

}  // namespace

LinearResponse::LinearResponse(System& system, const State& base, std::vector<double> dq, const Vector& lambda,
                               double load, std::function<void()> stiff)
    : system_(system), base_(base), dq_(std::move(dq)), lambda_(lambda), load_(load), stiff_(std::move(stiff)) {
  const Vector sizes = coordinate_sizes(system, base.q);
  for (std::size_t i = 0; i < dq_.size(); ++i) size_ = std::max(size_, std::abs(dq_[i]) / sizes[i]);
  std::fill(base_.lambda.begin(), base_.lambda.end(), 0.0);
  step_ = size_ > 0 ? kOutermost / 4 / size_ : 1;
  for (int k = 0; k <= 4; ++k) {
    State s = base_;
    Vector move = dq_;
    for (double& x : move) x *= k * step_;
    if (k > 0) system.retract(base_.q, move, s.q);
    for (std::size_t i = 0; i < s.lambda.size(); ++i) s.lambda[i] = k * step_ * lambda_[i];
    points_.push_back(std::move(s));
  }
}

LinearResponse::Vector LinearResponse::of(const std::function<Vector(const State&)>& g, double share) const {
  system_.set_load_factor(0);
  stiff_();
  const Vector rest = g(points_[0]);
  Vector slope(rest.size(), 0.0);
  for (std::size_t k = 1; k < points_.size(); ++k) {
    const Vector value = g(points_[k]);
    for (std::size_t i = 0; i < slope.size(); ++i) slope[i] += kFirst[k - 1] * (value[i] - rest[i]);
  }
  system_.set_load_factor(share * load_);
  Vector result = g(points_[0]);
  system_.set_load_factor(load_);
  for (std::size_t i = 0; i < slope.size(); ++i) result[i] += share * slope[i] / step_;
  return result;
}

double LinearResponse::of(const std::function<double(const State&)>& g) const {
  return of([&g](const State& s) { return Vector{g(s)}; })[0];
}

// The energy of a bent body grows with the fourth power of its turns, too, and takes nothing away from a larger number:
// a tenth of the steps.
double LinearResponse::energy(const std::function<double(const State&)>& g, double share) const {
  const double step = 0.1 * step_;
  system_.set_load_factor(share * load_);
  const double rest = g(points_[0]);
  double first = 0, second = 0;
  for (std::size_t k = 0; k < kFirst.size(); ++k) {
    State s = points_[0];
    Vector move = dq_;
    for (double& x : move) x *= static_cast<double>(k + 1) * step;
    system_.retract(base_.q, move, s.q);
    for (std::size_t i = 0; i < s.lambda.size(); ++i) s.lambda[i] = static_cast<double>(k + 1) * step * lambda_[i];
    const double change = g(s) - rest;
    first += kFirst[k] * change;
    second += kSecond[k] * change;
  }
  system_.set_load_factor(load_);
  return rest + share * first / step + share * share * second / (step * step);
}

State LinearResponse::displaced() const {
  State s = base_;
  system_.retract(base_.q, dq_, s.q);
  s.lambda = lambda_;
  return s;
}

}  // namespace espalier::dynamics::model
