/// \file
/// A part of a mechanical system, and all that every part has to say. What only some can do stands in capabilities.hpp.
#pragma once

#include <string>
#include <utility>

#include "dynamics/dae/system.hpp"

namespace espalier::dynamics {

/// Where a component's own unknowns stand in the global arrays.
struct Placement {
  Index q = 0;  ///< first configuration number
  Index v = 0;  ///< first velocity coordinate
  Index c = 0;  ///< first constraint equation
};

/// A part of a mechanical system: a set of rigid bodies, a flexible body, a joint, a force. It may own coordinates,
/// own constraint equations, both or none, and contributes to the global equations. Every function gets global arrays
/// and touches its own ranges of them (and, for the sums F and W, the coordinates that it acts on).
///
/// Coordinates are those of a vector space and there are no constraints, nothing is remembered, nothing is done on a
/// GPU, unless the component is one of the capabilities as well; the system asks once, when the component is added.
class Component {
 public:
  explicit Component(std::string name) : name_(std::move(name)) {}
  virtual ~Component() = default;
  Component(const Component&) = delete;
  Component& operator=(const Component&) = delete;

  [[nodiscard]] const std::string& name() const { return name_; }
  /// Numbers of unknowns and equations that it owns. Must not change after it was added.
  [[nodiscard]] virtual Sizes sizes() const = 0;
  /// Called once when it is added to a system.
  virtual void place(const Placement& at) { at_ = at; }
  /// Name of one of its velocity coordinates for people.
  [[nodiscard]] virtual std::string coordinate_name(Index local_coordinate) const;
  /// Writes the initial values of its own coordinates; zeros by default.
  virtual void initial(Span q, Span v) const;

  /// Declares the entries of W (rows, columns: global velocity coordinates) and of Phi_q (rows: global constraints)
  /// that it will ever touch.
  virtual void declare(PatternBuilder& w, PatternBuilder& phi_q) const = 0;
  /// Called when the patterns stand: look up (find_entry) the positions of the entries, once.
  virtual void bind(const SparsePattern& w, const SparsePattern& phi_q) = 0;
  /// Adds its part of F.
  virtual void residual(const StateView& s, Span f) = 0;
  /// Adds its part of W.
  virtual void tangent(const StateView& s, const TangentWeights& weights, Span w_values) = 0;
  /// Zero by default.
  [[nodiscard]] virtual Energy energy(const StateView& s);

  [[nodiscard]] const Placement& placement() const { return at_; }
  /// Threads for what it does; they outlive it; null: the calling thread. A system with threads gives it its own.
  void set_pool(base::ThreadPool* pool) { pool_ = pool; }
  /// See System::set_load_factor().
  void set_load_factor(double factor) { load_factor_ = factor; }

 protected:
  [[nodiscard]] double load_factor() const { return load_factor_; }
  [[nodiscard]] base::ThreadPool* pool() const { return pool_; }

 private:
  std::string name_;
  Placement at_;
  base::ThreadPool* pool_ = nullptr;
  double load_factor_ = 1;
};

}  // namespace espalier::dynamics
