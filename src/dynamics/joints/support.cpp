#include "dynamics/joints/support.hpp"

#include <algorithm>

#include "base/at.hpp"
#include "dynamics/joints/joint.hpp"

namespace espalier::dynamics {
namespace {

Index node_place(const FlexibleBody& body, Index vertex) { return vertex - vertex % body.vertices_per_node(); }

/// Force on a row's vertex is -lambda e; that on a director or slope d turns its node by d x force.
class SupportReaction final : public VectorFunction {
 public:
  SupportReaction(const Support& support, bool moment) : support_(support), moment_(moment) {
    for (std::size_t r = 0; r < support.rows().size(); ++r)
      multipliers_.push_back(support.placement().c + static_cast<Index>(r));
    if (!moment) return;
    for (const Support::Row& row : support.rows()) vertices_.push_back(row.vertex);
    vertices_.insert(vertices_.end(), support.places().begin(), support.places().end());
    std::sort(vertices_.begin(), vertices_.end());
    vertices_.erase(std::unique(vertices_.begin(), vertices_.end()), vertices_.end());
    for (const Index vertex : vertices_)
      for (Index i = 0; i < 3; ++i) coordinates_.push_back(support.body().coordinate(vertex) + i);
  }

  [[nodiscard]] Vec3 value(const StateView& s) const override {
    Vec3 sum = Vec3::Zero();
    const Vec3 centre = moment_ ? mean(s) : Vec3::Zero();
    for (std::size_t r = 0; r < support_.rows().size(); ++r) {
      const Vec3 f = force(s, r);
      if (moment_)
        sum += arm(s, r, centre).cross(f);
      else if (at_place(r))
        sum += f;
    }
    return sum;
  }

  Vec3 derivatives(const StateView& s, Derivatives& out) const override {
    clear(out);
    const Vec3 centre = moment_ ? mean(s) : Vec3::Zero();
    Vec3 total = Vec3::Zero();
    for (std::size_t r = 0; r < support_.rows().size(); ++r) {
      const Vec3& e = support_.rows()[r].direction;
      const auto column = static_cast<Eigen::Index>(r);
      if (!moment_) {
        if (at_place(r)) out.lambda.col(column) = -e;
        continue;
      }
      out.lambda.col(column) = -arm(s, r, centre).cross(e);
      const Vec3 f = force(s, r);
      add_turned(out, support_.rows()[r].vertex, f);
      if (at_place(r)) total += f;
    }
    for (const Index place : support_.places())
      if (moment_) add_turned(out, place, -total / static_cast<double>(support_.places().size()));
    return value(s);
  }

 private:
  [[nodiscard]] bool at_place(std::size_t r) const {
    const Index vertex = support_.rows()[r].vertex;
    return node_place(support_.body(), vertex) == vertex;
  }
  [[nodiscard]] Vec3 vertex_at(const StateView& s, Index vertex) const {
    return Eigen::Map<const Vec3>(s.q.data() + support_.body().configuration(vertex));
  }
  [[nodiscard]] Vec3 force(const StateView& s, std::size_t r) const {
    return -s.lambda[at(support_.placement().c) + r] * support_.rows()[r].direction;
  }
  [[nodiscard]] Vec3 arm(const StateView& s, std::size_t r, const Vec3& centre) const {
    return vertex_at(s, support_.rows()[r].vertex) - (at_place(r) ? centre : Vec3::Zero());
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
  for (const Row& row : rows_) places_.push_back(node_place(body, row.vertex));
  std::sort(places_.begin(), places_.end());
  places_.erase(std::unique(places_.begin(), places_.end()), places_.end());
}

std::string Support::constraint_name(Index local_row) const {
  return "support \"" + name() + "\", " + rows_.at(at(local_row)).label;
}

void Support::declare(PatternBuilder& /*w*/, PatternBuilder& phi_q) const {
  for (std::size_t r = 0; r < rows_.size(); ++r)
    for (Index i = 0; i < 3; ++i)
      if (rows_[r].direction[i] != 0)
        phi_q.add(placement().c + static_cast<Index>(r), body_.coordinate(rows_[r].vertex) + i);
}

void Support::bind(const SparsePattern& /*w*/, const SparsePattern& phi_q) {
  position_.clear();
  for (std::size_t r = 0; r < rows_.size(); ++r)
    for (Index i = 0; i < 3; ++i)
      if (rows_[r].direction[i] != 0)
        position_.push_back(
            at(find_entry(phi_q, placement().c + static_cast<Index>(r), body_.coordinate(rows_[r].vertex) + i)));
}

void Support::constraints(double t, ConstSpan q, ConstSpan /*v*/, const ConstraintBuffers& out) {
  struct Moved {
    double value = 0, rate = 0, acceleration = 0;
  };
  std::vector<Moved> moved;
  for (const TimeFunction& f : motions_)
    moved.push_back({f.value(t), out.nu.empty() ? 0 : f.rate(t), out.gamma.empty() ? 0 : f.acceleration(t)});
  std::size_t entry = 0;
  for (std::size_t r = 0; r < rows_.size(); ++r) {
    const Row& row = rows_[r];
    const std::size_t c = at(placement().c) + r;
    const Moved f = row.motion < 0 ? Moved{} : moved[at(row.motion)];
    if (!out.phi.empty()) {
      const double* x = q.data() + body_.configuration(row.vertex);
      double along = 0;  // of what is declared alone
      for (Index i = 0; i < 3; ++i)
        if (row.direction[i] != 0) along += row.direction[i] * x[i];
      out.phi[c] = along - row.rest - f.value;
    }
    if (!out.nu.empty()) out.nu[c] = f.rate;
    if (!out.gamma.empty()) out.gamma[c] = f.acceleration;
    if (out.phi_q_values.empty()) continue;
    for (Index i = 0; i < 3; ++i)
      if (row.direction[i] != 0) out.phi_q_values[position_[entry++]] = row.direction[i];
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
