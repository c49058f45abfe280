#include "espalier/changed_system.hpp"

#include <fmt/format.h>

#include <Eigen/Dense>
#include <algorithm>
#include <cmath>
#include <limits>
#include <optional>
#include <stdexcept>
#include <utility>

#include "base/stopwatch.hpp"
#include "changes/border.hpp"
#include "solver/condition.hpp"
#include "solver/solver_impl.hpp"
#include "solver/status_of.hpp"

namespace espalier {

namespace {

using changes::Border;
using changes::Sort;
using Eigen::MatrixXd;
using Eigen::VectorXd;

using ConstMap = Eigen::Map<const MatrixXd>;

std::size_t area(Index rows, Index columns) {
  return static_cast<std::size_t>(rows) * static_cast<std::size_t>(columns);
}

void check_size(const char* call, const char* name, std::size_t have, std::size_t need, bool may_be_empty) {
  if (have == need || (may_be_empty && have == 0)) return;
  throw std::invalid_argument(
      fmt::format("ChangedSystem::{}: {} has {} values, {} are needed", call, name, have, need));
}

void check_finite(std::span<const double> values, const char* name) {
  for (std::size_t k = 0; k < values.size(); ++k)
    if (!std::isfinite(values[k]))
      throw Error(StatusCode::invalid_input, fmt::format("value {} of {} is {}", k, name, values[k]));
}

}  // namespace

struct ChangedSystem::Impl {
  explicit Impl(Solver& the_solver) : solver(the_solver) { reset(); }

  void reset() {
    if (solver.state() != Solver::State::factorized)
      throw std::logic_error("ChangedSystem: the solver has no factorization");
    solver::Session& s = session();
    if (s.link() != nullptr)
      throw std::logic_error("ChangedSystem: several ranks share the solver; it works on a solver of one process");
    n = s.current().n();
    stamp = s.factor->stamp();
    symmetric = s.current().kind() != Kind::lu;
    inertia = s.factor->result().inertia;
    border.emplace(n);
    added.clear();
    removed.assign(static_cast<std::size_t>(n), 0);
    stale = true;
  }

  [[nodiscard]] solver::Session& session() const { return solver::SolverAccess::session(solver); }
  void expect_factor(const char* call) const {
    const solver::Session& s = session();
    if (!s.factor || !s.factor->factorized() || s.factor->stamp() != stamp)
      throw std::logic_error(fmt::format(
          "ChangedSystem::{}: the solver has been factorized again, or has lost its factor; call reset()", call));
  }
  template <class Body>
  Status guarded(Body&& body) const {
    return solver::status_of(session().interruption, "keep fewer changes", [&] {
      session().expect_usable();
      body();
    });
  }

  [[nodiscard]] Index size() const { return n + static_cast<Index>(added.size()); }
  // Once refined: rounding of A^-1 U would stay in S.
  void apply_inverse(MatrixXd& x) const {
    if (x.cols() == 0) return;
    const MatrixXd b = x;
    const solve::ResidualOperator& a = session().factor->residual();
    solver::Numeric& numeric = session().factor->numeric();
    const auto columns = static_cast<Index>(x.cols());
    numeric.solve(b.data(), x.data(), columns, false);
    MatrixXd r(b.rows(), b.cols());
    std::vector<solve::ResidualColumn> list;
    for (Eigen::Index c = 0; c < b.cols(); ++c) list.push_back({b.col(c).data(), x.col(c).data(), r.col(c).data(), {}});
    a.compute(list, false);
    numeric.solve(r.data(), r.data(), columns, false);
    if (r.allFinite()) x += r;
  }
  void append(Sort sort, const MatrixXd& u, const MatrixXd& w, const MatrixXd& d, bool is_symmetric) {
    border->append(sort, u, w, d, is_symmetric, [this](MatrixXd& x) { apply_inverse(x); });
    stale = true;
  }

  // The change by which an unknown of A is removed. @pre there is one
  [[nodiscard]] Index remover_of(Index unknown) const {
    Index k = 0;
    while (border->sort(k) != Sort::removed || border->u()(unknown, k) != 1) ++k;
    return k;
  }
  void check_list(std::span<const Index> unknowns, bool expected) const {
    std::vector<Index> sorted(unknowns.begin(), unknowns.end());
    std::sort(sorted.begin(), sorted.end());
    const auto twice = std::adjacent_find(sorted.begin(), sorted.end());
    if (twice != sorted.end())
      throw Error(StatusCode::invalid_input, fmt::format("unknown {} stands twice in the list", *twice), *twice);
    for (const Index v : unknowns) {
      if (v < 0 || v >= size())
        throw Error(StatusCode::invalid_input,
                    fmt::format("there is no unknown {}; they run from 0 to {}", v, size() - 1), v);
      if ((removed[static_cast<std::size_t>(v)] != 0) != expected)
        throw Error(StatusCode::invalid_input,
                    fmt::format("unknown {} is {}", v, expected ? "not removed" : "removed already"), v);
    }
  }

  void remove(std::span<const Index> unknowns);
  void restore(std::span<const Index> unknowns);
  /// y += sign times what the changes make of x; both of size().
  void add_changes(const VectorXd& x, double sign, bool transpose, VectorXd& y) const;
  void drop_removed(VectorXd& x) const {
    for (Eigen::Index v = 0; v < x.size(); ++v)
      if (removed[static_cast<std::size_t>(v)] != 0) x[v] = 0;
  }
  /// The changed matrix, whose removed rows and columns are zero.
  [[nodiscard]] VectorXd multiply(VectorXd x, bool transpose) const;
  [[nodiscard]] VectorXd residual(const VectorXd& b, const VectorXd& x) const;
  /// Without refinement.
  [[nodiscard]] VectorXd substitute(const VectorXd& b) const;
  void prepare();
  void solve_column(const double* b, double* x, SolveResult& result) const;

  Solver& solver;
  Index n = 0;
  std::uint64_t stamp = 0;
  bool symmetric = false;
  Inertia inertia;
  std::optional<Border> border;
  std::vector<Index> added;   // changes of the unknowns n, n + 1, ...
  std::vector<char> removed;  // by unknown
  double norm = 0;            // |changed matrix|_inf, a lower bound
  bool stale = true;          // the changes have changed since prepare()
};

void ChangedSystem::Impl::remove(std::span<const Index> unknowns) {
  check_list(unknowns, false);
  std::vector<Index> own;
  for (const Index v : unknowns)
    if (v < n) own.push_back(v);
  MatrixXd e = MatrixXd::Zero(n, static_cast<Eigen::Index>(own.size()));
  for (std::size_t k = 0; k < own.size(); ++k) e(own[k], static_cast<Eigen::Index>(k)) = 1;
  if (!own.empty()) append(Sort::removed, e, e, MatrixXd::Zero(e.cols(), e.cols()), true);
  for (const Index v : unknowns) {
    removed[static_cast<std::size_t>(v)] = 1;
    if (v >= n) border->set_active(added[static_cast<std::size_t>(v - n)], false);
  }
  stale = true;
}

void ChangedSystem::Impl::restore(std::span<const Index> unknowns) {
  check_list(unknowns, true);
  for (const Index v : unknowns) {
    removed[static_cast<std::size_t>(v)] = 0;
    if (v >= n) {
      border->set_active(added[static_cast<std::size_t>(v - n)], true);
      continue;
    }
    const Index k = remover_of(v);
    border->erase(k);
    for (Index& a : added)
      if (a > k) --a;
  }
  stale = true;
}

void ChangedSystem::Impl::add_changes(const VectorXd& x, double sign, bool transpose, VectorXd& y) const {
  const Border& c = *border;
  const MatrixXd &left = transpose ? c.w() : c.u(), &right = transpose ? c.u() : c.w();
  auto top = y.head(n);
  for (Index k = 0; k < c.count(); ++k)  // U C V^T: U (W x); of the transpose, W^T (U^T x)
    if (c.sort(k) == Sort::low_rank) top += (sign * right.col(k).dot(x.head(n))) * left.col(k);
  for (std::size_t j = 0; j < added.size(); ++j) {
    const Index k = added[j];
    const Eigen::Index me = n + static_cast<Eigen::Index>(j);
    if (!c.active(k)) continue;
    top += (sign * x[me]) * left.col(k);
    double sum = right.col(k).dot(x.head(n));
    for (std::size_t i = 0; i < added.size(); ++i)
      sum += (transpose ? c.d()(added[i], k) : c.d()(k, added[i])) * x[n + static_cast<Eigen::Index>(i)];
    y[me] += sign * sum;
  }
}

VectorXd ChangedSystem::Impl::multiply(VectorXd x, bool transpose) const {
  drop_removed(x);
  VectorXd y = VectorXd::Zero(size());
  session().factor->residual().multiply(x.data(), y.data(), transpose);
  add_changes(x, 1, transpose, y);
  drop_removed(y);
  return y;
}

VectorXd ChangedSystem::Impl::residual(const VectorXd& b, const VectorXd& x) const {
  VectorXd r = b;
  (void)session().factor->residual().compute(b.data(), x.data(), r.data(), false);
  add_changes(x, -1, false, r);
  drop_removed(r);
  return r;
}

VectorXd ChangedSystem::Impl::substitute(const VectorXd& b) const {
  VectorXd y(n);
  session().factor->numeric().solve(b.data(), y.data(), 1, false);
  VectorXd right = -(border->w().transpose() * y);
  for (std::size_t j = 0; j < added.size(); ++j) right[added[j]] += b[n + static_cast<Eigen::Index>(j)];
  const VectorXd t = border->solve(right);
  VectorXd x(size());
  x.head(n) = y - border->response() * t;
  for (std::size_t j = 0; j < added.size(); ++j) x[n + static_cast<Eigen::Index>(j)] = t[added[j]];
  drop_removed(x);
  return x;
}

// @throws Error(singular)
void ChangedSystem::Impl::prepare() {
  if (!stale) return;
  if (!border->factorize())
    throw Error(
        StatusCode::singular,
        fmt::format("the changed matrix is singular: so are the {} rows of its changes, condensed; constraints that "
                    "depend on others must go",
                    border->active_count()));
  // |M|_inf = |M^T|_1
  norm =
      solver::estimate_inverse_norm<double>(size(), [this](const double* x, double* y, Index columns, bool transpose) {
        for (const double* end = x + Offset{columns} * size(); x != end; x += size(), y += size())
          Eigen::Map<VectorXd>(y, size()) = multiply(Eigen::Map<const VectorXd>(x, size()), !transpose);
      });
  stale = false;
}

void ChangedSystem::Impl::solve_column(const double* given, double* to, SolveResult& result) const {
  const Options& o = session().options;
  VectorXd b = Eigen::Map<const VectorXd>(given, size());
  drop_removed(b);
  for (Eigen::Index i = 0; i < b.size(); ++i)
    if (!std::isfinite(b[i]))
      throw Error(StatusCode::invalid_input, fmt::format("row {} of a right-hand side is {}", i, b[i]),
                  static_cast<Index>(i));
  const auto largest = [](const VectorXd& v) { return v.size() == 0 ? 0.0 : v.cwiseAbs().maxCoeff(); };
  VectorXd x = substitute(b), r = residual(b, x);
  const auto error_of = [&](const VectorXd& of_r, const VectorXd& of_x) {
    const double scale = norm * largest(of_x) + largest(b), size_of_r = largest(of_r);
    if (!of_r.allFinite()) return std::numeric_limits<double>::infinity();
    return size_of_r == 0 ? 0.0 : size_of_r / scale;
  };
  double error = error_of(r, x);
  int steps = 0;
  for (; steps < o.refinement_steps && error > o.refinement_target && std::isfinite(error); ++steps) {
    const VectorXd better = x + substitute(r);
    const VectorXd left = residual(b, better);
    const double now = error_of(left, better);
    if (!(now < error)) break;
    const bool slow = now > error / 2;
    x = better;
    r = left;
    error = now;
    if (slow) break;
  }
  Eigen::Map<VectorXd>(to, size()) = x;
  result.refinement_steps = std::max(result.refinement_steps, steps);
  result.backward_error = std::max(result.backward_error, error);
}

ChangedSystem::ChangedSystem(Solver& solver) : impl_(std::make_unique<Impl>(solver)) {}
ChangedSystem::~ChangedSystem() = default;
ChangedSystem::ChangedSystem(ChangedSystem&&) noexcept = default;
ChangedSystem& ChangedSystem::operator=(ChangedSystem&&) noexcept = default;

void ChangedSystem::reset() { impl_->reset(); }
Index ChangedSystem::size() const { return impl_->size(); }
Index ChangedSystem::changes() const { return impl_->border->active_count(); }

Status ChangedSystem::add(std::span<const double> columns, Index count, std::span<const double> rows,
                          std::span<const double> corner) {
  Impl& m = *impl_;
  m.expect_factor("add");
  if (count < 1) throw std::invalid_argument(fmt::format("ChangedSystem::add: {} unknowns", count));
  check_size("add", "columns", columns.size(), area(m.n, count), false);
  check_size("add", "rows", rows.size(), area(m.n, count), true);
  check_size("add", "corner", corner.size(), area(count, count), true);
  return m.guarded([&] {
    check_finite(columns, "the columns");
    check_finite(rows, "the rows");
    check_finite(corner, "the corner");
    const MatrixXd u = ConstMap(columns.data(), m.n, count);
    const MatrixXd w = rows.empty() ? u : MatrixXd(ConstMap(rows.data(), m.n, count));
    MatrixXd d = MatrixXd::Zero(count, count);
    if (!corner.empty()) d = ConstMap(corner.data(), count, count);
    const Index first = m.border->count();
    m.append(Sort::added, u, w, d, u == w && d == d.transpose());
    for (Index k = 0; k < count; ++k) m.added.push_back(first + k);
    m.removed.resize(m.removed.size() + static_cast<std::size_t>(count), 0);
  });
}

Status ChangedSystem::remove(std::span<const Index> unknowns) {
  impl_->expect_factor("remove");
  return impl_->guarded([&] { impl_->remove(unknowns); });
}

Status ChangedSystem::restore(std::span<const Index> unknowns) {
  impl_->expect_factor("restore");
  return impl_->guarded([&] { impl_->restore(unknowns); });
}

Status ChangedSystem::add_low_rank(std::span<const double> u, Index rank, std::span<const double> c,
                                   std::span<const double> v) {
  Impl& m = *impl_;
  m.expect_factor("add_low_rank");
  if (rank < 1) throw std::invalid_argument(fmt::format("ChangedSystem::add_low_rank: rank {}", rank));
  check_size("add_low_rank", "u", u.size(), area(m.n, rank), false);
  check_size("add_low_rank", "v", v.size(), area(m.n, rank), true);
  check_size("add_low_rank", "c", c.size(), area(rank, rank), true);
  return m.guarded([&] {
    check_finite(u, "u");
    check_finite(v, "v");
    check_finite(c, "c");
    MatrixXd left = ConstMap(u.data(), m.n, rank);
    MatrixXd core = c.empty() ? MatrixXd(MatrixXd::Identity(rank, rank)) : MatrixXd(ConstMap(c.data(), rank, rank));
    const MatrixXd right = v.empty() ? left : MatrixXd(ConstMap(v.data(), m.n, rank));
    const bool is_symmetric = left == right && core == core.transpose();
    VectorXd values = VectorXd::Ones(rank);
    if (is_symmetric) {  // U Q L (U Q)^T: one row and column for each eigenvalue, which the inertia needs
      const Eigen::SelfAdjointEigenSolver<MatrixXd> eigen(core);
      left = left * eigen.eigenvectors();
      values = eigen.eigenvalues();
    }
    const MatrixXd w = is_symmetric ? MatrixXd(left * values.asDiagonal()) : MatrixXd(right * core.transpose());
    m.append(Sort::low_rank, left, w, -MatrixXd::Identity(rank, rank), is_symmetric);
  });
}

SolveResult ChangedSystem::solve(std::span<const double> b, std::span<double> x, Index columns) {
  Impl& m = *impl_;
  m.expect_factor("solve");
  if (columns < 1) throw std::invalid_argument(fmt::format("ChangedSystem::solve: {} right-hand sides", columns));
  check_size("solve", "b", b.size(), area(m.size(), columns), false);
  check_size("solve", "x", x.size(), area(m.size(), columns), false);
  const double start = base::now_seconds();
  SolveResult result;
  result.componentwise_error = std::numeric_limits<double>::quiet_NaN();
  Status status = m.guarded([&] {
    m.prepare();
    for (Index c = 0; c < columns; ++c)
      m.solve_column(b.data() + area(m.size(), c), x.data() + area(m.size(), c), result);
    const double limit = m.session().options.required_backward_error;
    if (!(result.backward_error <= limit))
      throw Error(
          StatusCode::accuracy_not_reached,
          fmt::format("the backward error is {:.1e} after {} steps of refinement, above the {:.1e} asked for: the "
                      "changes are too large beside the matrix; factorize the changed one",
                      result.backward_error, result.refinement_steps, limit));
  });
  if (!status.ok()) result.status = std::move(status);
  result.seconds = result.solve_seconds = base::now_seconds() - start;
  return result;
}

// In [A U; W D] = In A + In S. Of low rank, with the row and column of an eigenvalue l scaled to [A u; u^T -1/l]: one
// eigenvalue of the sign of -l besides those of A + l u u^T. A removed unknown and its slack: one of either sign
// besides those of the rest.
Inertia ChangedSystem::inertia() const {
  const Impl& m = *impl_;
  m.expect_factor("inertia");
  if (!m.symmetric || !m.border->symmetric()) return {};
  const Border& c = *m.border;
  MatrixXd s = c.complement();
  const std::vector<Index> numbers = c.numbers();
  std::vector<Eigen::Index> counted;
  Inertia all = m.inertia;
  for (std::size_t k = 0; k < numbers.size(); ++k) {
    const Index number = numbers[k];
    if (c.sort(number) == Sort::removed) {
      --all.positive;
      --all.negative;
    }
    if (c.sort(number) == Sort::low_rank) {
      const double u = c.u().col(number).squaredNorm(), l = u > 0 ? c.w().col(number).dot(c.u().col(number)) / u : 0;
      if (l == 0) continue;
      s.row(static_cast<Eigen::Index>(k)) /= l;  // W = l U^T
      --(l > 0 ? all.negative : all.positive);
    }
    counted.push_back(static_cast<Eigen::Index>(k));
  }
  if (counted.empty()) return all;
  MatrixXd core = s(counted, counted);
  const VectorXd scale = core.cwiseAbs().rowwise().maxCoeff().unaryExpr(
      [](double x) { return x > 0 && std::isfinite(x) ? std::ldexp(1.0, -std::ilogb(x) / 2) : 1.0; });
  core = scale.asDiagonal() * ((core + core.transpose()) / 2) * scale.asDiagonal();
  const VectorXd values = Eigen::SelfAdjointEigenSolver<MatrixXd>(core, Eigen::EigenvaluesOnly).eigenvalues();
  const double zero =
      4 * static_cast<double>(values.size()) * std::numeric_limits<double>::epsilon() * values.cwiseAbs().maxCoeff();
  for (const double v : values) ++(std::abs(v) <= zero ? all.zero : v > 0 ? all.positive : all.negative);
  return all;
}

}  // namespace espalier
