#include "dynamics/contact/impact.hpp"

#include <fmt/format.h>

#include <Eigen/Core>
#include <algorithm>
#include <cmath>
#include <numeric>

#include "dense/dense.hpp"
#include "dynamics/contact/impact_friction.hpp"

namespace espalier::dynamics::contact {
namespace {

constexpr int kMostRounds = 100;

/// @param by  gradient by the coordinates of the point
double along(const ImpactPoint& p, const std::vector<double>& by, ConstSpan x) {
  double sum = 0;
  for (std::size_t k = 0; k < by.size(); ++k) sum += by[k] * x[static_cast<std::size_t>(p.coordinates[k])];
  return sum;
}
double along(const ImpactPoint& p, ConstSpan x) { return along(p, p.gap_by, x); }

class Impact {
 public:
  Impact(Equations& equations, State& state, std::vector<ImpactPoint>& points)
      : equations_(equations), state_(state), points_(points), columns_(points.size()), slow_(points.size(), -1) {
    equations_.evaluate_constraints(state.t, state.q, {});
    equations_.factorize(state.view(), {1, 0, 0});
    read_masses();
    double speed = 0;
    for (const ImpactPoint& p : points_) {
      double gross = 0;
      for (std::size_t k = 0; k < p.gap_by.size(); ++k)
        gross += std::abs(p.gap_by[k] * state.v[static_cast<std::size_t>(p.coordinates[k])]);
      speed = std::max(speed, gross);
    }
    rounding_ = kRateRounding * speed;
  }

  void run() {
    for (int round = 1;; ++round) {
      const std::vector<std::size_t> approaching = those_that_approach();
      if (approaching.empty()) break;
      const bool last = round > kMostRounds;
      std::vector<std::size_t> all(points_.size());
      std::iota(all.begin(), all.end(), 0U);
      strike(last ? all : approaching, last);
      if (last) break;
    }
    for (std::size_t i = 0; i < points_.size(); ++i) {
      ImpactPoint& p = points_[i];
      if (!p.closed || p.held || rate(i) > rounding_) continue;
      p.rests = true;
      const double sink = column(i).empty() ? 0 : sink_of(i);
      p.damping = sink > 0 ? 2 * std::sqrt(slope(p.law, sink) * mass(i)) : 0;
    }
  }

 private:
  [[nodiscard]] double rate(std::size_t i) const { return along(points_[i], state_.v); }
  [[nodiscard]] std::vector<std::size_t> those_that_approach() {
    std::vector<std::size_t> found;
    for (std::size_t i = 0; i < points_.size(); ++i)
      if (rate(i) < -rounding_) found.push_back(i);
    return found;
  }

  void read_masses() {
    const SparsePattern& pattern = equations_.system().tangent_pattern();
    std::vector<double> values(static_cast<std::size_t>(pattern.nonzeros()));
    equations_.system().tangent(state_.view(), {1, 0, 0}, values);
    masses_.resize(static_cast<std::size_t>(pattern.cols));
    for (Index j = 0; j < pattern.cols; ++j)
      masses_[static_cast<std::size_t>(j)] = values[static_cast<std::size_t>(find_entry(pattern, j, j))];
  }

  /// dv of a unit impulse; empty where the joints let the point move neither way.
  const std::vector<double>& column(std::size_t i) {
    if (!columns_[i].known) columns_[i].dv = jump_of(points_[i], points_[i].gap_by);
    columns_[i].known = true;
    return columns_[i].dv;
  }
  [[nodiscard]] std::vector<double> jump_of(const ImpactPoint& p, const std::vector<double>& by) {
    const auto n = state_.v.size();
    std::vector<double> x(n + state_.lambda.size(), 0.0);
    double free = 0;  // 1 / m without joints
    for (std::size_t k = 0; k < by.size(); ++k) {
      const auto at = static_cast<std::size_t>(p.coordinates[k]);
      x[at] += by[k];
      free += by[k] * by[k] / masses_[at];
    }
    equations_.solve(x);
    x.resize(n);
    constexpr double kHeld = 1e-10;
    if (!(along(p, by, x) > kHeld * free)) x.clear();
    return x;
  }
  [[nodiscard]] double mass(std::size_t i) { return 1 / along(points_[i], column(i)); }

  [[nodiscard]] static double slope(const ContactLaw& law, double sink) {
    return law.stiffness * law.exponent * std::pow(sink, law.exponent - 1);
  }
  /// How far it would be pressed in at rest by what accelerates it now; 0: nothing does.
  [[nodiscard]] double sink_of(std::size_t i) {
    const double a = -along(points_[i], state_.a);
    return a > 0 ? std::pow(mass(i) * a / points_[i].law.stiffness, 1 / points_[i].law.exponent) : 0;
  }
  /// Slower than that, it stays.
  [[nodiscard]] double slow(std::size_t i) {
    if (slow_[i] < 0) {
      const double a = -along(points_[i], state_.a), sink = sink_of(i);
      slow_[i] = sink > 0 ? a * std::sqrt(mass(i) / slope(points_[i].law, sink)) : 0;
    }
    return slow_[i];
  }

  void strike(const std::vector<std::size_t>& among, bool plastic) {
    if (std::any_of(among.begin(), among.end(), [&](std::size_t i) { return points_[i].law.friction > 0; })) {
      strike_with_friction(among, plastic);
      return;
    }
    std::vector<double> before(points_.size());
    for (const std::size_t i : among) before[i] = rate(i);
    const std::vector<double> v = state_.v;
    const auto [set, p] = plastic_impulses(among);
    const std::vector<double> factors = one_plus_restitution(set, before, plastic);
    state_.v = v;
    for (std::size_t k = 0; k < set.size(); ++k) push(set[k], factors[k] * p[static_cast<Eigen::Index>(k)]);
  }

  void strike_with_friction(const std::vector<std::size_t>& among, bool plastic) {
    std::vector<double> before(points_.size());
    for (const std::size_t i : among) {
      before[i] = rate(i);
      if (column(i).empty()) fail_held(i, -before[i]);
    }
    const std::vector<double> factors = one_plus_restitution(among, before, plastic);
    const auto n = static_cast<Eigen::Index>(among.size());
    FrictionImpact in{Eigen::MatrixXd::Zero(3 * n, 3 * n), Eigen::VectorXd::Zero(3 * n), Eigen::VectorXd(n),
                      Eigen::VectorXd(n)};
    std::vector<std::vector<double>> jumps;
    for (Eigen::Index i = 0; i < n; ++i) {
      const std::size_t at = among[static_cast<std::size_t>(i)];
      const ImpactPoint& p = points_[at];
      in.restitution[i] = factors[static_cast<std::size_t>(i)] - 1;
      in.friction[i] = p.law.friction;
      in.before[3 * i] = before[at];
      jumps.push_back(column(at));
      for (std::size_t k = 0; k < 2; ++k) {
        in.before[3 * i + 1 + static_cast<Eigen::Index>(k)] = along(p, p.slip_by[k], state_.v);
        jumps.push_back(jump_of(p, p.slip_by[k]));
      }
    }
    for (Eigen::Index c = 0; c < 3 * n; ++c) {
      const std::vector<double>& jump = jumps[static_cast<std::size_t>(c)];
      for (Eigen::Index i = 0; i < n && !jump.empty(); ++i) {
        const ImpactPoint& p = points_[among[static_cast<std::size_t>(i)]];
        in.w(3 * i, c) = along(p, jump);
        for (std::size_t k = 0; k < 2; ++k)
          in.w(3 * i + 1 + static_cast<Eigen::Index>(k), c) = along(p, p.slip_by[k], jump);
      }
    }
    const Eigen::VectorXd impulses = friction_impulses(in);
    for (Eigen::Index c = 0; c < 3 * n; ++c) {
      const std::vector<double>& jump = jumps[static_cast<std::size_t>(c)];
      for (std::size_t k = 0; k < jump.size(); ++k) state_.v[k] += impulses[c] * jump[k];
      if (c % 3 == 0) points_[among[static_cast<std::size_t>(c / 3)]].impulse += impulses[c];
    }
  }

  void push(std::size_t i, double impulse) {
    const std::vector<double>& x = columns_[i].dv;
    for (std::size_t k = 0; k < x.size(); ++k) state_.v[k] += impulse * x[k];
    points_[i].impulse += impulse;
  }

  [[noreturn]] void fail_held(std::size_t i, double speed) const {
    throw Error(StatusCode::invalid_input,
                fmt::format("at t = {:g} {} strike with {:g}, and their joints hold them so that no impulse can part "
                            "them; let one of them give way",
                            state_.t, points_[i].surfaces, speed));
  }

  /// The complementarity problem over some points, by the active set of Lawson and Hanson, Solving Least Squares
  /// Problems (1974), ch. 23: the one that approaches fastest is taken in, those that would be pulled are let go.
  /// Leaves v as it is then; rates of all points are asked of v, so only columns of points taken in are needed.
  std::pair<std::vector<std::size_t>, Eigen::VectorXd> plastic_impulses(const std::vector<std::size_t>& among) {
    const std::vector<double> begin = state_.v;
    std::vector<std::size_t> set;
    Eigen::VectorXd p(0);
    const std::size_t most = 3 * among.size() + 10;
    for (std::size_t pass = 0; pass < most; ++pass) {
      std::size_t fastest = points_.size();
      double least = -rounding_;
      for (const std::size_t i : among)
        if (rate(i) < least && std::find(set.begin(), set.end(), i) == set.end()) least = rate(i), fastest = i;
      if (fastest == points_.size()) break;
      if (column(fastest).empty()) fail_held(fastest, -least);
      set.push_back(fastest);
      p.conservativeResize(p.size() + 1);
      p[p.size() - 1] = 0;
      settle(begin, set, p);
      state_.v = begin;
      for (std::size_t k = 0; k < set.size(); ++k)
        for (std::size_t j = 0; j < state_.v.size(); ++j)
          state_.v[j] += p[static_cast<Eigen::Index>(k)] * columns_[set[k]].dv[j];
    }
    return {set, p};
  }

  /// p = -W^-1 u on the set, after all have left it that would get p < 0.
  void settle(const std::vector<double>& begin, std::vector<std::size_t>& set, Eigen::VectorXd& p) {
    for (;;) {
      const auto count = static_cast<Eigen::Index>(set.size());
      Eigen::MatrixXd w(count, count);
      Eigen::VectorXd u(count);
      for (Eigen::Index r = 0; r < count; ++r) {
        u[r] = along(points_[set[static_cast<std::size_t>(r)]], begin);
        for (Eigen::Index c = 0; c < count; ++c)
          w(r, c) = along(points_[set[static_cast<std::size_t>(r)]], columns_[set[static_cast<std::size_t>(c)]].dv);
      }
      const Eigen::VectorXd wanted = -dense::least_squares(w, u);
      Eigen::Index out = -1;
      double share = 1;
      for (Eigen::Index k = 0; k < count; ++k) {
        if (wanted[k] > 0) continue;
        const double s = p[k] > wanted[k] ? p[k] / (p[k] - wanted[k]) : 0;
        if (out < 0 || s < share) share = s, out = k;
      }
      if (out < 0) {
        p = wanted;
        return;
      }
      p += share * (wanted - p);
      set.erase(set.begin() + out);
      Eigen::VectorXd rest(count - 1);
      rest << p.head(out), p.tail(count - 1 - out);
      p = rest;
      if (set.empty()) return;
    }
  }

  /// 1 + the restitution of each point of the set; points that act on each other take the smallest.
  std::vector<double> one_plus_restitution(const std::vector<std::size_t>& set, const std::vector<double>& before,
                                           bool plastic) {
    std::vector<double> r(set.size());
    for (std::size_t k = 0; k < set.size(); ++k)
      r[k] = plastic || -before[set[k]] <= slow(set[k]) ? 0 : points_[set[k]].law.restitution;
    const auto coupled = [&](std::size_t a, std::size_t b) {
      constexpr double kNothing = 1e-12;
      const double ab = along(points_[a], columns_[b].dv);
      return ab * ab > kNothing * kNothing / (mass(a) * mass(b));
    };
    for (bool again = true; again;) {
      again = false;
      for (std::size_t a = 0; a < set.size(); ++a)
        for (std::size_t b = 0; b < set.size(); ++b)
          if (r[a] < r[b] && coupled(set[a], set[b])) r[b] = r[a], again = true;
    }
    for (double& x : r) x += 1;
    return r;
  }

  struct Column {
    bool known = false;
    std::vector<double> dv;
  };
  Equations& equations_;
  State& state_;
  std::vector<ImpactPoint>& points_;
  std::vector<Column> columns_;
  std::vector<double> slow_;
  std::vector<double> masses_;
  double rounding_ = 0;
};

}  // namespace

void solve_impact(Equations& equations, State& state, std::vector<ImpactPoint>& points) {
  if (!points.empty()) Impact(equations, state, points).run();
}

}  // namespace espalier::dynamics::contact
