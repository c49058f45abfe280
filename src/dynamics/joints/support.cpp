#include "dynamics/joints/support.hpp"

#include <algorithm>

#include "base/at.hpp"
#include "dynamics/joints/joint.hpp"

namespace espalier::dynamics {
namespace {

Index node_place(const FlexibleBody& body, Index vertex) { return vertex - vertex % body.vertices_per_node(); }

/// Force on a row's vertices is -lambda e; that on a director or slope d turns its node by d x force.
class SupportReaction final : public VectorFunction {
 public:
  SupportReaction(const Support& support, bool moment) : support_(support), moment_(moment) {
    for (std::size_t r = 0; r < support.rows().size(); ++r)
      multipliers_.push_back(support.placement().c + static_cast<Index>(r));
    if (!moment) return;
    for (const Support::Row& row : support.rows())
      for (const Support::Term& part : row.parts) vertices_.push_back(part.vertex);
    vertices_.insert(vertices_.end(), support.places().begin(), support.places().end());
    std::sort(vertices_.begin(), vertices_.end());
    vertices_.erase(std::unique(vertices_.begin(), vertices_.end()), vertices_.end());
    for (const Index vertex : vertices_)
      for (Index i = 0; i < 3; ++i) coordinates_.push_back(support.body().coordinate(vertex) + i);
  }

  [[nodiscard]] Vec3 value(const StateView& s) const override {
    Vec3 sum = Vec3::Zero();
    const Vec3 centre = moment_ ? mean(s) : Vec3::Zero();
    for (std::size_t r = 0; r < support_.rows().size(); ++r)
      for (const Support::Term& part : support_.rows()[r].parts) {
        const Vec3 f = multiplier(s, r) * part.direction;
        if (moment_)
          sum += arm(s, part.vertex, centre).cross(f);
        else if (is_place(part.vertex))
          sum += f;
      }
    return sum;
  }

  Vec3 derivatives(const StateView& s, Derivatives& out) const override {
    clear(out);
    const Vec3 centre = moment_ ? mean(s) : Vec3::Zero();
    Vec3 total = Vec3::Zero();
    for (std::size_t r = 0; r < support_.rows().size(); ++r)
      for (const auto& [vertex, e] : support_.rows()[r].parts) {
        const auto column = static_cast<Eigen::Index>(r);
        if (!moment_) {
          if (is_place(vertex)) out.lambda.col(column) -= e;
          continue;
        }
        out.lambda.col(column) -= arm(s, vertex, centre).cross(e);
        const Vec3 f = multiplier(s, r) * e;
        add_turned(out, vertex, f);
        if (is_place(vertex)) total += f;
      }
    for (const Index place : support_.places())
      if (moment_) add_turned(out, place, -total / static_cast<double>(support_.places().size()));
    return value(s);
  }

 private:
  [[nodiscard]] bool is_place(Index vertex) const { return node_place(support_.body(), vertex) == vertex; }
  [[nodiscard]] Vec3 vertex_at(const StateView& s, Index vertex) const {
    return Eigen::Map<const Vec3>(s.q.data() + support_.body().configuration(vertex));
  }
  [[nodiscard]] double multiplier(const StateView& s, std::size_t r) const {
    return -s.lambda[at(support_.placement().c) + r];
  }
  [[nodiscard]] Vec3 arm(const StateView& s, Index vertex, const Vec3& centre) const {
    return vertex_at(s, vertex) - (is_place(vertex) ? centre : Vec3::Zero());
  }
  [[nodiscard]] Vec3 mean(const StateView& s) const {
    Vec3 sum = Vec3::Zero();
    for (const Index place : support_.places()) sum += vertex_at(s, place);
    return sum / static_cast<double>(support_.places().size());
  }
  /// d(x x f) by x.
  void add_turned(Derivatives& out, Index vertex, const Vec3& f) const {
    const auto k = std::lower_bound(vertices_.begin(), vertices_.end(), vertex) - vertices_.begin();
    for (int i = 0; i < 3; ++i) out.q.col(3 * k + i) += Vec3(Vec3::Unit(i)).cross(f);
  }

  const Support& support_;
  bool moment_;
  std::vector<Index> vertices_;  // those of coordinates_, ascending
};

}  // namespace

Support::Support(std::string name, const FlexibleBody& body, std::vector<Row> rows, std::vector<TimeFunction> motions)
    : Component(std::move(name)), body_(body), rows_(std::move(rows)), motions_(std::move(motions)) {
  for (const Row& row : rows_) places_.push_back(node_place(body, row.parts.front().vertex));
  std::sort(places_.begin(), places_.end());
  places_.erase(std::unique(places_.begin(), places_.end()), places_.end());
}

std::string Support::constraint_name(Index local_row) const {
  return "support \"" + name() + "\", " + rows_.at(at(local_row)).label;
}

template <class Use>
void Support::for_each_entry(const Use& use) const {
  for (std::size_t r = 0; r < rows_.size(); ++r)
    for (const auto& [vertex, e] : rows_[r].parts)
      for (Index i = 0; i < 3; ++i)
        if (e[i] != 0) use(placement().c + static_cast<Index>(r), vertex, i, e[i]);
}

void Support::declare(PatternBuilder& /*w*/, PatternBuilder& phi_q) const {
  for_each_entry([&](Index row, Index vertex, Index i, double) { phi_q.add(row, body_.coordinate(vertex) + i); });
}

void Support::bind(const SparsePattern& /*w*/, const SparsePattern& phi_q) {
  position_.clear();
  for_each_entry([&](Index row, Index vertex, Index i, double) {
    position_.push_back(at(find_entry(phi_q, row, body_.coordinate(vertex) + i)));
  });
}

void Support::constraints(double t, ConstSpan q, ConstSpan /*v*/, const ConstraintBuffers& out) {
  struct Moved {
    double value = 0, rate = 0, acceleration = 0;
  };
  std::vector<Moved> moved;
  for (const TimeFunction& f : motions_)
    moved.push_back({f.value(t), out.nu.empty() ? 0 : f.rate(t), out.gamma.empty() ? 0 : f.acceleration(t)});
  if (!out.phi.empty()) std::fill_n(out.phi.begin() + placement().c, rows_.size(), 0.0);
  std::size_t entry = 0;
  for_each_entry([&](Index row, Index vertex, Index i, double e) {
    if (!out.phi.empty()) out.phi[at(row)] += e * q[at(body_.configuration(vertex) + i)];
    if (!out.phi_q_values.empty()) out.phi_q_values[position_[entry++]] = e;
  });
  for (std::size_t r = 0; r < rows_.size(); ++r) {
    const std::size_t c = at(placement().c) + r;
    const Moved f = rows_[r].motion < 0 ? Moved{} : moved[at(rows_[r].motion)];
    if (!out.phi.empty()) out.phi[c] = out.phi[c] - rows_[r].rest - f.value;
    if (!out.nu.empty()) out.nu[c] = f.rate;
    if (!out.gamma.empty()) out.gamma[c] = f.acceleration;
  }
}

void Support::branches(const StateView& s, Branches& out) const {
  for (const TimeFunction& f : motions_)
    if (f.branches) f.branches(s.t, out);
}

VectorFunctionPtr reaction_of(const Support& support, bool moment) {
  return std::make_shared<SupportReaction>(support, moment);
}

}  // namespace espalier::dynamics
