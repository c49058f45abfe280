#include "dynamics/bodies/flexible_body.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <utility>

#include "base/at.hpp"
#include "base/parallel.hpp"
#include "base/stopwatch.hpp"
#include "dense/dense.hpp"
#include "dynamics/dae/vectors.hpp"

namespace espalier::dynamics {
namespace {

constexpr std::int64_t kVerticesPerRange = 2048;  // vertices per range of a threaded loop over vertices

using base::Stopwatch;

}  // namespace

FlexibleBody::FlexibleBody(std::string name, int vertices_per_node, std::vector<double> reference,
                           std::vector<std::unique_ptr<ElementGroup>> groups, base::ThreadPool* pool)
    : Component(std::move(name)),
      vertices_per_node_(vertices_per_node),
      reference_(std::move(reference)),
      initial_position_(reference_),
      initial_velocity_(reference_.size(), 0.0),
      extent_(largest_extent()),
      assembly_(static_cast<Index>(reference_.size() / 3), std::move(groups), pool),
      mass_(assembly_.mass(reference_.data(), pool)),
      weight_(reference_.size(), 0.0) {
  set_pool(pool);
  const VertexPattern& p = assembly_.pattern();
  const auto massless = reduce_blocks<Index>(
      pool, at(vertices()),
      [&](std::size_t begin, std::size_t end) {  // one after the first in the block; 0: none
        for (auto v = static_cast<Index>(begin); v < static_cast<Index>(end); ++v)
          if (!(mass_[at(p.entry(v, v))] > 0)) return v + 1;
        return 0;
      },
      [](Index& first, Index next) { first = first > 0 ? first : next; });
  if (massless > 0)
    throw Error(StatusCode::invalid_input,
                fmt::format("flexible body '{}': node {} has no mass (no element uses it, or the density is 0)",
                            this->name(), (massless - 1) / vertices_per_node_ + 1));
}

void FlexibleBody::set_gravity(const Point& gravity) {
  gravity_ = gravity;
  const VertexPattern& p = assembly_.pattern();
  std::fill(weight_.begin(), weight_.end(), 0.0);
  for_ranges_of_vertices([&](std::int64_t begin, std::int64_t end) {
    for (std::int64_t b = begin; b < end; ++b)
      for (Offset e = p.ptr[at(b)]; e < p.ptr[at(b) + 1]; ++e)
        if (is_position(p.ind[at(e)]))
          for (std::size_t i = 0; i < 3; ++i) weight_[3 * at(b) + i] += mass_[at(e)] * gravity[i];
  });
}

void FlexibleBody::set_failed(std::vector<char> failed) {
  assembly_.set_failed(std::move(failed), pool());
  mass_ = assembly_.mass(reference_.data(), pool());
  set_gravity(gravity_);
}

void FlexibleBody::set_initial_motion(const std::array<double, 9>& r, const Point& translation, const Point& velocity,
                                      const Point& w) {
  for (Index v = 0; v < assembly_.vertices(); ++v) {
    const double* from = reference_.data() + 3 * v;
    double* x = initial_position_.data() + 3 * v;
    double* rate = initial_velocity_.data() + 3 * v;
    const double shift = is_position(v) ? 1 : 0;
    for (std::size_t i = 0; i < 3; ++i)
      x[i] = r[3 * i] * from[0] + r[3 * i + 1] * from[1] + r[3 * i + 2] * from[2] + shift * translation[i];
    for (std::size_t i = 0; i < 3; ++i) {
      const std::size_t j = (i + 1) % 3, k = (i + 2) % 3;
      rate[i] = shift * velocity[i] + w[j] * x[k] - w[k] * x[j];
    }
  }
}

MassProperties FlexibleBody::mass_properties(ConstSpan q, ConstSpan v) const {
  const VertexPattern& p = assembly_.pattern();
  const double* x = q.data() + placement().q;
  const double* rate = v.empty() ? nullptr : v.data() + placement().v;
  MassProperties result;
  for (Index b = 0; b < assembly_.vertices(); ++b)
    for (Offset e = p.ptr[at(b)]; e < p.ptr[at(b) + 1]; ++e) {
      const Index a = p.ind[at(e)];
      const double m = mass_[at(e)];
      const double* xa = x + 3 * a;
      const double* vb = rate == nullptr ? nullptr : rate + 3 * b;
      if (is_position(a) && is_position(b)) result.mass += m;
      for (std::size_t i = 0; i < 3; ++i) {
        const std::size_t j = (i + 1) % 3, k = (i + 2) % 3;
        if (is_position(b)) result.centre[i] += m * xa[i];
        if (vb == nullptr) continue;
        if (is_position(a)) result.momentum[i] += m * vb[i];
        result.angular_momentum[i] += m * (xa[j] * vb[k] - xa[k] * vb[j]);
      }
    }
  for (double& c : result.centre) c /= result.mass;
  return result;
}

Sizes FlexibleBody::sizes() const {
  const Index n = static_cast<Index>(reference_.size());
  return {n, n, 0};
}

std::string FlexibleBody::coordinate_name(Index local) const {
  static constexpr std::array<const char*, 4> kVertex = {"position", "gradient 1", "gradient 2", "gradient 3"};
  const Index vertex = local / 3;
  return fmt::format("{} of node {} of '{}', {}", kVertex[at(vertex % vertices_per_node_)],
                     vertex / vertices_per_node_ + 1, name(), "xyz"[local % 3]);
}

void FlexibleBody::initial(Span q, Span v) const {
  std::copy(initial_position_.begin(), initial_position_.end(), q.begin() + placement().q);
  std::copy(initial_velocity_.begin(), initial_velocity_.end(), v.begin() + placement().v);
}

double FlexibleBody::largest_extent() const {
  if (reference_.empty()) return 0;
  double low[3], high[3];
  for (std::size_t i = 0; i < 3; ++i) low[i] = high[i] = reference_[i];
  for (std::size_t v = 0; 3 * v < reference_.size(); v += at(vertices_per_node_))
    for (std::size_t i = 0; i < 3; ++i) {
      low[i] = std::min(low[i], reference_[3 * v + i]);
      high[i] = std::max(high[i], reference_[3 * v + i]);
    }
  return std::max({high[0] - low[0], high[1] - low[1], high[2] - low[2]});
}

/// Positions are measured by the size of the body, not by the distance from the origin; gradients by 1.
void FlexibleBody::magnitude(ConstSpan, Span out) const {
  double* own = out.data() + placement().v;
  for_each_entry(pool(), reference_.size(),
                 [&](std::size_t i) { own[i] = is_position(static_cast<Index>(i / 3)) ? extent_ : 1.0; });
}

std::optional<BodyTurn> FlexibleBody::turn(ConstSpan from, ConstSpan to) const {
  constexpr double kLine = 1e-6;  // second singular value over the first
  const double *x = from.data() + placement().q, *y = to.data() + placement().q;
  const auto point = [](const double* p, std::size_t v) { return Eigen::Map<const Eigen::Vector3d>(p + 3 * v); };
  struct Sums {
    Eigen::Matrix3d first = Eigen::Matrix3d::Zero(), second = first;
  };
  const auto sum_over_vertices = [&](const auto& add) {
    return reduce_blocks<Sums>(
        pool(), at(vertices()),
        [&](std::size_t begin, std::size_t end) {
          Sums sums;
          for (std::size_t v = begin; v < end; ++v) add(sums, v, is_position(static_cast<Index>(v)));
          return sums;
        },
        [](Sums& all, const Sums& next) {
          all.first += next.first;
          all.second += next.second;
        });
  };
  const Sums means = sum_over_vertices([&](Sums& s, std::size_t v, bool position) {
    if (!position) return;
    s.first.col(0) += point(x, v) / nodes();
    s.first.col(1) += point(y, v) / nodes();
  });
  const Eigen::Vector3d x_mean = means.first.col(0), y_mean = means.first.col(1);
  const auto [positions, gradients] = sum_over_vertices([&](Sums& s, std::size_t v, bool position) {
    if (position)
      s.first += (point(y, v) - y_mean) * (point(x, v) - x_mean).transpose();
    else
      s.second += point(y, v) * point(x, v).transpose();
  });
  // Gradients have no unit: they count as points at a tenth of the size of the body.
  const double square = positions.cwiseAbs().maxCoeff() / nodes();
  const auto [r, singular] = dense::nearest_rotation(positions + 0.01 * square * gradients);
  if (!(singular[1] > kLine * singular[0])) return {};
  if (!r.allFinite()) return {};
  BodyTurn turn{placement().v, vertices(), {}};
  for (Index i = 0; i < 9; ++i) turn.rotation[at(i)] = r(i / 3, i % 3);
  return turn;
}

void FlexibleBody::declare(PatternBuilder& w, PatternBuilder&) const {
  w.add_vertex_pairs(placement().v, assembly_.pattern().ptr, assembly_.pattern().ind);
}

void FlexibleBody::bind(const SparsePattern& w, const SparsePattern&) {
  const VertexPattern& p = assembly_.pattern();
  column_start_.resize(reference_.size());
  shift_.resize(3 * p.ind.size());
  for_ranges_of_vertices([&](std::int64_t begin, std::int64_t end) {
    for (auto b = static_cast<Index>(begin); b < end; ++b)
      for (Index j = 0; j < 3; ++j) {
        const Index column = coordinate(b) + j;
        const Offset start = w.ptr[at(column)];
        column_start_[at(3 * b + j)] = start;
        Offset k = start;  // both lists rise
        for (Offset e = p.ptr[at(b)]; e < p.ptr[at(b) + 1]; ++e) {
          while (w.ind[at(k)] != coordinate(p.ind[at(e)])) ++k;
          shift_[at(3 * e + j)] = static_cast<std::int32_t>(k - start);
        }
      }
  });
}

AssemblyState FlexibleBody::state(const StateView& s) const {
  const bool damped = damping_.stiffness != 0 && !s.v.empty();
  return {reference_.data(), s.q.data() + placement().q, damped ? s.v.data() + placement().v : nullptr,
          damping_.stiffness};
}

template <class Body>
void FlexibleBody::for_ranges_of_vertices(const Body& body) const {
  base::for_each_range(pool(), assembly_.vertices(), kVerticesPerRange, body);
}

bool FlexibleBody::fits_device() const {
  bool all = !elements_fail_ && (vertices_per_node_ == 1 || assembly_.elements() >= fewest_on_device_);
  assembly_.for_each_group(
      [&](const ElementGroup& group, std::span<const Index>) { all = all && group.device_law() != nullptr; });
  return all;
}

void FlexibleBody::use_device(DeviceAssembly& device, std::span<const Offset> k_ptr) {
  DeviceBodyTables tables;
  assembly_.for_each_group([&](const ElementGroup& group, std::span<const Index> vertices) {
    tables.groups.push_back({*group.device_law(), group.vertices_per_element(), {vertices.begin(), vertices.end()}});
  });
  tables.first = placement().v;
  tables.reference = reference_;
  tables.pattern = &assembly_.pattern();
  tables.mass = mass_;
  tables.weight = weight_;
  tables.mass_damping = damping_.mass;
  tables.stiffness_damping = damping_.stiffness;
  device_ = device.make_body(tables);
  device_->bind(k_ptr.subspan(at(placement().v), reference_.size()), shift_);
}

BodyState FlexibleBody::own(const StateView& s) const {
  return {s.q.data() + placement().q, s.v.empty() ? nullptr : s.v.data() + placement().v,
          s.a.empty() ? nullptr : s.a.data() + placement().v};
}

void FlexibleBody::start_residual(const StateView& s) {
  residual_started_ = residual_planned_ = false;  // what another component's failure has left behind is not taken
  if (device_ == nullptr) return;
  device_->start_forces(own(s));
  residual_started_ = true;
  forces_stay_ = false;
}

// What is there stands in the order of the velocity coordinates.
BodyState FlexibleBody::own_there(const StateView& there) const {
  const auto part = [&](ConstSpan x) { return x.empty() ? nullptr : x.data() + placement().v; };
  return {part(there.q), part(there.v), part(there.a), true};
}

void FlexibleBody::start_residual_there(const StateView& there, double* f_there) {
  residual_started_ = residual_planned_ = false;
  if (device_ == nullptr) return;
  device_->start_forces(own_there(there));
  device_->put_forces(load_factor(), f_there + placement().v);
  residual_started_ = forces_stay_ = true;
}

void FlexibleBody::start_tangent_there(const StateView& there, const TangentWeights& weights, double* device_values) {
  tangent_started_ = false;
  if (device_ == nullptr) return;
  device_->start_tangent(own_there(there), weights, device_values);
  tangent_started_ = true;
}

void FlexibleBody::start_tangent(const StateView& s, const TangentWeights& weights, double* device_values) {
  tangent_started_ = false;
  if (device_ == nullptr || device_values == nullptr) return;
  device_->start_tangent(own(s), weights, device_values);
  tangent_started_ = true;
}

/// f += M (a + alpha v) - M g of the vertices
void FlexibleBody::add_inertia(ElementAssembly::VertexRange range, const double* a, const double* v, double* f) const {
  const VertexPattern& p = assembly_.pattern();
  const double alpha = v == nullptr ? 0.0 : damping_.mass, load = load_factor();
  for (Index b = range.first; b < range.last; ++b) {
    double sum[3] = {};
    for (Offset e = p.ptr[at(b)]; e < p.ptr[at(b) + 1] && (a != nullptr || alpha != 0); ++e)
      for (std::size_t i = 0; i < 3; ++i) {
        const std::size_t from = 3 * at(p.ind[at(e)]) + i;
        sum[i] += mass_[at(e)] * ((a == nullptr ? 0.0 : a[from]) + (alpha == 0 ? 0.0 : alpha * v[from]));
      }
    for (std::size_t i = 0; i < 3; ++i) f[3 * at(b) + i] += sum[i] - load * weight_[3 * at(b) + i];
  }
}

HasTasks::Stages FlexibleBody::plan_residual(const StateView& s) {
  residual_planned_ = false;
  if (residual_started_) return {};
  planned_ = own(s);
  assembly_.begin_forces(state(s));
  residual_planned_ = true;
  return {assembly_.element_tasks(), assembly_.vertex_tasks()};
}

void FlexibleBody::residual_task(int stage, std::int64_t task, Span f) {
  if (stage == 0) return assembly_.run_element_task(task);
  double* to = f.data() + placement().v;
  add_inertia(assembly_.run_vertex_task(task, to), planned_.a, planned_.v, to);
}

void FlexibleBody::residual(const StateView& s, Span f) {
  const Stopwatch watch(times_.force_seconds);
  ++times_.forces;
  if (std::exchange(residual_started_, false)) {
    double* to = f.data() + placement().v;
    inverted_ =
        assembly_.label(forces_stay_ ? device_->finish() : device_->finish_forces(load_factor(), weight_.data(), to));
    return;
  }
  if (!std::exchange(residual_planned_, false)) {  // nobody has run the tasks
    const Stages stages = plan_residual(s);
    base::for_each(pool(), stages.first, [&](std::int64_t task) { residual_task(0, task, f); });
    base::for_each(pool(), stages.second, [&](std::int64_t task) { residual_task(1, task, f); });
    residual_planned_ = false;
  }
  inverted_ = assembly_.end_forces(nullptr);
}

void FlexibleBody::tangent(const StateView& s, const TangentWeights& weights, Span w_values) {
  const Stopwatch watch(times_.tangent_seconds);
  ++times_.tangents;
  if (std::exchange(tangent_started_, false)) {
    inverted_ = assembly_.label(device_->finish());
    return;
  }
  const BlockTarget target{w_values.data(), column_start_.data(), shift_.data()};
  const VertexPattern& p = assembly_.pattern();
  const double mass_weight = weights.a + damping_.mass * weights.v;
  const auto add_mass = [&](std::int64_t begin, std::int64_t end) {
    for (auto b = static_cast<Index>(begin); b < end; ++b)
      for (Offset e = p.ptr[at(b)]; e < p.ptr[at(b) + 1]; ++e)
        for (int j = 0; j < 3; ++j) target.place(b, e, j)[j] += mass_weight * mass_[at(e)];
  };
  if (mass_weight != 0) for_ranges_of_vertices(add_mass);
  const bool rates = weights.v != 0 && damping_.stiffness != 0;
  if (weights.q == 0 && !rates) return;
  inverted_ = assembly_.add_tangent(pool(), state(s), weights.q, weights.v, target);
}

Energy FlexibleBody::energy(const StateView& s) {
  Energy result;
  const std::size_t n = reference_.size();
  std::vector<double> scratch(n, 0.0);
  static_cast<void>(assembly_.add_forces(pool(), state(s), scratch.data(), result.potential));
  const double* q = s.q.data() + placement().q;
  result.potential -= load_factor() * sum_of(pool(), n, [&](std::size_t i) { return weight_[i] * q[i]; });
  if (s.v.empty()) return result;
  const double* v = s.v.data() + placement().v;
  const VertexPattern& p = assembly_.pattern();
  const double twice = sum_of(pool(), at(vertices()), [&](std::size_t b) {
    double sum = 0;
    for (Offset e = p.ptr[b]; e < p.ptr[b + 1]; ++e)
      for (std::size_t i = 0; i < 3; ++i) sum += mass_[at(e)] * v[3 * at(p.ind[at(e)]) + i] * v[3 * b + i];
    return sum;
  });
  result.kinetic = 0.5 * twice;
  return result;
}

}  // namespace espalier::dynamics
