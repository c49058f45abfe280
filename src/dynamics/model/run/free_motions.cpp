#include "dynamics/model/run/free_motions.hpp"

#include <fmt/format.h>

#include <cmath>
#include <map>
#include <optional>

#include "base/lazy_vector.hpp"
#include "dense/dense.hpp"
#include "dynamics/dae/row_ranges.hpp"

namespace espalier::dynamics::model {
namespace {

using Twists = Eigen::Matrix<double, 6, Eigen::Dynamic>;  // velocity of the centre, angular velocity times a length

constexpr double kRounding = 1e-12;  // what a row must have of its largest terms to count

/// The motions of one body as a whole.
class WholeBody {
 public:
  /// @param length makes angular velocities comparable with velocities
  WholeBody(const BuiltBody& body, const State& s, double length) : body_(body) {
    if (body.point != nullptr) {
      centre_ = body.point->position(s.q);
      add(body.point->coordinates()[0], Eigen::Matrix3d::Identity(), Eigen::Matrix3d::Zero());
    } else if (body.rigid != nullptr) {
      centre_ = body.rigid->position(s.q);
      const auto& c = body.rigid->coordinates();
      add(c[0], Eigen::Matrix3d::Identity(), Eigen::Matrix3d::Zero());
      add(c[3], Eigen::Matrix3d::Zero(), rotation_matrix(body.rigid->quaternion(s.q)).transpose() / length);
    } else if (body.reduced != nullptr) {
      centre_ = body.reduced->position(s.q);
      const auto c = body.reduced->coordinates();
      add(c[0], Eigen::Matrix3d::Identity(), Eigen::Matrix3d::Zero());
      add(c[3], Eigen::Matrix3d::Zero(), rotation_matrix(body.reduced->quaternion(s.q)).transpose() / length);
    } else {
      add_vertices(*body.flexible, s, length);
    }
    find_basis();
  }

  [[nodiscard]] const BuiltBody& body() const { return body_; }
  [[nodiscard]] const Vec3& centre() const { return centre_; }
  /// Global coordinates, and the velocity of each for the six twists.
  [[nodiscard]] const std::vector<Index>& coordinates() const { return coordinates_; }
  [[nodiscard]] const Eigen::Matrix<double, 1, 6>& velocity(std::size_t k) const { return velocities_[k]; }
  /// Twists that move it (a straight cable does not feel a turn about itself), orthonormal.
  [[nodiscard]] const Twists& basis() const { return basis_; }

 private:
  void add(Index first, const Eigen::Matrix3d& by_velocity, const Eigen::Matrix3d& by_angular) {
    for (Index i = 0; i < 3; ++i) {
      coordinates_.push_back(first + i);
      velocities_.emplace_back();
      velocities_.back() << by_velocity.row(i), by_angular.row(i);
    }
  }

  void add_vertices(const FlexibleBody& flexible, const State& s, double length) {
    const Point c = flexible.mass_properties(s.q, {}).centre;
    centre_ = {c[0], c[1], c[2]};
    for (Index v = 0; v < flexible.vertices(); ++v) {
      const bool place = v % flexible.vertices_per_node() == 0;
      const auto at = static_cast<std::size_t>(flexible.configuration(v));
      const Vec3 arm = Vec3(s.q[at], s.q[at + 1], s.q[at + 2]) - (place ? 1.0 : 0.0) * centre_;
      add(flexible.coordinate(v), (place ? 1.0 : 0.0) * Eigen::Matrix3d::Identity(), -skew(arm) / length);
    }
  }

  void find_basis() {
    Eigen::Matrix<double, 6, 6> gram = Eigen::Matrix<double, 6, 6>::Zero();
    for (const auto& v : velocities_) gram += v.transpose() * v;
    const dense::Spectrum eigen = dense::symmetric_eigen(gram);
    Eigen::Index first = 0;  // eigenvalues grow
    while (eigen.values[first] < 1e-12 * eigen.values[5]) ++first;
    basis_ = eigen.vectors.rightCols(6 - first);
  }

  const BuiltBody& body_;
  Vec3 centre_;
  std::vector<Index> coordinates_;
  std::vector<Eigen::Matrix<double, 1, 6>> velocities_;
  Twists basis_;
};

/// Rows of [F_q; Phi_q] times the motions of whole bodies, each over the sum of its terms, and only where that is more
/// than rounding.
class HeldRows {
 public:
  struct Row {
    double scale = 0;
    std::vector<std::pair<const WholeBody*, Eigen::Matrix<double, 1, 6>>> parts;
  };

  HeldRows(const std::vector<WholeBody>& bodies, Index coordinates, Index rows)
      : rows_(static_cast<std::size_t>(rows)) {
    owner_.assign(static_cast<std::size_t>(coordinates), nullptr);
    place_.assign(static_cast<std::size_t>(coordinates), 0);
    for (const WholeBody& body : bodies)
      for (std::size_t k = 0; k < body.coordinates().size(); ++k) {
        owner_[static_cast<std::size_t>(body.coordinates()[k])] = &body;
        place_[static_cast<std::size_t>(body.coordinates()[k])] = k;
      }
  }

  /// Not of one row by two threads at a time.
  void add_term(Index row, Index coordinate, double value) {
    const auto c = static_cast<std::size_t>(coordinate);
    if (value == 0 || owner_[c] == nullptr) return;
    const Eigen::Matrix<double, 1, 6> term = value * owner_[c]->velocity(place_[c]);
    Row& sum = rows_[static_cast<std::size_t>(row)];
    sum.scale += term.cwiseAbs().maxCoeff();
    for (auto& [body, part] : sum.parts)
      if (body == owner_[c]) {
        part += term;
        return;
      }
    sum.parts.emplace_back(owner_[c], term);
  }

  /// Terms for motions of the bodies that are not there any more, but for their rounding.
  void add_scale(Index row, double value) { rows_[static_cast<std::size_t>(row)].scale += value; }

  /// Bodies that rows join, each group in the order of the bodies; a body by itself is a group, too.
  [[nodiscard]] std::vector<std::vector<const WholeBody*>> groups(const std::vector<WholeBody>& bodies) const {
    std::map<const WholeBody*, const WholeBody*> parent;
    for (const WholeBody& body : bodies) parent[&body] = &body;
    const auto root = [&parent](const WholeBody* body) {
      while (parent[body] != body) body = parent[body] = parent[parent[body]];
      return body;
    };
    for (const Row& row : rows_)
      for (const auto& [body, part] : row.parts) parent[root(body)] = root(row.parts.front().first);
    std::map<const WholeBody*, std::size_t> index;
    std::vector<std::vector<const WholeBody*>> all;
    for (const WholeBody& body : bodies) {
      const auto [at, fresh] = index.emplace(root(&body), all.size());
      if (fresh) all.emplace_back();
      all[at->second].push_back(&body);
    }
    return all;
  }

  /// The rows by the first body that each of them names.
  [[nodiscard]] std::map<const WholeBody*, std::vector<const Row*>> rows_of_bodies() const {
    std::map<const WholeBody*, std::vector<const Row*>> by_body;
    for (const Row& row : rows_)
      if (!row.parts.empty()) by_body[row.parts.front().first].push_back(&row);
    return by_body;
  }

 private:
  std::vector<const WholeBody*> owner_;
  std::vector<std::size_t> place_;
  std::vector<Row> rows_;
};

constexpr double kDependent = 1e-9;

/// Rows of demands, not many more than columns: as soon as there are, as many as columns that demand the same.
class Condensed {
 public:
  explicit Condensed(Eigen::Index columns) : rows_(2 * columns + 6, columns) {}
  void add(const Eigen::RowVectorXd& line) {
    if (count_ == rows_.rows()) {
      count_ = rows_.cols();
      rows_.topRows(count_) = dense::qr_triangle(rows_);
    }
    rows_.row(count_++) = line;
  }
  [[nodiscard]] auto rows() const { return rows_.topRows(count_); }

 private:
  Eigen::MatrixXd rows_;
  Eigen::Index count_ = 0;
};

/// Motions of the bodies of one group that no row resists: six rows for every body.
class Group {
 public:
  Group(const std::vector<const WholeBody*>& bodies,
        const std::map<const WholeBody*, std::vector<const HeldRows::Row*>>& rows, base::ThreadPool& pool) {
    std::vector<const HeldRows::Row*> all;
    for (const WholeBody* body : bodies) {
      first_[body] = columns_;
      columns_ += body->basis().cols();
      if (const auto own = rows.find(body); own != rows.end())
        all.insert(all.end(), own->second.begin(), own->second.end());
    }
    // The rows of a task: some milliseconds, and far more than it condenses them to.
    const std::size_t rows_of_task = std::max<std::size_t>(4096, 512 * static_cast<std::size_t>(columns_));
    std::vector<Condensed> parts((all.size() + rows_of_task - 1) / rows_of_task, Condensed(columns_));
    pool.for_each(static_cast<std::int64_t>(parts.size()), [&](std::int64_t k) {
      const std::size_t begin = static_cast<std::size_t>(k) * rows_of_task;
      for (std::size_t i = begin; i < std::min(begin + rows_of_task, all.size()); ++i)
        if (const auto line = line_of(*all[i])) parts[static_cast<std::size_t>(k)].add(*line);
    });
    Condensed held(columns_);
    for (const Condensed& part : parts)
      for (Eigen::Index i = 0; i < part.rows().rows(); ++i) held.add(part.rows().row(i));
    free_ = dense::null_space(held.rows(), kDependent);
  }

  [[nodiscard]] bool held() const { return free_.cols() == 0; }
  [[nodiscard]] Eigen::MatrixXd twists(const WholeBody& body) const {
    return body.basis() * free_.middleRows(first_.at(&body), body.basis().cols());
  }

 private:
  /// What a row demands of the twists, of length one; nothing where that is rounding.
  [[nodiscard]] std::optional<Eigen::RowVectorXd> line_of(const HeldRows::Row& row) const {
    Eigen::RowVectorXd line = Eigen::RowVectorXd::Zero(columns_);
    for (const auto& [other, part] : row.parts)
      line.segment(first_.at(other), other->basis().cols()) += part / row.scale * other->basis();
    if (!(row.scale > 0) || line.cwiseAbs().maxCoeff() <= kRounding) return std::nullopt;
    return line / line.norm();
  }

  Eigen::Index columns_ = 0;
  std::map<const WholeBody*, Eigen::Index> first_;
  Eigen::MatrixXd free_;
};

std::string numbers(const Vec3& x) {
  const auto clean = [](double v) { return std::abs(v) < 5e-7 ? 0.0 : v; };
  return fmt::format("({:.4g}, {:.4g}, {:.4g})", clean(x[0]), clean(x[1]), clean(x[2]));
}

std::string direction(const Vec3& d) {
  Eigen::Index axis = 0;
  if (d.cwiseAbs().maxCoeff(&axis) > 1 - 1e-6) return {"xyz"[axis]};
  return numbers(d[axis] < 0 ? -d : d);
}

/// One direction by itself, two by the one across, three as all of them.
std::string directions(const char* noun, const Eigen::Matrix<double, 3, Eigen::Dynamic>& set) {
  if (set.cols() == 1) return direction(set.col(0));
  std::string every = fmt::format("every {}", noun);
  if (set.cols() == 3) return every;
  return every + " across " + direction(set.col(0).head<3>().cross(set.col(1).head<3>()).normalized());
}

/// What of the free twists: "move along z and turn about y through (0, 0, 1)".
std::string words(const Eigen::MatrixXd& twists, const Vec3& centre, double length) {
  constexpr double kSmall = 1e-6;
  const dense::SingularValues span = dense::singular_values(twists);
  Eigen::Index rank = 0;
  while (rank < span.values.size() && span.values[rank] > kSmall) ++rank;
  if (rank == 0) return "";
  const Eigen::MatrixXd basis = span.u.leftCols(rank);
  const dense::SingularValues turns = dense::singular_values(basis.bottomRows(3));
  Eigen::Index turning = 0;
  while (turning < turns.values.size() && turns.values[turning] > kSmall) ++turning;
  const Eigen::MatrixXd sliding = basis.topRows(3) * turns.v.rightCols(rank - turning);
  std::string text;
  if (sliding.cols() > 0) text = "move along " + directions("direction", sliding);
  if (turning == 0) return text;
  text += text.empty() ? "turn about " : " and turn about ";
  text += directions("axis", turns.u.leftCols(turning));
  if (turning > 1 || sliding.cols() > 1) return text;
  Vec3 velocity = basis.topRows(3) * turns.v.col(0);
  velocity -= sliding * (sliding.transpose() * velocity);
  const Vec3 omega = turns.values[0] / length * turns.u.col(0);
  return text + " through " + numbers(centre + omega.cross(velocity) / omega.squaredNorm());
}

/// Largest distance in the model, for angles.
double length_of(Mechanism& mechanism, const State& s) {
  std::vector<double> size(s.v.size());
  mechanism.system.magnitude(s.q, size);
  return std::max(max_norm(size), 1e-300);
}

/// The mean area of the quadrilaterals of a shell.
double mean_area(const Mesh& mesh) {
  double sum = 0;
  for (Index e = 0; e < mesh.element_count(); ++e) {
    const auto place = [&](std::size_t k) {
      const Point& p = mesh.nodes[static_cast<std::size_t>(mesh.element(e)[k])];
      return Vec3(p[0], p[1], p[2]);
    };
    sum += 0.5 * (place(2) - place(0)).cross(place(3) - place(1)).norm();
  }
  return sum / mesh.element_count();
}

}  // namespace

std::vector<double> stretch_of_shells(const Mechanism& mechanism, std::size_t coordinates) {
  std::vector<double> stiffness;
  for (const BuiltBody& body : mechanism.bodies) {
    const auto* shell = std::get_if<ShellSpec>(&body.spec.shape);
    if (shell == nullptr || body.reduced != nullptr) continue;
    stiffness.resize(coordinates, 0.0);
    const double area = shell->file ? mean_area(*shell->mesh)
                                    : shell->x.cross(shell->y).norm() / (static_cast<double>(shell->nx) * shell->ny);
    for (Index node = 0; node < body.flexible->nodes(); ++node)
      for (Index i = 0; i < 6; ++i)
        stiffness[static_cast<std::size_t>(body.flexible->coordinate(2 * node) + i)] =
            shell->material.young * area / (i < 3 ? shell->thickness : 2);
  }
  return stiffness;
}

FreeMotions free_motions(Mechanism& mechanism, const std::vector<char>& dropped, const State& state) {
  constexpr std::size_t kMostBodies = 200;  // of a group: the matrix of its motions is dense
  const double length = length_of(mechanism, state);
  std::vector<WholeBody> bodies;
  for (const BuiltBody& body : mechanism.bodies) bodies.emplace_back(body, state, length);
  const auto n = static_cast<Index>(state.v.size());
  HeldRows held(bodies, n, n + mechanism.system.sizes().constraints);
  const SparsePattern& w = mechanism.system.tangent_pattern();
  base::LazyVector<double> values(static_cast<std::size_t>(w.nonzeros()));
  mechanism.system.tangent(state.view(), {0, 0, 1}, values);
  for_each_row_range(w, &mechanism.pool, [&](Index column, Offset begin, Offset end) {
    for (Offset k = begin; k < end; ++k)
      held.add_term(w.ind[static_cast<std::size_t>(k)], column, values[static_cast<std::size_t>(k)]);
  });
  const std::vector<double> hidden = stretch_of_shells(mechanism, state.v.size());
  for (std::size_t i = 0; i < hidden.size(); ++i)
    if (hidden[i] > 0) held.add_scale(static_cast<Index>(i), hidden[i]);
  const SparsePattern& g = mechanism.system.constraint_pattern();
  std::vector<double> phi_q(static_cast<std::size_t>(g.nonzeros()));
  mechanism.system.constraints(state.t, state.q, {}, {{}, {}, {}, phi_q});
  for (Index r = 0; r < g.rows; ++r)
    for (Offset k = g.ptr[static_cast<std::size_t>(r)]; k < g.ptr[static_cast<std::size_t>(r) + 1]; ++k)
      if (dropped.empty() || dropped[static_cast<std::size_t>(r)] == 0)
        held.add_term(n + r, g.ind[static_cast<std::size_t>(k)], phi_q[static_cast<std::size_t>(k)]);
  FreeMotions result;
  const auto rows = held.rows_of_bodies();
  std::map<const WholeBody*, std::string> texts;
  for (const auto& members : held.groups(bodies)) {
    if (members.size() > kMostBodies) {
      result.unseen += members.size();
      continue;
    }
    const Group group(members, rows, mechanism.pool);
    if (group.held()) continue;
    for (const WholeBody* body : members)
      if (std::string text = words(group.twists(*body), body->centre(), length); !text.empty())
        texts[body] = fmt::format("'{}' can {}", body->body().spec.name, text);
  }
  for (const WholeBody& body : bodies)
    if (const auto at = texts.find(&body); at != texts.end()) result.texts.push_back(at->second);
  return result;
}

}  // namespace espalier::dynamics::model
