/// \file
/// The equations of statics at one load: what is out of balance, how large that is, and Newton's matrix.
#pragma once

#include <functional>
#include <vector>

#include "dynamics/dae/equations.hpp"

namespace espalier::dynamics {

/// A trial state on the path. `share` of the load: 0 at the given configuration, 1 at the end.
struct StaticPoint {
  State state;
  double share = 0;
  std::vector<double> motion;  ///< n: what is out of balance
  std::vector<double> phi;     ///< m
};

/// An increment: configuration and multipliers (n + m numbers), share of the load.
struct StaticIncrement {
  std::vector<double> x;
  double share = 0;
};

/// Evaluates statics.hpp's equations along one path. Norms take the masses as their metric, since they alone make one
/// unit of forces and moments, lengths and angles: |dq|^2 = sum m_ii dq_i^2, |r|^2 = sum r_i^2 / m_ii.
class StaticProblem {
 public:
  /// @param start the configuration that is in equilibrium at share 0; v and a must be zero
  /// @param load load factor at share 1
  StaticProblem(Equations& equations, const State& start, double load);
  ~StaticProblem();
  StaticProblem(const StaticProblem&) = delete;
  StaticProblem& operator=(const StaticProblem&) = delete;

  [[nodiscard]] Equations& equations() const { return equations_; }
  [[nodiscard]] double load(const StaticPoint& x) const { return x.share * load_; }
  [[nodiscard]] StaticPoint start() const;
  /// Fills motion and phi. @return false where they are not finite (an element has turned inside out, two points of a
  /// spring coincide)
  [[nodiscard]] bool evaluate(StaticPoint& x);
  /// x (+) factor * d
  [[nodiscard]] StaticPoint moved(const StaticPoint& x, const StaticIncrement& d, double factor) const;
  /// Its inverse, without multipliers: what leads from a to b.
  [[nodiscard]] StaticIncrement between(const StaticPoint& a, const StaticPoint& b) const;

  /// Called before every factorization with the point; what it throws ends the search.
  void set_watch(std::function<void(const StaticPoint&)> watch) { watch_ = std::move(watch); }
  /// K with W = F_q + stiffening * F_a at a point. @pre evaluate(x) was the last evaluation
  /// @return false if it is singular; why() says where
  [[nodiscard]] bool factorize(const StaticPoint& x, double stiffening = 0);
  [[nodiscard]] const Status& why() const { return why_; }
  [[nodiscard]] int determinant_sign() const { return equations_.kkt().determinant_sign(); }
  /// Whether some motion meets no resistance but rounding (a body turns freely): then the determinant and its sign are
  /// rounding, too. By inverse iteration with the last factor.
  [[nodiscard]] bool indifferent();
  /// The softest motion, of length one. @pre indifferent()
  [[nodiscard]] const StaticIncrement& softest() const { return softest_; }
  /// -K^-1 [motion; phi], with the last factor.
  [[nodiscard]] StaticIncrement correction(const StaticPoint& x);
  /// The path's direction for a change of the share by one: -K^-1 d[motion; phi]/dshare. @pre factorize(x)
  [[nodiscard]] StaticIncrement rate(const StaticPoint& x);

  /// The path has come to this point: its loads and reactions count from now on.
  void settle(StaticPoint& x);

  [[nodiscard]] double norm(const StaticIncrement& d) const;     ///< of the configuration's part
  [[nodiscard]] double residual(const StaticPoint& x) const;     ///< |motion|
  [[nodiscard]] double size() const { return size_norm_; }       ///< |dq| of a motion as large as the system
  [[nodiscard]] double reference() const { return reference_; }  ///< of residuals: loads and reactions so far
  [[nodiscard]] double dot(const StaticIncrement& a, const StaticIncrement& b) const;  ///< of the configuration's parts
  /// |motion| and |phi| below the tolerance. @pre evaluate(x) was the last evaluation
  [[nodiscard]] bool balanced(const StaticPoint& x, double tolerance) const;
  /// Every row of motion and phi is at the rounding of the terms that it is the sum of: 16 eps sum_j |K_ij| |q_j|, with
  /// the last K. Nothing gets nearer then.
  [[nodiscard]] bool at_rounding(const StaticPoint& x) const;
  /// The same of the norm of motion: a light body's rows may be above their own rounding, because those of heavy ones
  /// stand in the same solution. Not a proof by itself that nothing gets nearer.
  [[nodiscard]] bool near_rounding(const StaticPoint& x) const;
  /// Sets to zero what the start has out of balance by no more than that: a body without loads has none.
  /// @pre factorize(start()) @return true if anything changed: rates computed before are out of date
  [[nodiscard]] bool forget_rounding();
  /// Name of the coordinate or constraint that is furthest out of balance.
  [[nodiscard]] std::string worst(const StaticPoint& x) const;

 private:
  struct Rounding {
    std::vector<double> motion, phi;  // n, m: what rounding may leave in each row
  };

  [[nodiscard]] bool may_be_rounding(const StaticPoint& x) const;
  /// With the last K.
  [[nodiscard]] Rounding rounding(const State& state) const;
  [[nodiscard]] base::ThreadPool* pool() const { return equations_.pool(); }
  [[nodiscard]] std::vector<double> diagonal_of(const TangentWeights& weights);
  void set_typical();
  [[nodiscard]] std::vector<double> load_rate(const StaticPoint& x);
  [[nodiscard]] double force_norm(ConstSpan f) const;
  [[nodiscard]] double reactions(const StaticPoint& x) const;

  Equations& equations_;
  State start_;
  double load_;
  std::size_t n_, m_;
  std::vector<double> mass_;       // n: diagonal of F_a
  std::vector<double> size_;       // n: magnitude of the coordinates, for rounding
  std::vector<double> f0_, phi0_;  // out of balance at the start
  StaticIncrement softest_;
  double stiffening_ = 0;  // of the last K
  double extent_ = 0, size_norm_ = 0, reference_ = 0;
  Status why_;
  std::function<void(const StaticPoint&)> watch_;
};

}  // namespace espalier::dynamics
