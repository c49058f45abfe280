#include "dynamics/integrators/shared_vectors.hpp"

#include <algorithm>
#include <vector>

namespace espalier::dynamics {

namespace {
template <class Numbers>
auto part_of(Numbers& x, Index first, Index count) {
  return std::span(x).subspan(at(first), at(count));
}

/// Where these vectors lie.
std::vector<const double*> places_of(const MotionArrays& arrays, std::initializer_list<MotionVector> vectors) {
  std::vector<const double*> places;
  for (const MotionVector vector : vectors) places.push_back(arrays.*vector);
  return places;
}
}  // namespace

bool SharedVectors::enter(const MotionDemand& demand) {
  on_device_ = equations_.claim_motion(demand, ticket_) != nullptr;
  return on_device_;
}

void SharedVectors::give_up(const Error& error) {
  leave();
  if (memory() != nullptr) equations_.give_motion_up(error);
}

StateView SharedVectors::state(const State& trial) const {
  const MotionArrays& s = device_motion().arrays();
  return {trial.t, ConstSpan(s.q, size()), ConstSpan(s.v, size()), ConstSpan(s.a, size()), trial.lambda};
}

void SharedVectors::send(const MotionArrays& here, std::span<const MotionVector> vectors) const {
  for (const MotionVector vector : vectors)
    device_motion().send(ConstSpan(here.*vector, size()), device_motion().arrays().*vector);
}

void SharedVectors::send_position(ConstSpan q, double* to) const {
  for (const DeviceShare::Range& r : share().ranges) device_motion().send(part_of(q, r.q, r.count), to + r.v);
}

void SharedVectors::fetch_position(const double* from, Span q) const {
  for (const DeviceShare::Range& r : share().ranges) device_motion().fetch(from + r.v, part_of(q, r.q, r.count));
}

void SharedVectors::fetch(const double* from, Span x) const {
  for (const DeviceShare::Range& r : share().ranges) device_motion().fetch(from + r.v, part_of(x, r.v, r.count));
}

void SharedVectors::fetch_state(State& trial) const {
  const MotionArrays& s = device_motion().arrays();
  fetch_position(s.q, trial.q);
  fetch(s.v, trial.v);
  fetch(s.a, trial.a);
}

double SharedVectors::largest_of_bodies(ConstSpan x) const {
  double largest = 0;
  for (const DeviceShare::Range& r : share().ranges)
    largest = std::max(largest, max_norm(equations_.pool(), part_of(x, r.v, r.count)));
  return largest;
}

void SharedVectors::put_right_side(const MotionArrays& here, MotionVector vector) const {
  const double* const from = here.*vector;
  std::vector<double> values;
  for (const Index i : share().own) values.push_back(from[i]);
  values.insert(values.end(), from + size(), from + size() + equations_.sizes().constraints);
  device_motion().set(DeviceMotion::List::right_side, values, device_motion().arrays().*vector);
}

void SharedVectors::take_right_sides(const MotionArrays& here, std::initializer_list<MotionVector> vectors) const {
  const std::vector<Index>& own = share().own;
  const auto m = at(equations_.sizes().constraints);
  ConstSpan values =
      device_motion().gather(DeviceMotion::List::right_side, places_of(device_motion().arrays(), vectors));
  for (const MotionVector vector : vectors) {
    double* const to = here.*vector;
    for (std::size_t k = 0; k < own.size(); ++k) to[at(own[k])] = values[k];
    std::copy_n(values.begin() + static_cast<std::ptrdiff_t>(own.size()), m, to + size());
    values = values.subspan(own.size() + m);
  }
}

MotionRecord SharedVectors::measure(const MotionArrays& here, const MotionMeasure& what) const {
  MotionRecord record = device_motion().measure(what);
  for (const Index i : share().own) what.add(here, at(i), record);
  return record;
}

void SharedVectors::fetch_for_host(const MotionArrays& here, State& trial,
                                   std::initializer_list<MotionVector> vectors) const {
  if (!on_device_) return;
  const DeviceShare& shared = share();
  ConstSpan values = device_motion().gather(DeviceMotion::List::seen, places_of(device_motion().arrays(), vectors));
  for (const MotionVector vector : vectors) {
    const bool is_q = vector == &MotionArrays::q;
    double* const to = is_q ? trial.q.data() : here.*vector;
    const std::vector<Index>& places = is_q ? shared.seen_q : shared.seen;
    for (std::size_t k = 0; k < places.size(); ++k) to[at(places[k])] = values[k];
    values = values.subspan(places.size());
  }
}

}  // namespace espalier::dynamics
