#include "dynamics/constraints/redundancy.hpp"

#include <fmt/format.h>

#include <Eigen/Core>
#include <algorithm>
#include <cmath>
#include <functional>
#include <queue>
#include <utility>

#include "base/at.hpp"
#include "dense/dense.hpp"

namespace espalier::dynamics {

namespace {

struct Entry {
  Index index;
  double value;
};

/// The elimination. Kept rows are stored reduced; lower_ remembers the multipliers, to express a dependent row in terms
/// of the original ones.
class RowElimination {
 public:
  RowElimination(const SparsePattern& p, ConstSpan values, double tolerance, std::size_t most_partners)
      : p_(p),
        values_(values),
        tolerance_(tolerance),
        most_partners_(most_partners),
        work_(at(p.cols), 0.0),
        queued_(at(p.rows), 0),
        rank_of_(at(p.cols), -1) {}

  std::vector<DependentRow> run(std::span<const Index> last) {
    for (Index row = 0; row < p_.rows; ++row)
      if (!std::binary_search(last.begin(), last.end(), row)) eliminate(row);
    for (const Index row : last) eliminate(row);
    return std::move(dependent_);
  }

 private:
  void scatter(Index column, double value) {
    if (work_[at(column)] == 0 && value != 0) touched_.push_back(column);
    work_[at(column)] += value;
    const Index k = rank_of_[at(column)];
    if (k >= 0 && !queued_[at(k)]) {
      queued_[at(k)] = 1;
      queue_.push(k);
    }
  }

  void eliminate(Index row) {
    double size = 0;
    touched_.clear();
    for (Offset e = p_.ptr[at(row)]; e < p_.ptr[at(row) + 1]; ++e) {
      size = std::max(size, std::abs(values_[at(e)]));
      scatter(p_.ind[at(e)], values_[at(e)]);
    }
    std::vector<Entry> lower;
    while (!queue_.empty()) {  // earlier pivots first
      const Index k = queue_.top();
      queue_.pop();
      queued_[at(k)] = 0;
      const double factor = work_[at(pivot_column_[at(k)])] / reduced_[at(k)].front().value;
      if (factor == 0) continue;
      lower.push_back({k, factor});
      for (const Entry& e : reduced_[at(k)]) scatter(e.index, -factor * e.value);
      work_[at(pivot_column_[at(k)])] = 0;
    }
    Index pivot = -1;
    double largest = 0;
    for (const Index c : touched_) {
      if (rank_of_[at(c)] < 0 && std::abs(work_[at(c)]) > largest) {
        largest = std::abs(work_[at(c)]);
        pivot = c;
      }
    }
    if (largest <= tolerance_ * size || pivot < 0) {
      note_dependent(row, size > 0 ? largest / size : 0.0, lower);
    } else {
      keep(row, pivot, size, std::move(lower));
    }
    for (const Index c : touched_) work_[at(c)] = 0;
  }

  void keep(Index row, Index pivot, double size, std::vector<Entry> lower) {
    std::vector<Entry> reduced = {{pivot, work_[at(pivot)]}};
    for (const Index c : touched_) {
      const double value = work_[at(c)];
      work_[at(c)] = 0;
      // Entries at round-off of the row are dropped, or they would fill the rows to come.
      if (c != pivot && rank_of_[at(c)] < 0 && std::abs(value) > 1e-15 * size) reduced.push_back({c, value});
    }
    rank_of_[at(pivot)] = static_cast<Index>(reduced_.size());
    pivot_column_.push_back(pivot);
    reduced_.push_back(std::move(reduced));
    lower_.push_back(std::move(lower));
    row_of_.push_back(row);
  }

  // row = sum_k l_k reduced_k, and reduced_k = row_k - sum_j l_kj reduced_j: back substitution from the last pivot. In
  // a long chain of loops it runs back to the first one, so it stops at most_partners_ rows.
  void note_dependent(Index row, double remainder, const std::vector<Entry>& lower) {
    weight_.resize(reduced_.size(), 0.0);
    std::priority_queue<Index> open;
    const auto add = [&](Index k, double value) {
      if (weight_[at(k)] == 0 && value != 0) open.push(k);
      weight_[at(k)] += value;
    };
    for (const Entry& e : lower) add(e.index, e.value);
    std::vector<Entry> partners;
    Index last = -1;
    while (!open.empty()) {
      const Index k = open.top();
      open.pop();
      if (k == last) continue;
      last = k;
      const double value = std::exchange(weight_[at(k)], 0.0);
      if (value == 0 || partners.size() == most_partners_) continue;
      partners.push_back({row_of_[at(k)], value});
      for (const Entry& e : lower_[at(k)]) add(e.index, -value * e.value);
    }
    std::sort(partners.begin(), partners.end(), [](const Entry& a, const Entry& b) {
      return std::abs(a.value) != std::abs(b.value) ? std::abs(a.value) > std::abs(b.value) : a.index < b.index;
    });
    DependentRow d{row, remainder, {}, {}};
    for (const Entry& e : partners) {
      if (std::abs(e.value) <= 1e-9 * std::abs(partners.front().value)) break;
      d.partners.push_back(e.index);
      d.weights.push_back(e.value);
    }
    dependent_.push_back(std::move(d));
  }

  const SparsePattern& p_;
  ConstSpan values_;
  double tolerance_;
  std::size_t most_partners_;
  std::vector<double> work_, weight_;  // weight_: of note_dependent, zero between calls
  std::vector<char> queued_;
  std::vector<Index> rank_of_;       // pivot number of a column, -1: none
  std::vector<Index> pivot_column_;  // column of a pivot
  std::vector<Index> row_of_;        // original row of a pivot
  std::vector<std::vector<Entry>> reduced_, lower_;
  std::vector<Index> touched_;
  std::priority_queue<Index, std::vector<Index>, std::greater<>> queue_;
  std::vector<DependentRow> dependent_;
};

}  // namespace

std::vector<DependentRow> find_dependent_rows(const SparsePattern& phi_q, ConstSpan values, double tolerance,
                                              std::size_t most_partners, std::span<const Index> last) {
  return RowElimination(phi_q, values, tolerance, most_partners).run(last);
}

std::vector<double> RedundancyGuard::scaled_rows(double t, ConstSpan q, std::vector<double>& sizes) {
  System& system = equations_.system();
  std::vector<double> values(at(system.constraint_pattern().nonzeros()));
  system.constraints(t, q, {}, {{}, {}, {}, values});
  const SparsePattern& p = system.constraint_pattern();
  const std::vector<char> lengths = length_coordinates(system, q);
  std::vector<double> magnitude(lengths.size());
  system.magnitude(q, magnitude);
  double extent = 0;
  for (std::size_t i = 0; i < lengths.size(); ++i)
    if (lengths[i] != 0) extent = std::max(extent, magnitude[i]);
  for (Index row = 0; row < p.rows; ++row) {
    double way = 0, arm = 0;
    for (Offset e = p.ptr[at(row)]; e < p.ptr[at(row) + 1]; ++e) {
      double& most = lengths[at(p.ind[at(e)])] != 0 ? way : arm;
      most = std::max(most, std::abs(values[at(e)]));
    }
    if (way > 0) extent = std::max(extent, arm / way);
  }
  for (std::size_t k = 0; k < values.size(); ++k)
    if (lengths[at(p.ind[k])] != 0 && extent > 0) values[k] *= extent;
  sizes.assign(at(p.rows), 0.0);
  for (Index row = 0; row < p.rows; ++row) {
    double& size = sizes[at(row)];
    for (Offset e = p.ptr[at(row)]; e < p.ptr[at(row) + 1]; ++e) size = std::max(size, std::abs(values[at(e)]));
    for (Offset e = p.ptr[at(row)]; e < p.ptr[at(row) + 1]; ++e)
      values[at(e)] = absent(row) || size == 0 ? 0 : values[at(e)] / size;
  }
  return values;
}

std::vector<DependentRow> RedundancyGuard::dependent_at(double t, ConstSpan q, const std::vector<DependentRow>& last) {
  // Four are named; the nearest rows of the loop that closes are among the first found.
  constexpr std::size_t kMostPartners = 64;
  std::vector<double> sizes;
  const std::span<const Index> velocities = equations_.system().non_holonomic();
  std::vector<Index> after(velocities.begin(), velocities.end());
  for (const DependentRow& d : last) after.push_back(d.row);
  std::sort(after.begin(), after.end());
  after.erase(std::unique(after.begin(), after.end()), after.end());
  std::vector<DependentRow> rows = find_dependent_rows(
      equations_.system().constraint_pattern(), scaled_rows(t, q, sizes), options_.tolerance, kMostPartners, after);
  std::erase_if(rows, [&](const DependentRow& d) { return absent(d.row); });
  return rows;
}

void RedundancyGuard::adopt(const std::vector<char>& dropped) {
  redundant_.clear();
  for (Index row = 0; row < static_cast<Index>(dropped.size()); ++row)
    if (dropped[at(row)] != 0 && !absent(row))
      redundant_.push_back({row, equations_.system().constraint_name(row), {}, 0});
  equations_.set_dropped(dropped);
}

void RedundancyGuard::analyze(const State& state) {
  std::vector<char> dropped(state.lambda.size(), 0);
  const auto mark = [&](const std::vector<DependentRow>& rows) {
    std::fill(dropped.begin(), dropped.end(), 0);
    if (!absent_.empty()) dropped = absent_;
    redundant_.clear();
    for (const DependentRow& d : rows) {
      dropped[at(d.row)] = 1;
      RedundantConstraint r;
      r.row = d.row;
      r.name = equations_.system().constraint_name(d.row);
      for (std::size_t k = 0; k < std::min<std::size_t>(4, d.partners.size()); ++k) {
        r.partners.push_back(equations_.system().constraint_name(d.partners[k]));
      }
      redundant_.push_back(std::move(r));
    }
    equations_.set_dropped(dropped);
  };
  const std::vector<DependentRow> here = dependent_at(state.t, state.q);
  mark(here);
  if (here.empty() || here.size() == state.lambda.size()) return;
  // Beside the configuration: a step of 1e-3 (angle, or of the extent) in a fixed pseudo-random direction, brought back
  // to the constraints that are kept. If fewer rows depend there, the configuration given was singular.
  State beside = state;
  std::vector<double> step = coordinate_sizes(equations_.system(), state.q);
  for (std::size_t i = 0; i < step.size(); ++i) step[i] *= 1e-3 * std::sin(12.9898 * static_cast<double>(i + 1));
  equations_.system().retract(state.q, step, beside.q);
  std::fill(beside.v.begin(), beside.v.end(), 0.0);
  try {
    ConsistencyOptions options;
    options.tolerance = 1e-10;
    make_consistent(equations_, beside, options);
  } catch (const Error& error) {
    if (error.status().code == StatusCode::cancelled) throw;
    return;  // no neighbour found: the decision at the given configuration stands
  }
  // Those that are kept come first. A row that has lost its direction here has a little of it there, and would take the
  // place of one that has all of it: all rows behind it would be lost in rounding.
  const std::vector<DependentRow> there = dependent_at(beside.t, beside.q, here);
  if (there.size() < here.size()) mark(there);
}

ConsistencyResult RedundancyGuard::prepare(State& state, const ConsistencyOptions& options) {
  analyze(state);
  const ConsistencyResult result = make_consistent(equations_, state, options);
  check(state);
  return result;
}

void RedundancyGuard::check(const State& state, bool at_rest) {
  if (redundant_.empty()) return;
  System& system = equations_.system();
  const std::size_t m = state.lambda.size();
  std::vector<double> phi(m), nu(m), values(at(system.constraint_pattern().nonzeros())), rate(m);
  system.constraints(state.t, state.q, {}, {phi, nu, {}, values});
  multiply_by_rows(system.constraint_pattern(), values, state.v, rate);
  const double speed = std::max(1.0, max_norm(state.v));
  const std::vector<double> sizes = constraint_sizes(system, state.q, values);
  for (RedundantConstraint& r : redundant_) {
    const auto i = at(r.row);
    r.violation = std::abs(phi[i]);
    const double slip = at_rest ? 0 : std::abs(rate[i] - nu[i]) / speed;
    const double allowed = options_.inconsistency * sizes[i];
    if (r.violation <= allowed && slip <= allowed) continue;
    const std::string partner = r.partners.empty() ? "the other constraints" : r.partners.front();
    const bool position = r.violation > allowed;
    throw Error(
        StatusCode::invalid_input,
        fmt::format("{} contradicts {} at t = {:f}: {} differs by {:f}; correct the geometry (or the prescribed "
                    "motion) of one of the two, or remove one",
                    r.name, partner, state.t, position ? "position" : "velocity",
                    position ? r.violation : slip * speed),
        r.row);
  }
}

// With rows and multipliers scaled to mu_i = s_i lambda_i, Phi_q^T n = 0 for n = e_row - sum weight e_partner of each
// row left out: mu + N y with the least length.
void RedundancyGuard::share_reactions(State& state) {
  constexpr std::size_t kMostLeftOut = 200, kMostRows = 3000;
  constexpr double kDependent = 1e-6;  // looser than for the decision: joints do not hold exactly
  constexpr std::size_t kAll = ~std::size_t{0};
  if (redundant_.empty() || redundant_.size() > kMostLeftOut) return;
  std::vector<double> sizes;
  const std::vector<double> values = scaled_rows(state.t, state.q, sizes);
  std::vector<DependentRow> rows = find_dependent_rows(equations_.system().constraint_pattern(), values, kDependent,
                                                       kAll, equations_.system().non_holonomic());
  std::erase_if(rows, [&](const DependentRow& d) { return absent(d.row) || equations_.dropped()[at(d.row)] == 0; });
  if (rows.empty()) return;
  std::vector<Index> shared;  // rows that some left out one depends on, and those themselves
  for (const DependentRow& d : rows) {
    shared.push_back(d.row);
    shared.insert(shared.end(), d.partners.begin(), d.partners.end());
  }
  std::sort(shared.begin(), shared.end());
  shared.erase(std::unique(shared.begin(), shared.end()), shared.end());
  if (shared.size() > kMostRows) return;
  const auto place = [&](Index row) { return std::lower_bound(shared.begin(), shared.end(), row) - shared.begin(); };
  const auto m = static_cast<Eigen::Index>(shared.size()), count = static_cast<Eigen::Index>(rows.size());
  Eigen::MatrixXd null = Eigen::MatrixXd::Zero(m, count);
  for (Eigen::Index j = 0; j < count; ++j) {
    const DependentRow& d = rows[at(j)];
    null(place(d.row), j) = 1;
    for (std::size_t k = 0; k < d.partners.size(); ++k) null(place(d.partners[k]), j) = -d.weights[k];
  }
  Eigen::VectorXd s(m), mu(m);
  for (Eigen::Index i = 0; i < m; ++i) {
    const auto row = at(shared[at(i)]);
    s[i] = sizes[row] > 0 ? sizes[row] : 1;
    mu[i] = s[i] * state.lambda[row];
  }
  const Eigen::VectorXd change = (null * dense::least_squares(null, -mu)).cwiseQuotient(s);
  for (Eigen::Index i = 0; i < m; ++i) state.lambda[at(shared[at(i)])] += change[i];
}

std::vector<std::string> RedundancyGuard::notices() const {
  std::vector<std::string> lines;
  for (const RedundantConstraint& r : redundant_) {
    std::string line = r.name + " is redundant and is left out; it follows from ";
    for (std::size_t k = 0; k < r.partners.size(); ++k) line += (k == 0 ? "" : ", ") + r.partners[k];
    if (r.partners.empty()) line = r.name + " is redundant and is left out";
    lines.push_back(line + " (reactions are not determined: those of least norm are given)");
  }
  return lines;
}

Index RedundancyGuard::degrees_of_freedom() const {
  const Sizes s = equations_.sizes();
  const auto absent = static_cast<Index>(std::count(absent_.begin(), absent_.end(), char{1}));
  return s.velocity - s.constraints + static_cast<Index>(redundant_.size()) + absent;
}

}  // namespace espalier::dynamics
