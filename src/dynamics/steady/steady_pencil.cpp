#include "dynamics/steady/steady_pencil.hpp"

#include <algorithm>
#include <cmath>

#include "base/at.hpp"
#include "dynamics/integrators/initial.hpp"

namespace espalier::dynamics {

namespace {

// The steps of differences, in radians and parts of the model's extent.
std::vector<double> coordinate_moves(const System& system, ConstSpan q) {
  constexpr double kMove = 1e-3;
  std::vector<double> moves = coordinate_sizes(system, q);
  for (double& move : moves) move *= kMove;
  return moves;
}

/// out += A B, or A where B is null
void add_product(const SparseMatrix& a, const BlockDiagonal* b, EntrySums& out) {
  for (Index j = 0; j < a.cols; ++j) {
    const auto add_column = [&](Index from, double factor) {
      for (Offset p = a.col_ptr[at(from)]; p < a.col_ptr[at(from + 1)]; ++p)
        out.add(a.row_ind[at(p)], j, a.values[at(p)] * factor);
    };
    if (b == nullptr)
      add_column(j, 1);
    else
      b->column(j, add_column);
  }
}
SparseMatrix product(const SparseMatrix& a, const BlockDiagonal& b) {
  EntrySums out(a.cols);
  add_product(a, &b, out);
  return out.matrix();
}

/// The angular velocity of a point on a circle: a = w x v.
Vec3 curvature_rate(const VectorCoordinates& x, const State& s) {
  const Eigen::Map<const Vec3> v(&s.v[at(x.v)]), a(&s.a[at(x.v)]);
  return v.squaredNorm() > 0 ? Vec3(v.cross(a) / v.squaredNorm()) : Vec3(Vec3::Zero());
}

}  // namespace

SteadyProblem::SteadyProblem(Equations& equations, const AssembledSystem& system, ConstSpan q)
    : equations_(equations),
      vectors_(vector_coordinates(system)),
      levels_(equations, coordinate_moves(system, q)),
      n_(equations.sizes().velocity),
      rows_(kept_constraints(equations)) {
  layout_.block_of.assign(at(n_), -1);
  for (const VectorCoordinates& x : vectors_) {
    for (Index k = 0; k < 3; ++k) layout_.block_of[at(x.v + k)] = static_cast<Index>(layout_.first_of.size());
    layout_.first_of.push_back(x.v);
  }
}

std::vector<Vec3> SteadyProblem::rates(const State& s) const {
  constexpr double kSame = 1e-9;
  std::vector<Vec3> found;
  for (std::size_t i = 0, end = 0; i < vectors_.size(); i = end) {
    while (end < vectors_.size() && vectors_[end].body == vectors_[i].body) ++end;
    const Vec3 w = end - i > 1 ? angular_velocity(std::span(vectors_).subspan(i, end - i), s.q, s.v)
                               : curvature_rate(vectors_[i], s);
    const auto same = [&](const Vec3& known) { return (known - w).norm() <= kSame * std::max(w.norm(), known.norm()); };
    if (w.norm() > 0 && std::none_of(found.begin(), found.end(), same)) found.push_back(w);
  }
  std::stable_sort(found.begin(), found.end(), [](const Vec3& a, const Vec3& b) { return a.norm() > b.norm(); });
  return found;
}

template <class Make>
BlockDiagonal SteadyProblem::with_blocks(double elsewhere, const Make& make) const {
  BlockDiagonal out = layout_;
  out.elsewhere = elsewhere;
  for (const VectorCoordinates& x : vectors_) out.blocks.push_back(make(x));
  return out;
}

/// S A S^T
SparseMatrix SteadyProblem::seen(const SparseMatrix& a, const BlockDiagonal& axes) const {
  EntrySums out(n_);
  for (Index j = 0; j < n_; ++j)
    for (Offset p = a.col_ptr[at(j)]; p < a.col_ptr[at(j + 1)]; ++p) {
      const double value = a.values[at(p)];
      if (value == 0) continue;
      axes.column(a.row_ind[at(p)], [&](Index row, double left) {
        axes.column(j, [&](Index column, double right) { out.add(row, column, left * value * right); });
      });
    }
  return out.matrix();
}

SteadyPencil SteadyProblem::pencil(const State& s, const Vec3& rate, const Mat3& turned) {
  const TangentMatrices a = tangent_matrices(equations_.system(), s);
  levels_.evaluate(s);
  SteadyPencil out;
  out.axes = with_blocks(1, [&](const VectorCoordinates& x) { return Mat3(turned.transpose() * x.axes(s.q)); });
  const Vec3 own = turned.transpose() * rate;  // in the axes
  const Mat3 w = skew(own);
  const BlockDiagonal of_rate = with_blocks(0, [&](const VectorCoordinates&) { return Mat3(w); });
  const BlockDiagonal of_acceleration = with_blocks(0, [&](const VectorCoordinates& x) {
    if (x.kind != VectorCoordinates::Kind::turn) return Mat3(w);
    const Vec3 spin = x.axes(s.q) * Eigen::Map<const Vec3>(&s.v[at(x.v)]);
    return Mat3(skew(own - turned.transpose() * spin));
  });
  const SparseMatrix m = seen(a.mass, out.axes), d = seen(a.damping, out.axes), k = seen(a.stiffness, out.axes);
  const Index size = n_ + static_cast<Index>(rows_.size());
  EntrySums mass(size), damping(size), stiffness(size);
  add_product(m, nullptr, mass);
  add_product(m, &of_rate, damping);
  add_product(m, &of_acceleration, damping);
  add_product(d, nullptr, damping);
  add_product(product(m, of_acceleration), &of_rate, stiffness);
  add_product(d, &of_rate, stiffness);
  add_product(k, nullptr, stiffness);
  add_constraints(out.axes, of_rate, damping, stiffness);
  add_friction(s, out.axes, stiffness);
  const std::span<const Index> of_velocity = equations_.system().non_holonomic();
  for (const Index row : rows_)
    out.holonomic.push_back(std::binary_search(of_velocity.begin(), of_velocity.end(), row) ? 0 : 1);
  out.mass = mass.matrix();
  out.damping = damping.matrix();
  out.stiffness = stiffness.matrix();
  out.weights.assign(at(n_), 0.0);
  for (Index j = 0; j < n_; ++j)
    for (Offset p = m.col_ptr[at(j)]; p < m.col_ptr[at(j + 1)]; ++p)
      if (m.row_ind[at(p)] == j) out.weights[at(j)] = std::abs(m.values[at(p)]);
  return out;
}

// @pre levels_ was evaluated at the state
void SteadyProblem::add_constraints(const BlockDiagonal& axes, const BlockDiagonal& of_rate, EntrySums& damping,
                                    EntrySums& stiffness) {
  const SparsePattern& p = equations_.system().constraint_pattern();
  const ConstSpan phi_q = equations_.phi_q(), by_q = levels_.velocity_by_q();
  const std::span<const Index> of_velocity = equations_.system().non_holonomic();
  for (std::size_t r = 0; r < rows_.size(); ++r) {
    const Index row = n_ + static_cast<Index>(r);
    const bool holonomic = !std::binary_search(of_velocity.begin(), of_velocity.end(), rows_[r]);
    std::map<Index, double> gradient;  // by xi
    for (Offset k = p.ptr[at(rows_[r])]; k < p.ptr[at(rows_[r]) + 1]; ++k)
      axes.column(p.ind[at(k)], [&](Index j, double turn) {
        gradient[j] += phi_q[at(k)] * turn;
        if (!holonomic) stiffness.add(row, j, by_q[at(k)] * turn);
      });
    for (const auto& [j, value] : gradient) {
      stiffness.add(j, row, value);
      if (holonomic) {
        stiffness.add(row, j, value);
        continue;
      }
      damping.add(row, j, value);
      const Index b = of_rate.block_of[at(j)];
      for (Index i = 0; b >= 0 && i < 3; ++i) {
        const Index first = of_rate.first_of[at(b)];
        stiffness.add(row, first + i, value * of_rate.blocks[at(b)](j - first, i));
      }
    }
  }
}

void SteadyProblem::add_friction(const State& s, const BlockDiagonal& axes, EntrySums& stiffness) {
  const SparsePattern* friction = equations_.system().multiplier_pattern();
  if (friction == nullptr) return;
  std::vector<double> values(at(friction->nonzeros()));
  equations_.system().multiplier_tangent(s.view(), values);
  for (std::size_t r = 0; r < rows_.size(); ++r)
    for (Offset k = friction->ptr[at(rows_[r])]; k < friction->ptr[at(rows_[r]) + 1]; ++k)
      axes.column(friction->ind[at(k)],
                  [&](Index j, double turn) { stiffness.add(j, n_ + static_cast<Index>(r), values[at(k)] * turn); });
}

}  // namespace espalier::dynamics
