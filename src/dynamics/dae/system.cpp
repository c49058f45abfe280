#include "dynamics/dae/system.hpp"

#include <algorithm>
#include <cmath>
#include <functional>
#include <iterator>
#include <stdexcept>

#include "base/parallel.hpp"
#include "dynamics/dae/frame.hpp"
#include "dynamics/dae/vectors.hpp"

namespace espalier::dynamics {

Offset find_entry(const SparsePattern& pattern, Index major, Index minor) {
  const auto first = pattern.ind.begin() + pattern.ptr[static_cast<std::size_t>(major)];
  const auto last = pattern.ind.begin() + pattern.ptr[static_cast<std::size_t>(major) + 1];
  const auto it = std::lower_bound(first, last, minor);
  if (it == last || *it != minor) {
    throw std::logic_error("entry (" + std::to_string(major) + ", " + std::to_string(minor) +
                           ") was not declared in the pattern");
  }
  return it - pattern.ind.begin();
}

PatternBuilder::PatternBuilder(Index rows, Index cols, bool by_columns)
    : rows_(rows), cols_(cols), by_columns_(by_columns), lists_(static_cast<std::size_t>(by_columns ? cols : rows)) {}

void PatternBuilder::add(Index row, Index col) {
  if (row < 0 || col < 0) return;
  if (row >= rows_ || col >= cols_) throw std::logic_error("pattern entry outside of the matrix");
  auto& list = lists_[static_cast<std::size_t>(by_columns_ ? col : row)];
  // Duplicates are dropped when the list is about to grow, so memory stays within twice the final pattern.
  if (list.size() == list.capacity() && list.size() >= 32) {
    std::sort(list.begin(), list.end());
    list.erase(std::unique(list.begin(), list.end()), list.end());
    if (list.size() * 2 > list.capacity()) list.reserve(list.capacity() * 2);
  }
  ++declared_;
  list.push_back(by_columns_ ? row : col);
}

void PatternBuilder::add_block(std::span<const Index> rows, std::span<const Index> cols) {
  constexpr std::size_t kLong = 32;
  if (!by_columns_ || rows.size() < kLong) {
    for (const Index c : cols) {
      for (const Index r : rows) add(r, c);
    }
    return;
  }
  std::vector<Index> sorted;
  std::copy_if(rows.begin(), rows.end(), std::back_inserter(sorted), [](Index r) { return r >= 0; });
  const auto own = static_cast<Offset>(sorted.size());
  std::sort(sorted.begin(), sorted.end());
  sorted.erase(std::unique(sorted.begin(), sorted.end()), sorted.end());
  if (sorted.empty()) return;
  if (sorted.back() >= rows_) throw std::logic_error("pattern entry outside of the matrix");
  for (const Index c : cols) {
    if (c < 0) continue;
    if (c >= cols_) throw std::logic_error("pattern entry outside of the matrix");
    block_columns_.push_back({c, static_cast<Index>(blocks_.size())});
    declared_ += own;
  }
  blocks_.push_back(std::move(sorted));
}

void PatternBuilder::add_vertex_pairs(Index first, std::span<const Offset> ptr, std::span<const Index> ind) {
  if (ptr.size() < 2) return;
  if (!pairs_.empty() && first < pairs_.back().first + 3 * static_cast<Index>(pairs_.back().ptr.size() - 1))
    throw std::logic_error("columns of vertices were declared out of order");
  if (!by_columns_ || first < 0 || first + 3 * static_cast<Index>(ptr.size() - 1) > cols_)
    throw std::logic_error("pattern entry outside of the matrix");
  declared_ += 9 * static_cast<Offset>(ind.size());
  pairs_.push_back({first, ptr, ind});
}

// The vertices whose rows add_vertex_pairs() has declared in a column; they count from the first of its range.
std::span<const Index> PatternBuilder::vertices_of(Index major) const {
  const auto after = std::upper_bound(pairs_.begin(), pairs_.end(), major,
                                      [](Index column, const VertexPairs& p) { return column < p.first; });
  if (after == pairs_.begin()) return {};
  const VertexPairs& p = *(after - 1);
  const auto vertex = static_cast<std::size_t>(major - p.first) / 3;
  if (vertex + 1 >= p.ptr.size()) return {};
  return p.ind.subspan(static_cast<std::size_t>(p.ptr[vertex]),
                       static_cast<std::size_t>(p.ptr[vertex + 1] - p.ptr[vertex]));
}

// out := the minor indices of a major one, sorted and unique. @param blocks  all, by their columns
void PatternBuilder::collect(Index major, std::span<const BlockColumn> blocks, std::vector<Index>& out) const {
  const std::vector<Index>& list = lists_[static_cast<std::size_t>(major)];
  const std::span<const Index> vertices = vertices_of(major);
  out.clear();
  if (!vertices.empty()) {
    const Index first =
        std::prev(std::upper_bound(pairs_.begin(), pairs_.end(), major, [](Index column, const VertexPairs& p) {
          return column < p.first;
        }))->first;
    for (const Index v : vertices)
      for (Index i = 0; i < 3; ++i) out.push_back(first + 3 * v + i);
  }
  std::vector<Index> before;
  for (auto it = std::lower_bound(blocks.begin(), blocks.end(), BlockColumn{major, 0});
       it != blocks.end() && it->column == major; ++it) {
    const std::vector<Index>& rows = blocks_[static_cast<std::size_t>(it->block)];
    before.swap(out);
    out.clear();
    std::set_union(before.begin(), before.end(), rows.begin(), rows.end(), std::back_inserter(out));
  }
  const auto sorted = static_cast<std::ptrdiff_t>(out.size());
  out.insert(out.end(), list.begin(), list.end());
  if (diagonal_ && !std::binary_search(out.begin(), out.begin() + sorted, major)) out.push_back(major);
  if (sorted == static_cast<std::ptrdiff_t>(out.size())) return;
  std::sort(out.begin() + sorted, out.end());
  std::inplace_merge(out.begin(), out.begin() + sorted, out.end());
  out.erase(std::unique(out.begin(), out.end()), out.end());
}

// Counted first and then written where they stay: memory that is touched for the first time is what takes time here.
SparsePattern PatternBuilder::build(base::ThreadPool* pool) const {
  constexpr std::int64_t kLines = 1024;
  const auto lines = static_cast<std::int64_t>(lists_.size());
  std::vector<BlockColumn> blocks(block_columns_);
  std::sort(blocks.begin(), blocks.end());
  const auto for_lines = [&](const auto& body) {
    base::for_each_range(pool, lines, kLines, [&](std::int64_t begin, std::int64_t end) {
      std::vector<Index> line;
      for (std::int64_t k = begin; k < end; ++k) {
        collect(static_cast<Index>(k), blocks, line);
        body(static_cast<std::size_t>(k), line);
      }
    });
  };
  SparsePattern p{rows_, cols_, std::vector<Offset>(lists_.size() + 1, 0), {}};
  for_lines([&](std::size_t k, const std::vector<Index>& line) { p.ptr[k + 1] = static_cast<Offset>(line.size()); });
  for (std::size_t k = 0; k < lists_.size(); ++k) p.ptr[k + 1] += p.ptr[k];
  p.ind.resize(static_cast<std::size_t>(p.ptr.back()));
  for_lines([&](std::size_t k, const std::vector<Index>& line) {
    std::copy(line.begin(), line.end(), p.ind.begin() + p.ptr[k]);
  });
  return p;
}

// ---- System: defaults of a vector space

std::string System::constraint_name(Index row) const { return "constraint " + std::to_string(row); }
std::string System::coordinate_name(Index coordinate) const { return "coordinate " + std::to_string(coordinate); }

void System::retract(ConstSpan q, ConstSpan dq, Span q_out) const {
  for (std::size_t i = 0; i < q.size(); ++i) q_out[i] = q[i] + dq[i];
}

void System::local(ConstSpan base, ConstSpan q, Span theta) const {
  for (std::size_t i = 0; i < q.size(); ++i) theta[i] = q[i] - base[i];
}

void System::velocity_of_rate(ConstSpan /*theta*/, ConstSpan theta_dot, Span v) const {
  if (v.data() != theta_dot.data()) std::copy(theta_dot.begin(), theta_dot.end(), v.begin());
}

void System::rate_of_velocity(ConstSpan /*theta*/, ConstSpan v, Span theta_dot) const {
  if (v.data() != theta_dot.data()) std::copy(v.begin(), v.end(), theta_dot.begin());
}

void System::magnitude(ConstSpan q, Span out) const {
  for (std::size_t i = 0; i < q.size(); ++i) out[i] = std::abs(q[i]);
}

Energy System::energy(const StateView& /*s*/) { return {}; }

// ---- Component: defaults of a vector space on its own range

namespace {

struct Range {
  std::size_t q, v, n;
};

Range own_range(const Component& c) {
  return {static_cast<std::size_t>(c.placement().q), static_cast<std::size_t>(c.placement().v),
          static_cast<std::size_t>(c.sizes().velocity)};
}

}  // namespace

std::string Component::constraint_name(Index local_row) const {
  return "\"" + name_ + "\", equation " + std::to_string(local_row);
}

std::string Component::coordinate_name(Index local_coordinate) const {
  return "\"" + name_ + "\", coordinate " + std::to_string(local_coordinate);
}

void Component::initial(Span q, Span v) const {
  const Range o = own_range(*this);
  std::fill_n(q.begin() + at_.q, sizes().configuration, 0.0);
  std::fill_n(v.begin() + at_.v, o.n, 0.0);
}

void Component::retract(ConstSpan q, ConstSpan dq, Span q_out) const {
  const Range o = own_range(*this);
  for (std::size_t i = 0; i < o.n; ++i) q_out[o.q + i] = q[o.q + i] + dq[o.v + i];
}

void Component::local(ConstSpan base, ConstSpan q, Span theta) const {
  const Range o = own_range(*this);
  for (std::size_t i = 0; i < o.n; ++i) theta[o.v + i] = q[o.q + i] - base[o.q + i];
}

void Component::velocity_of_rate(ConstSpan /*theta*/, ConstSpan theta_dot, Span v) const {
  const Range o = own_range(*this);
  for (std::size_t i = 0; i < o.n; ++i) v[o.v + i] = theta_dot[o.v + i];
}

void Component::rate_of_velocity(ConstSpan /*theta*/, ConstSpan v, Span theta_dot) const {
  const Range o = own_range(*this);
  for (std::size_t i = 0; i < o.n; ++i) theta_dot[o.v + i] = v[o.v + i];
}

void Component::magnitude(ConstSpan q, Span out) const {
  const Range o = own_range(*this);
  for (std::size_t i = 0; i < o.n; ++i) out[o.v + i] = std::abs(q[o.q + i]);
}

void Component::constraints(double /*t*/, ConstSpan /*q*/, ConstSpan /*v*/, const ConstraintBuffers& /*out*/) {}
Energy Component::energy(const StateView& /*s*/) { return {}; }

// ---- AssembledSystem

void AssembledSystem::insert(std::unique_ptr<Component> component) {
  if (pool_ != nullptr) component->set_pool(pool_);
  component->place({sizes_.configuration, sizes_.velocity, sizes_.constraints});
  const Sizes own = component->sizes();
  sizes_.configuration += own.configuration;
  sizes_.velocity += own.velocity;
  sizes_.constraints += own.constraints;
  if (own.velocity > 0) {
    owners_of_coordinates_.push_back(component.get());
    if (!component->is_vector_space()) {
      curved_.push_back(component.get());
    } else {
      const Range r = own_range(*component);
      if (!flat_.empty() && flat_.back().q + flat_.back().n == r.q && flat_.back().v + flat_.back().n == r.v)
        flat_.back().n += r.n;
      else
        flat_.push_back({r.q, r.v, r.n});
    }
  }
  if (own.constraints > 0) owners_of_constraints_.push_back(component.get());
  components_.push_back(std::move(component));
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
  non_holonomic_.clear();
  for (const auto& c : components_) {
    for (Index r = 0; r < c->sizes().constraints; ++r)
      if (c->non_holonomic(r)) non_holonomic_.push_back(c->placement().c + r);
    const Offset before = w.declared();
    c->declare(w, phi_q);
    declared_.push_back(w.declared() - before);
    c->declare_multipliers(f_lambda);
  }
  w_pattern_ = w.build(pool_);
  phi_q_pattern_ = phi_q.build();
  f_lambda_pattern_ = f_lambda.build();
  for (const auto& c : components_) {
    c->bind(w_pattern_, phi_q_pattern_);
    c->bind_multipliers(f_lambda_pattern_);
  }
  ++version_;
}

void AssembledSystem::initial(Span q, Span v) const {
  for (const auto& c : components_) c->initial(q, v);
}

namespace {

/// The component whose range of `count(sizes)` unknowns starting at `first(placement)` contains the index.
template <class First>
const Component& owner(const std::vector<Component*>& owners, Index index, First first) {
  const auto it = std::upper_bound(owners.begin(), owners.end(), index,
                                   [&](Index i, const Component* c) { return i < first(c->placement()); });
  if (it == owners.begin()) throw std::invalid_argument("no component owns index " + std::to_string(index));
  return **(it - 1);
}

}  // namespace

std::string AssembledSystem::constraint_name(Index row) const {
  const Component& c = owner(owners_of_constraints_, row, [](const Placement& p) { return p.c; });
  return c.constraint_name(row - c.placement().c);
}

std::string AssembledSystem::coordinate_name(Index coordinate) const {
  const Component& c = owner(owners_of_coordinates_, coordinate, [](const Placement& p) { return p.v; });
  return c.coordinate_name(coordinate - c.placement().v);
}

template <class Body>
void AssembledSystem::for_each_flat(const Body& body) const {
  for (const FlatRange& r : flat_) for_each_entry(pool_, r.n, [&](std::size_t i) { body(r.q + i, r.v + i); });
}

void AssembledSystem::retract(ConstSpan q, ConstSpan dq, Span q_out) const {
  for_each_flat([&](std::size_t in_q, std::size_t in_v) { q_out[in_q] = q[in_q] + dq[in_v]; });
  for (const Component* c : curved_) c->retract(q, dq, q_out);
}

void AssembledSystem::local(ConstSpan base, ConstSpan q, Span theta) const {
  for_each_flat([&](std::size_t in_q, std::size_t in_v) { theta[in_v] = q[in_q] - base[in_q]; });
  for (const Component* c : curved_) c->local(base, q, theta);
}

void AssembledSystem::velocity_of_rate(ConstSpan theta, ConstSpan theta_dot, Span v) const {
  if (v.data() != theta_dot.data()) for_each_flat([&](std::size_t, std::size_t in_v) { v[in_v] = theta_dot[in_v]; });
  for (const Component* c : curved_) c->velocity_of_rate(theta, theta_dot, v);
}

void AssembledSystem::rate_of_velocity(ConstSpan theta, ConstSpan v, Span theta_dot) const {
  if (v.data() != theta_dot.data()) for_each_flat([&](std::size_t, std::size_t in_v) { theta_dot[in_v] = v[in_v]; });
  for (const Component* c : curved_) c->rate_of_velocity(theta, v, theta_dot);
}

void AssembledSystem::carry(ConstSpan theta, std::span<const Span> vectors) const {
  for (const Component* c : curved_) c->carry(theta, vectors);
}

void AssembledSystem::magnitude(ConstSpan q, Span out) const {
  for (const Component* c : owners_of_coordinates_) c->magnitude(q, out);
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

namespace {

/// Where a GPU is at work on some, those on the host go first.
template <class Call>
void evaluate_all(const std::vector<std::unique_ptr<Component>>& components, bool on_device, const Call& call) {
  for (const auto& c : components)
    if (!on_device || !c->fits_device()) evaluate(*c, [&] { call(*c); });
  for (const auto& c : components)
    if (on_device && c->fits_device()) evaluate(*c, [&] { call(*c); });
}

}  // namespace

void AssembledSystem::residual(const StateView& s, Span f) {
  for (const auto& c : components_) c->start_residual(s);
  fill_zero(pool_, f);
  if (pool_ != nullptr) run_tasks(s, f);
  evaluate_all(components_, !host_entries_.empty(), [&](Component& c) { c.residual(s, f); });
}

// What bodies with many elements do, all of them at a time: loops of their own would wake the threads up for each.
void AssembledSystem::run_tasks(const StateView& s, Span f) {
  constexpr std::int64_t kFew = 4;  // are done before others have woken up
  planned_.clear();
  std::array<std::int64_t, 2> all{};
  for (const auto& c : components_) {
    const Component::Stages own = c->plan_residual(s);
    if (own.first == 0 && own.second == 0) continue;
    all = {all[0] + own.first, all[1] + own.second};
    planned_.push_back({c.get(), all});
  }
  for (const std::size_t stage : {std::size_t{0}, std::size_t{1}})
    base::for_each(all[stage] <= kFew ? nullptr : pool_, all[stage], [&](std::int64_t task) {
      const auto it = std::upper_bound(planned_.begin(), planned_.end(), task,
                                       [&](std::int64_t t, const Planned& p) { return t < p.end[stage]; });
      const std::int64_t first = it == planned_.begin() ? 0 : (it - 1)->end[stage];
      it->component->residual_task(static_cast<int>(stage), task - first, f);
    });
}

// Those of many joints at the same time: each writes rows of its own.
void AssembledSystem::constraints(double t, ConstSpan q, ConstSpan v, const ConstraintBuffers& out) {
  constexpr Offset kManyOfPhi = 1 << 14;  // some 100 microseconds
  base::ThreadPool* const pool = phi_q_pattern_.nonzeros() < kManyOfPhi ? nullptr : pool_;
  base::for_each(pool, static_cast<std::int64_t>(owners_of_constraints_.size()), [&](std::int64_t k) {
    Component& constrained = *owners_of_constraints_[static_cast<std::size_t>(k)];
    evaluate(constrained, [&] { constrained.constraints(t, q, v, out); });
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
  for (const auto& c : components_) changed = c->update_pattern(q) || changed;
  if (changed) finish();
}

void AssembledSystem::set_load_factor(double factor) {
  for (const auto& c : components_) c->set_load_factor(factor);
}

std::vector<BodyTurn> AssembledSystem::turns(ConstSpan from, ConstSpan to) const {
  std::vector<BodyTurn> all;
  for (const auto& c : components_)
    if (const std::optional<BodyTurn> turn = c->turn(from, to)) all.push_back(*turn);
  return all;
}

void AssembledSystem::accept(const StateView& s) {
  for (const auto& c : components_) c->accept(s);
}

bool AssembledSystem::augment(const StateView& s) {
  bool changed = false;
  for (const auto& c : components_) changed = c->augment(s) || changed;
  return changed;
}

void AssembledSystem::tangent(const StateView& s, const TangentWeights& weights, Span w_values) {
  constexpr std::int64_t kEntries = 1 << 16;
  base::for_each_range(pool_, static_cast<std::int64_t>(w_values.size()), kEntries,
                       [&](auto begin, auto end) { std::fill(w_values.begin() + begin, w_values.begin() + end, 0.0); });
  for (const auto& c : components_) c->start_tangent(s, weights, nullptr);
  for (const auto& c : components_) evaluate(*c, [&] { c->tangent(s, weights, w_values); });
}

void AssembledSystem::tangent_on_device(const StateView& s, const TangentWeights& weights, double* device_values,
                                        Span w_values, const StateView* there) {
  for_each_entry(pool_, host_entries_.size(),
                 [&](std::size_t e) { w_values[static_cast<std::size_t>(host_entries_[e])] = 0; });
  for (const auto& c : components_)
    if (there == nullptr)
      c->start_tangent(s, weights, device_values);
    else
      c->start_tangent_there(*there, weights, device_values);
  evaluate_all(components_, true, [&](Component& c) { c.tangent(s, weights, w_values); });
}

void AssembledSystem::residual_on_device(const StateView& s, const StateView& there, Span f, double* f_there) {
  for (const auto& c : components_) c->start_residual_there(there, f_there);
  for (const auto* list : {&share_->seen, &share_->own})
    for (const Index i : *list) f[static_cast<std::size_t>(i)] = 0;
  evaluate_all(components_, true, [&](Component& c) { c.residual(s, f); });
}

void AssembledSystem::multiplier_tangent(const StateView& s, Span values) {
  std::fill(values.begin(), values.end(), 0.0);
  for (const auto& c : components_) evaluate(*c, [&] { c->multiplier_tangent(s, values); });
}

// ---- Frame

void Frame::wrench_stiffness(ConstSpan /*q*/, const Vec6& /*wrench*/, double /*scale*/, double* /*k*/) const {}

void Frame::tangent_columns(ConstSpan q, const TangentColumns& columns, double* out) const {
  const auto nd = static_cast<Eigen::Index>(coordinates().size()), count = static_cast<Eigen::Index>(columns.count);
  using SixRows = Eigen::Matrix<double, 6, Eigen::Dynamic>;
  SixRows j(6, nd);
  jacobian(q, j.data());
  Eigen::Map<Eigen::MatrixXd> result(out, nd, count);
  result.noalias() = j.transpose() * Eigen::Map<const SixRows>(columns.c, 6, count);
  if (!has_wrench_stiffness() || columns.wrench.isZero(0)) return;
  Eigen::MatrixXd stiffness = Eigen::MatrixXd::Zero(nd, nd);
  wrench_stiffness(q, columns.wrench, 1, stiffness.data());
  result += stiffness.middleCols(static_cast<Eigen::Index>(columns.first), count);
}

void Frame::project(ConstSpan q, const FrameMotion& /*motion*/, const double* c, int count, double* out) const {
  const std::size_t nd = coordinates().size();
  std::vector<double> j(6 * nd);
  jacobian(q, j.data());
  for (std::size_t r = 0; r < static_cast<std::size_t>(count); ++r) {
    for (std::size_t k = 0; k < nd; ++k) {
      double sum = 0;
      for (std::size_t i = 0; i < 6; ++i) sum += c[6 * r + i] * j[6 * k + i];
      out[r * nd + k] = sum;
    }
  }
}

void Frame::rate_jacobian(ConstSpan /*q*/, ConstSpan /*v*/, double* jv) const {
  std::fill_n(jv, 6 * coordinates().size(), 0.0);
}

void GroundFrame::motion(ConstSpan /*q*/, ConstSpan /*v*/, FrameMotion& out) const {
  out = FrameMotion{};
  out.r = r_;
  out.rot = rot_;
}

void GroundFrame::jacobian(ConstSpan /*q*/, double* /*j*/) const {}

}  // namespace espalier::dynamics
