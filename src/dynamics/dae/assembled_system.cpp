#include "dynamics/dae/assembled_system.hpp"

#include <algorithm>
#include <cmath>
#include <stdexcept>

#include "base/at.hpp"
#include "base/parallel.hpp"
#include "dynamics/dae/vectors.hpp"

namespace espalier::dynamics {

void AssembledSystem::insert(std::unique_ptr<Component> component) {
  Component& c = *component;
  if (pool_ != nullptr) c.set_pool(pool_);
  c.place({sizes_.configuration, sizes_.velocity, sizes_.constraints});
  const Sizes own = c.sizes();
  sizes_.configuration += own.configuration;
  sizes_.velocity += own.velocity;
  sizes_.constraints += own.constraints;
  if (own.velocity > 0) {
    const OwnCoordinates& coordinates = coordinates_.emplace_back(c);
    if (coordinates.is_vector_space()) extend(flat_, coordinates);
    if (!coordinates.has_magnitudes()) extend(plain_, coordinates);
    note(c, curved_);
    note(c, scaled_);
  }
  if (own.constraints > 0) {
    note(c, constraints_);
    if (constraints_.empty() || constraints_.back().component != &c)
      throw std::logic_error("\"" + c.name() + "\" has constraints, but is not one that Constrains");
  }
  note(c, remembering_);
  note(c, changing_);
  note(c, augmented_);
  note(c, reading_multipliers_);
  note(c, turning_);
  note(c, with_tasks_);
  on_device_.push_back(dynamic_cast<OnDevice*>(&c));
  components_.push_back(std::move(component));
}

void AssembledSystem::extend(std::vector<Range>& ranges, const OwnCoordinates& own) {
  if (!ranges.empty() && ranges.back().q + ranges.back().n == own.q() && ranges.back().v + ranges.back().n == own.v())
    ranges.back().n += own.count();
  else
    ranges.push_back({own.q(), own.v(), own.count()});
}

void AssembledSystem::set_pool(base::ThreadPool* pool) {
  pool_ = pool;
  for (const auto& c : components_) c->set_pool(pool);
}

void AssembledSystem::finish() {
  PatternBuilder w(sizes_.velocity, sizes_.velocity, true);
  PatternBuilder phi_q(sizes_.constraints, sizes_.velocity, false);
  w.add_diagonal();
  PatternBuilder f_lambda(sizes_.velocity, sizes_.constraints, true);
  declared_.clear();
  for (const auto& c : components_) {
    const Offset before = w.declared();
    c->declare(w, phi_q);
    declared_.push_back(w.declared() - before);
  }
  non_holonomic_.clear();
  for (const auto& [component, constrains] : constraints_)
    for (Index r = 0; r < component->sizes().constraints; ++r)
      if (constrains->non_holonomic(r)) non_holonomic_.push_back(component->placement().c + r);
  for (const auto& c : reading_multipliers_) c.with->declare_multipliers(f_lambda);
  w_pattern_ = w.build(pool_);
  phi_q_pattern_ = phi_q.build();
  f_lambda_pattern_ = f_lambda.build();
  for (const auto& c : components_) c->bind(w_pattern_, phi_q_pattern_);
  for (const auto& c : reading_multipliers_) c.with->bind_multipliers(f_lambda_pattern_);
  ++version_;
}

void AssembledSystem::initial(Span q, Span v) const {
  for (const auto& c : components_) c->initial(q, v);
}

void AssembledSystem::save(std::vector<double>& out) const {
  for (const auto& c : remembering_) c.with->save(out);
}

void AssembledSystem::restore(ConstSpan& in) {
  for (const auto& c : remembering_) c.with->restore(in);
}

namespace {

/// The one whose range of unknowns, which begin at first(it), contains the index.
template <class Owner, class First>
const Owner& owner(const std::vector<Owner>& owners, Index index, First first) {
  const auto it =
      std::upper_bound(owners.begin(), owners.end(), index, [&](Index i, const Owner& o) { return i < first(o); });
  if (it == owners.begin()) throw std::invalid_argument("no component owns index " + std::to_string(index));
  return *(it - 1);
}

}  // namespace

std::string AssembledSystem::constraint_name(Index row) const {
  const auto first = [](const Able<Constrains>& c) { return c.component->placement().c; };
  const auto& c = owner(constraints_, row, first);
  return c.with->constraint_name(row - first(c));
}

std::string AssembledSystem::coordinate_name(Index coordinate) const {
  const auto first = [](const OwnCoordinates& o) { return o.component().placement().v; };
  const OwnCoordinates& o = owner(coordinates_, coordinate, first);
  return o.component().coordinate_name(coordinate - first(o));
}

template <class Body>
void AssembledSystem::for_each_entry_of(const std::vector<Range>& ranges, const Body& body) const {
  for (const Range& r : ranges) for_each_entry(pool_, r.n, [&](std::size_t i) { body(r.q + i, r.v + i); });
}

void AssembledSystem::retract(ConstSpan q, ConstSpan dq, Span q_out) const {
  for_each_entry_of(flat_, [&](std::size_t in_q, std::size_t in_v) { q_out[in_q] = q[in_q] + dq[in_v]; });
  for (const auto& c : curved_) c.with->retract(q, dq, q_out);
}

void AssembledSystem::local(ConstSpan base, ConstSpan q, Span theta) const {
  for_each_entry_of(flat_, [&](std::size_t in_q, std::size_t in_v) { theta[in_v] = q[in_q] - base[in_q]; });
  for (const auto& c : curved_) c.with->local(base, q, theta);
}

void AssembledSystem::velocity_of_rate(ConstSpan theta, ConstSpan theta_dot, Span v) const {
  if (v.data() != theta_dot.data())
    for_each_entry_of(flat_, [&](std::size_t, std::size_t in_v) { v[in_v] = theta_dot[in_v]; });
  for (const auto& c : curved_) c.with->velocity_of_rate(theta, theta_dot, v);
}

void AssembledSystem::rate_of_velocity(ConstSpan theta, ConstSpan v, Span theta_dot) const {
  if (v.data() != theta_dot.data())
    for_each_entry_of(flat_, [&](std::size_t, std::size_t in_v) { theta_dot[in_v] = v[in_v]; });
  for (const auto& c : curved_) c.with->rate_of_velocity(theta, v, theta_dot);
}

void AssembledSystem::carry(ConstSpan theta, std::span<const Span> vectors) const {
  for (const auto& c : curved_) c.with->carry(theta, vectors);
}

void AssembledSystem::magnitude(ConstSpan q, Span out) const {
  for_each_entry_of(plain_, [&](std::size_t in_q, std::size_t in_v) { out[in_v] = std::abs(q[in_q]); });
  for (const auto& c : scaled_) c.with->magnitude(q, out);
}

namespace {

/// A singular position of a component is reported with the component's name.
template <class Call>
void evaluate(const Component& component, const Call& call) {
  try {
    call();
  } catch (const Error& error) {
    if (error.status().code != StatusCode::singular) throw;
    throw Error(StatusCode::singular, "\"" + component.name() + "\": " + error.what(), error.status().row);
  }
}

}  // namespace

// Where a GPU is at work on some, those on the host go first.
template <class Call>
void AssembledSystem::evaluate_all(bool on_device, const Call& call) {
  for (std::size_t k = 0; k < components_.size(); ++k)
    if (!on_device || !fits_device(k)) evaluate(*components_[k], [&] { call(*components_[k]); });
  if (!on_device) return;
  for (std::size_t k = 0; k < components_.size(); ++k)
    if (fits_device(k)) evaluate(*components_[k], [&] { call(*components_[k]); });
}

void AssembledSystem::residual(const StateView& s, Span f) {
  for (OnDevice* const c : on_device_)
    if (c != nullptr) c->start_residual(s);
  fill_zero(pool_, f);
  if (pool_ != nullptr) run_tasks(s, f);
  evaluate_all(!host_entries_.empty(), [&](Component& c) { c.residual(s, f); });
}

// What bodies with many elements do, all of them at a time: loops of their own would wake the threads up for each.
void AssembledSystem::run_tasks(const StateView& s, Span f) {
  constexpr std::int64_t kFew = 4;  // are done before others have woken up
  planned_.clear();
  std::array<std::int64_t, 2> all{};
  for (const auto& c : with_tasks_) {
    const HasTasks::Stages own = c.with->plan_residual(s);
    if (own.first == 0 && own.second == 0) continue;
    all = {all[0] + own.first, all[1] + own.second};
    planned_.push_back({c.with, all});
  }
  for (const std::size_t stage : {std::size_t{0}, std::size_t{1}})
    base::for_each(all[stage] <= kFew ? nullptr : pool_, all[stage], [&](std::int64_t task) {
      const auto it = std::upper_bound(planned_.begin(), planned_.end(), task,
                                       [&](std::int64_t t, const Planned& p) { return t < p.end[stage]; });
      const std::int64_t first = it == planned_.begin() ? 0 : (it - 1)->end[stage];
      it->component->residual_task(static_cast<int>(stage), task - first, f);
    });
}

// The constraints of many joints at the same time: each writes rows of its own.
void AssembledSystem::constraints(double t, ConstSpan q, ConstSpan v, const ConstraintBuffers& out) {
  constexpr Offset kManyOfPhi = 1 << 14;  // some 100 microseconds
  base::ThreadPool* const pool = phi_q_pattern_.nonzeros() < kManyOfPhi ? nullptr : pool_;
  base::for_each(pool, static_cast<std::int64_t>(constraints_.size()), [&](std::int64_t k) {
    const auto& c = constraints_[at(k)];
    evaluate(*c.component, [&] { c.with->constraints(t, q, v, out); });
  });
}

Energy AssembledSystem::energy(const StateView& s) {
  Energy sum;
  for (const auto& c : components_) {
    evaluate(*c, [&] {
      const Energy e = c->energy(s);
      sum.kinetic += e.kinetic;
      sum.potential += e.potential;
    });
  }
  return sum;
}

void AssembledSystem::update_pattern(ConstSpan q) {
  bool changed = false;
  for (const auto& c : changing_) changed = c.with->update_pattern(q) || changed;
  if (changed) finish();
}

void AssembledSystem::set_load_factor(double factor) {
  for (const auto& c : components_) c->set_load_factor(factor);
}

std::vector<BodyTurn> AssembledSystem::turns(ConstSpan from, ConstSpan to) const {
  std::vector<BodyTurn> all;
  for (const auto& c : turning_)
    if (const std::optional<BodyTurn> turn = c.with->turn(from, to)) all.push_back(*turn);
  return all;
}

void AssembledSystem::accept(const StateView& s) {
  for (const auto& c : remembering_) c.with->accept(s);
}

bool AssembledSystem::augment(const StateView& s) {
  bool changed = false;
  for (const auto& c : augmented_) changed = c.with->augment(s) || changed;
  return changed;
}

void AssembledSystem::tangent(const StateView& s, const TangentWeights& weights, Span w_values) {
  constexpr std::int64_t kEntries = 1 << 16;
  base::for_each_range(pool_, static_cast<std::int64_t>(w_values.size()), kEntries,
                       [&](auto begin, auto end) { std::fill(w_values.begin() + begin, w_values.begin() + end, 0.0); });
  for (OnDevice* const c : on_device_)
    if (c != nullptr) c->start_tangent(s, weights, nullptr);
  for (const auto& c : components_) evaluate(*c, [&] { c->tangent(s, weights, w_values); });
}

void AssembledSystem::tangent_on_device(const StateView& s, const TangentWeights& weights, double* device_values,
                                        Span w_values, const StateView* there) {
  for_each_entry(pool_, host_entries_.size(), [&](std::size_t e) { w_values[at(host_entries_[e])] = 0; });
  for (OnDevice* const c : on_device_) {
    if (c == nullptr) continue;
    if (there == nullptr)
      c->start_tangent(s, weights, device_values);
    else
      c->start_tangent_there(*there, weights, device_values);
  }
  evaluate_all(true, [&](Component& c) { c.tangent(s, weights, w_values); });
}

void AssembledSystem::residual_on_device(const StateView& s, const StateView& there, Span f, double* f_there) {
  for (OnDevice* const c : on_device_)
    if (c != nullptr) c->start_residual_there(there, f_there);
  for (const auto* list : {&share_->seen, &share_->own})
    for (const Index i : *list) f[at(i)] = 0;
  evaluate_all(true, [&](Component& c) { c.residual(s, f); });
}

void AssembledSystem::multiplier_tangent(const StateView& s, Span values) {
  std::fill(values.begin(), values.end(), 0.0);
  for (const auto& c : reading_multipliers_) evaluate(*c.component, [&] { c.with->multiplier_tangent(s, values); });
}

}  // namespace espalier::dynamics
