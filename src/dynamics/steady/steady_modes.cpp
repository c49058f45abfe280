#include "dynamics/steady/steady_modes.hpp"

#include <fmt/format.h>

#include <Eigen/Dense>
#include <algorithm>
#include <cmath>
#include <limits>
#include <map>
#include <numbers>
#include <random>

#include "base/at.hpp"
#include "dynamics/integrators/initial.hpp"
#include "dynamics/integrators/level_derivatives.hpp"
#include "dynamics/integrators/linearised.hpp"
#include "espalier/solver.hpp"

namespace espalier::dynamics {

namespace {

using Block = Eigen::Matrix<double, 3, 3>;

/// A matrix by columns that is added up entry by entry.
class Collector {
 public:
  explicit Collector(Index size) : columns_(at(size)) {}
  void add(Index row, Index column, double value) {
    if (value != 0) columns_[at(column)][row] += value;
  }
  [[nodiscard]] SparseMatrix matrix() const {
    SparseMatrix out;
    out.rows = out.cols = static_cast<Index>(columns_.size());
    out.col_ptr.assign(1, 0);
    for (const auto& column : columns_) {
      for (const auto& [row, value] : column) {
        out.row_ind.push_back(row);
        out.values.push_back(value);
      }
      out.col_ptr.push_back(static_cast<Offset>(out.row_ind.size()));
    }
    return out;
  }

 private:
  std::vector<std::map<Index, double>> columns_;
};

/// Three by three blocks on the diagonal, as they act on the velocity coordinates; the identity, or zero, elsewhere.
struct BlockDiagonal {
  std::vector<Index> block_of;  // n: number of the block; -1: none
  std::vector<Index> first_of;  // blocks: first coordinate
  std::vector<Block> blocks;
  double elsewhere = 0;

  /// The entries (row, value) of column j.
  template <class Body>
  void column(Index j, const Body& body) const {
    const Index b = block_of[at(j)];
    if (b < 0) {
      if (elsewhere != 0) body(j, elsewhere);
      return;
    }
    const Index first = first_of[at(b)];
    for (Index i = 0; i < 3; ++i) body(first + i, blocks[at(b)](i, j - first));
  }
};

/// M, C and K of the file's quadratic problem, n + r unknowns: xi and the multipliers of constraints that are kept.
struct SteadyPencil {
  SparseMatrix mass, damping, stiffness;
  std::vector<double> weights;  // n: diagonal of the mass matrix
  BlockDiagonal axes;           // S
};

class SteadyProblem {
 public:
  SteadyProblem(Equations& equations, const AssembledSystem& system, ConstSpan q)
      : equations_(equations),
        vectors_(vector_coordinates(system)),
        levels_(equations, coordinate_moves(system, q)),
        n_(equations.sizes().velocity) {
    layout_.block_of.assign(at(n_), -1);
    for (const VectorCoordinates& x : vectors_) {
      for (Index k = 0; k < 3; ++k) layout_.block_of[at(x.v + k)] = static_cast<Index>(layout_.first_of.size());
      layout_.first_of.push_back(x.v);
    }
    rows_ = kept_constraints(equations);
  }

  [[nodiscard]] const std::vector<VectorCoordinates>& vectors() const { return vectors_; }

  /// Angular velocities of the bodies, each once; what turns fastest first.
  [[nodiscard]] std::vector<Vec3> rates(const State& s) const {
    constexpr double kSame = 1e-9;
    std::vector<Vec3> found;
    for (std::size_t i = 0, end = 0; i < vectors_.size(); i = end) {
      while (end < vectors_.size() && vectors_[end].body == vectors_[i].body) ++end;
      const Vec3 w = angular_velocity(std::span(vectors_).subspan(i, end - i), s.q, s.v);
      const auto same = [&](const Vec3& known) { return (known - w).norm() <= kSame * std::max(w.norm(), known.norm()); };
      if (w.norm() > 0 && std::none_of(found.begin(), found.end(), same)) found.push_back(w);
    }
    std::stable_sort(found.begin(), found.end(), [](const Vec3& a, const Vec3& b) { return a.norm() > b.norm(); });
    return found;
  }

  /// @param turned  what the axes have turned since they were the global ones
  [[nodiscard]] SteadyPencil pencil(const State& s, const Vec3& rate, const Mat3& turned) {
    const TangentMatrices a = tangent_matrices(equations_.system(), s);
    levels_.evaluate(s);
    SteadyPencil out;
    out.axes = with_blocks(1, [&](const VectorCoordinates& x) { return Block(turned.transpose() * x.axes(s.q)); });
    const Vec3 own = turned.transpose() * rate;  // in the axes
    const Mat3 w = skew(own);
    const BlockDiagonal of_rate = with_blocks(0, [&](const VectorCoordinates&) { return Block(w); });
    const BlockDiagonal of_acceleration = with_blocks(0, [&](const VectorCoordinates& x) {
      if (x.kind != VectorCoordinates::Kind::turn) return Block(w);
      const Vec3 spin = x.axes(s.q) * Eigen::Map<const Vec3>(&s.v[at(x.v)]);
      return Block(skew(own - turned.transpose() * spin));
    });
    const SparseMatrix m = seen(a.mass, out.axes), d = seen(a.damping, out.axes), k = seen(a.stiffness, out.axes);
    const Index size = n_ + static_cast<Index>(rows_.size());
    Collector mass(size), damping(size), stiffness(size);
    add_product(m, nullptr, mass);
    add_product(m, &of_rate, damping);
    add_product(m, &of_acceleration, damping);
    add_product(d, nullptr, damping);
    add_product(product(m, of_acceleration), &of_rate, stiffness);
    add_product(d, &of_rate, stiffness);
    add_product(k, nullptr, stiffness);
    add_constraints(s, out.axes, of_rate, damping, stiffness);
    out.mass = mass.matrix();
    out.damping = damping.matrix();
    out.stiffness = stiffness.matrix();
    out.weights.assign(at(n_), 0.0);
    for (Index j = 0; j < n_; ++j)
      for (Offset p = m.col_ptr[at(j)]; p < m.col_ptr[at(j + 1)]; ++p)
        if (m.row_ind[at(p)] == j) out.weights[at(j)] = std::abs(m.values[at(p)]);
    return out;
  }

 private:
  // Of differences, in radians and parts of the model's extent.
  static std::vector<double> coordinate_moves(const System& system, ConstSpan q) {
    constexpr double kMove = 1e-3;
    std::vector<double> moves = coordinate_sizes(system, q);
    for (double& move : moves) move *= kMove;
    return moves;
  }

  template <class Make>
  [[nodiscard]] BlockDiagonal with_blocks(double elsewhere, const Make& make) const {
    BlockDiagonal out = layout_;
    out.elsewhere = elsewhere;
    for (const VectorCoordinates& x : vectors_) out.blocks.push_back(make(x));
    return out;
  }

  /// S A S^T
  [[nodiscard]] SparseMatrix seen(const SparseMatrix& a, const BlockDiagonal& axes) const {
    Collector out(n_);
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

  /// out += A B, or A where B is null
  static void add_product(const SparseMatrix& a, const BlockDiagonal* b, Collector& out) {
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
  static SparseMatrix product(const SparseMatrix& a, const BlockDiagonal& b) {
    Collector out(a.cols);
    add_product(a, &b, out);
    return out.matrix();
  }

  // @pre levels_ was evaluated at the state
  void add_constraints(const State& s, const BlockDiagonal& axes, const BlockDiagonal& of_rate, Collector& damping,
                       Collector& stiffness) {
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
    const SparsePattern* friction = equations_.system().multiplier_pattern();
    if (friction == nullptr) return;
    std::vector<double> values(at(friction->nonzeros()));
    equations_.system().multiplier_tangent(s.view(), values);
    for (std::size_t r = 0; r < rows_.size(); ++r)
      for (Offset k = friction->ptr[at(rows_[r])]; k < friction->ptr[at(rows_[r]) + 1]; ++k)
        axes.column(friction->ind[at(k)], [&](Index j, double turn) {
          stiffness.add(j, n_ + static_cast<Index>(r), values[at(k)] * turn);
        });
  }

  Equations& equations_;
  std::vector<VectorCoordinates> vectors_;
  LevelDerivatives levels_;
  Index n_;
  std::vector<Index> rows_;
  BlockDiagonal layout_;
};

SparseMatrix sum_at(const SteadyPencil& p, double s) {
  Collector out(p.mass.cols);
  for (const auto& [a, factor] : {std::pair{&p.mass, s * s}, {&p.damping, s}, {&p.stiffness, 1.0}})
    for (Index j = 0; j < a->cols; ++j)
      for (Offset k = a->col_ptr[at(j)]; k < a->col_ptr[at(j + 1)]; ++k)
        out.add(a->row_ind[at(k)], j, factor * a->values[at(k)]);
  return out.matrix();
}

/// xi under forces that are random numbers in units of masses, growing with exp(s t), in units of masses.
Eigen::VectorXd response(const SteadyPencil& p, double s, const Options& options) {
  SparseMatrix q = sum_at(p, s);
  q.storage = Storage::general;
  std::vector<double> b(at(q.rows), 0.0);
  std::mt19937_64 random(7);
  std::uniform_real_distribution<double> amount(-1, 1);
  for (std::size_t i = 0; i < p.weights.size(); ++i) b[i] = std::sqrt(p.weights[i]) * amount(random);
  Options own = options;
  own.kind = Kind::lu;
  own.device = "cpu";
  Solver solver(own);
  Status status = solver.analyze(q).status;
  if (status.ok()) status = solver.factorize(q).status;
  if (status.ok()) status = solver.solve(b, b).status;
  if (!status.ok()) throw Error(status.code, "modes of a steady motion: " + status.message);
  Eigen::VectorXd x(static_cast<Eigen::Index>(p.weights.size()));
  for (std::size_t i = 0; i < p.weights.size(); ++i)
    x[static_cast<Eigen::Index>(i)] = std::sqrt(p.weights[i]) * b[i];
  return x;
}

/// The state a time later, or before, to second order.
State after(Equations& equations, const State& s, double time) {
  State moved = s;
  std::vector<double> way(s.v.size());
  for (std::size_t i = 0; i < way.size(); ++i) {
    way[i] = time * (s.v[i] + 0.5 * time * s.a[i]);
    moved.v[i] = s.v[i] + time * s.a[i];
  }
  equations.system().retract(s.q, way, moved.q);
  moved.t = s.t + time;
  ConsistencyOptions options;
  options.tolerance = 1e-11;
  make_consistent(equations, moved, options);
  return moved;
}

Mat3 turn_by(const Vec3& angle) { return rotation_matrix(quaternion_exp(angle)); }

/// By how much responses change while the fastest body turns by a radian, in parts. What cannot be followed that far is
/// not steady.
double unsteadiness(Equations& equations, SteadyProblem& problem, const State& s, const Vec3& rate, double fastest,
                    const Options& solver) {
  constexpr double kTurn = 1e-3;
  const double time = kTurn / fastest;
  double worst = 0;
  try {
    const State before = after(equations, s, -time), later = after(equations, s, time);
    const SteadyPencil a = problem.pencil(before, rate, turn_by(-time * rate)),
                       b = problem.pencil(later, rate, turn_by(time * rate));
    for (const double growth : {0.7, 3.1}) {
      const Eigen::VectorXd x = response(a, growth * fastest, solver), y = response(b, growth * fastest, solver);
      const double change = (x - y).norm() / (2 * kTurn * std::max(x.norm(), 1e-300));
      if (!(change <= worst)) worst = change;
    }
  } catch (const Error& error) {
    const StatusCode code = error.status().code;
    if (code == StatusCode::out_of_memory || code == StatusCode::cancelled || code == StatusCode::device_error) throw;
    return std::numeric_limits<double>::infinity();
  }
  return worst;
}

/// A real number next to zero, at a distance that factors see.
double shift_of(const SteadyPencil& p, double fastest) {
  std::vector<double> ratios;
  for (std::size_t j = 0; j < p.weights.size(); ++j)
    for (Offset k = p.stiffness.col_ptr[j]; k < p.stiffness.col_ptr[j + 1]; ++k)
      if (at(p.stiffness.row_ind[at(k)]) == j && p.weights[j] > 0 && p.stiffness.values[at(k)] != 0)
        ratios.push_back(std::abs(p.stiffness.values[at(k)]) / p.weights[j]);
  double typical = 0;
  if (!ratios.empty()) {
    const auto middle = ratios.begin() + static_cast<std::ptrdiff_t>(ratios.size() / 2);
    std::nth_element(ratios.begin(), middle, ratios.end());
    typical = std::sqrt(*middle);
  }
  return -(0.0123456789 * fastest + 1e-4 * typical);
}

/// Of a complex path in the plane across the axis, weighted: 1 where all go round with it, -1 against it.
double whirl_of(const SteadyProblem& problem, const SteadyPencil& p, const Eigen::VectorXcd& xi, const Vec3& axis) {
  if (!(axis.norm() > 0)) return 0;
  const Vec3 z = axis.normalized(), x = z.unitOrthogonal(), y = z.cross(x);
  double area = 0, size = 0, whole = 0;
  for (const VectorCoordinates& v : problem.vectors()) {
    const Eigen::Vector3cd u = xi.segment<3>(v.v);
    const std::complex<double> a = x.cast<std::complex<double>>().dot(u), b = y.cast<std::complex<double>>().dot(u);
    const double m = p.weights[at(v.v)];
    area += m * 2 * std::imag(a * std::conj(b));
    size += m * (std::norm(a) + std::norm(b));
    whole += m * u.squaredNorm();
  }
  constexpr double kAcross = 1e-6;
  return size > kAcross * whole ? area / size : 0;
}

double standing(double frequency, double whirl, double turns) {
  constexpr double kCircle = 1e-3;
  if (turns == 0) return whirl < 0 ? -frequency : frequency;
  if (whirl == 0) return frequency;
  if (std::abs(whirl) < 1 - kCircle) return std::numeric_limits<double>::quiet_NaN();
  return whirl > 0 ? frequency + turns : turns - frequency;
}

SteadyMode mode_of(const SteadyProblem& problem, const SteadyPencil& p, std::complex<double> e,
                   const Eigen::VectorXcd& xi, const Vec3& axis, bool turning) {
  SteadyMode out;
  const double modulus = std::abs(e);
  out.mode.eigenvalue = e;
  out.mode.frequency = std::abs(e.imag()) / (2 * std::numbers::pi);
  out.mode.damping_ratio = modulus > 0 ? -e.real() / modulus : 0;
  Eigen::Index largest = 0;
  const Eigen::Index n = static_cast<Eigen::Index>(p.weights.size());
  xi.head(n).cwiseAbs().maxCoeff(&largest);
  const Eigen::VectorXcd turned = xi.head(n) / xi[largest];
  out.mode.shape.assign(p.weights.size(), 0.0);
  for (Index j = 0; j < static_cast<Index>(n); ++j)  // dq = S^T xi
    p.axes.column(j, [&](Index i, double value) { out.mode.shape[at(j)] += value * turned[i].real(); });
  out.whirl = e.imag() != 0 ? whirl_of(problem, p, xi.head(n), axis) : 0;
  out.standing_frequency = standing(out.mode.frequency, out.whirl, turning ? axis.norm() / (2 * std::numbers::pi) : 0);
  return out;
}

/// Of what moves without a turn.
double speed_over_extent(const System& system, const State& s) {
  const std::vector<double> sizes = coordinate_sizes(system, s.q);
  double most = 0;
  for (std::size_t i = 0; i < sizes.size(); ++i) most = std::max(most, std::abs(s.v[i]) / sizes[i]);
  return std::max(most, 1e-300);
}

std::string axes_notice(const Vec3& rate, const Vec3& axis, double change) {
  if (rate.norm() > 0)
    return fmt::format(
        "initial.modes: small motions about the steady motion, seen from axes that turn with it ({:.6g}, {:.6g}, "
        "{:.6g} rad per unit of time); seen from axes at rest, what circles has the standing frequency",
        rate.x(), rate.y(), rate.z());
  return fmt::format("initial.modes: small motions about the steady motion, seen from axes at rest{}",
                     axis.norm() > 0 && change > 1e-7
                         ? fmt::format(" (their coefficients change by {:.1e} of them in a radian)", change)
                         : std::string());
}

}  // namespace

SteadyModes steady_modes(Equations& equations, const AssembledSystem& system, const State& state, Index count,
                         const Options& solver) {
  constexpr double kSteady = 1e-5, kNothing = 1e-6;
  SteadyModes out;
  SteadyProblem problem(equations, system, state.q);
  const std::vector<Vec3> rates = problem.rates(state);
  const Vec3 axis = rates.empty() ? Vec3(Vec3::Zero()) : rates.front();
  const double fastest = rates.empty() ? speed_over_extent(system, state) : axis.norm();
  std::vector<Vec3> candidates = {Vec3::Zero()};
  candidates.insert(candidates.end(), rates.begin(), rates.end());
  constexpr std::size_t kMost = 4;
  double change = 0;
  bool steady = false;
  for (std::size_t k = 0; k < std::min(kMost, candidates.size()) && !steady; ++k) {
    out.rate = candidates[k];
    change = unsteadiness(equations, problem, state, out.rate, fastest, solver);
    steady = change <= kSteady;
  }
  if (!steady) {
    equations.evaluate_constraints(state.t, state.q, state.v);
    out.notice = fmt::format("(what small motions feel changes by {:.1e} of it while the fastest body turns by a radian)",
                             change);
    return out;
  }
  const SteadyPencil p = problem.pencil(state, out.rate, Mat3::Identity());
  QuadraticModesOptions options;
  // Rigid motions that nothing resists have eigenvalues of zero, two of each.
  options.count = std::min<Index>(count + 14, p.stiffness.rows);
  options.solver = solver;
  options.shift = shift_of(p, fastest);
  const QuadraticModesResult found = find_quadratic_modes(p.stiffness, p.damping, p.mass, options);
  if (!found.status.ok() && found.count() == 0)
    throw Error(found.status.code, "modes of a steady motion: " + found.status.message);
  double largest = 0;
  for (const std::complex<double> e : found.eigenvalues) largest = std::max(largest, std::abs(e));
  for (Index i = 0; i < found.count(); ++i) {
    std::complex<double> e = found.eigenvalues[at(i)];
    if (std::abs(e) <= kNothing * largest) e = 0;
    const Eigen::Map<const Eigen::VectorXcd> x(found.vectors.data() + Offset{i} * found.n, found.n);
    out.modes.push_back(mode_of(problem, p, e, x, axis, out.rate.norm() > 0));
  }
  std::stable_sort(out.modes.begin(), out.modes.end(), [](const SteadyMode& a, const SteadyMode& b) {
    return std::abs(a.mode.eigenvalue) < std::abs(b.mode.eigenvalue);
  });
  out.modes.resize(std::min(at(count), out.modes.size()));
  out.notice = axes_notice(out.rate, axis, change);
  equations.evaluate_constraints(state.t, state.q, state.v);
  return out;
}

}  // namespace espalier::dynamics
