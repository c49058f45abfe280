/// \file
/// Derivatives of a motion by the adjoint method: once back through its steps, however many parameters there are.
#pragma once

#include <functional>
#include <memory>
#include <vector>

#include "dynamics/integrators/derivatives/step_adjoint.hpp"
#include "dynamics/model/derivatives/quantity_slopes.hpp"

namespace espalier::dynamics::model {

/// The accepted states of a motion, with the orders of their formulas and what components remembered then.
class MotionRecord {
 public:
  explicit MotionRecord(Mechanism& mechanism) : mechanism_(mechanism) {}
  /// The start, with order 0, and the end of each step.
  void add(const State& state, int order);
  [[nodiscard]] std::size_t size() const { return points_.size(); }
  [[nodiscard]] const State& state(std::size_t k) const { return points_[k].state; }
  /// The past points of the formula of step k > 0, newest first.
  [[nodiscard]] std::vector<const State*> past(std::size_t k) const;
  /// Lets the components remember what they did after step k.
  void remember(std::size_t k) const;

 private:
  struct Point {
    State state;
    int order;
    std::vector<std::shared_ptr<const std::vector<double>>> memory;  // of each component; what did not change is shared
  };
  Mechanism& mechanism_;
  std::vector<Point> points_;
};

/// Numbers J that depend on the quantities g of all times, by known slopes dJ/dg, and through them on parameters p.
/// With A_k ds_k + (past) + R_k,p dp = 0 at each step (StepAdjoint),
///   A_k^T y_k = dJ/ds_k - (what later steps make of s_k),   dJ/dp = J_p - sum_k y_k^T R_k,p + (start)
/// (discrete adjoint of the steps that were taken; Y. Cao, S. Li, L. Petzold, R. Serban, SIAM J. Sci. Comput. 24, 2003,
/// have that of the continuous equations). R_k,p and J_p are central differences of two models at the same states, made
/// by the caller, models one after the other. Memory: of each step its state, and n + 3 m numbers for each J.
class MotionAdjoint {
 public:
  /// dJ/dg of the number `target` by a quantity at the end of a step (0: at the start).
  using Weight = std::function<double(std::size_t target, std::size_t step, std::size_t quantity)>;

  /// All of them outlive the object. @param dropped  constraints that are left out, m marks
  MotionAdjoint(Mechanism& mechanism, const std::vector<char>& dropped, const MotionRecord& record,
                const std::vector<Quantity>& quantities);

  /// From the last step to the first. @param go_on  called between steps; may throw
  void go_back(std::size_t targets, const Weight& weight, const std::function<void()>& go_on);
  /// By target: J - sum y^T R + what the start makes of J, of a model of the same unknowns beside this one, up to a
  /// constant: a difference of two is that of J. @param start  of that model
  [[nodiscard]] std::vector<double> lagrangian(Mechanism& side, const State& start,
                                               const std::vector<Quantity>& quantities) const;
  /// See SensitivityResult::defect.
  [[nodiscard]] double defect() const { return defect_; }

 private:
  /// What is kept of a step for a target.
  struct Factors {
    std::vector<double> position, velocity, acceleration, motion;
  };
  void add_quantities(std::size_t target, std::size_t step, StateSlopes& slopes);
  [[nodiscard]] StateSlopes nothing() const;
  [[nodiscard]] std::vector<Index> kept();  // constraints; leaves the others out of the equations

  Mechanism& mechanism_;
  const std::vector<char>& dropped_;
  const MotionRecord& record_;
  const std::vector<Quantity>& quantities_;
  Equations equations_;
  QuantitySlopes slopes_;
  Weight weight_;
  std::vector<std::vector<Factors>> factors_;  // by step, target
  std::vector<StateSlopes> start_;             // by target: dJ/d(start)
  double defect_ = 0;
};

}  // namespace espalier::dynamics::model
