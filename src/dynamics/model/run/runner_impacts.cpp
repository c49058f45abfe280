// What lets velocities jump, so that the motion begins anew: impacts of rigid bodies (contacts with law = "impulse"),
// elements that fail.
#include <fmt/format.h>

#include <cmath>
#include <span>

#include "dynamics/contact/impact.hpp"
#include "dynamics/integrators/initial.hpp"
#include "dynamics/model/erosion/erosion.hpp"
#include "dynamics/model/run/runner.hpp"

namespace espalier::dynamics::model {

// All contacts at once: bodies may strike with several of them.
void Runner::meet_impacts() {
  constexpr double kApart = 1e-13;
  constexpr long kMost = 10000;
  state_ = current();
  const bool same = std::abs(state_.t - impact_time_) <= kApart * std::abs(state_.t);
  impacts_there_ = same ? impacts_there_ + 1 : 0;
  impact_time_ = state_.t;
  if (impacts_there_ > kMost)
    throw Error(StatusCode::accuracy_not_reached,
                fmt::format("more than {} impacts at t = {:g}: time does not go on; a smaller restitution or stiffness "
                            "lets bodies come to rest",
                            kMost, state_.t));
  std::vector<contact::ImpactPoint> points;
  std::vector<std::size_t> first;
  for (contact::RigidContact* c : mechanism_->impacts) {
    first.push_back(points.size());
    c->add_impact_points(state_.view(), points);
  }
  first.push_back(points.size());
  contact::solve_impact(*equations_, state_, points);
  for (std::size_t k = 0; k < mechanism_->impacts.size(); ++k)
    mechanism_->impacts[k]->take_impact(std::span(points).subspan(first[k], first[k + 1] - first[k]));
  make_consistent(*equations_, state_);
  integrator_->start(state_);
  watch_from_here();
}

bool Runner::erode() {
  if (mechanism_->erosion == nullptr || !mechanism_->erosion->find_failing(current())) return false;
  state_ = current();
  mechanism_->erosion->fail(*equations_, state_);
  make_consistent(*equations_, state_);
  integrator_->start(state_);
  watch_from_here();
  return true;
}

void Runner::note_erosion() {
  if (mechanism_->erosion == nullptr) return;
  for (std::string& notice : mechanism_->erosion->notices()) summary_.notices.push_back(std::move(notice));
  if (equations_->kkt().gpu() >= 0)
    summary_.notices.emplace_back("bodies with elements that may fail (erosion) are evaluated on the host");
}

}  // namespace espalier::dynamics::model
