/// \file
/// The seam of the dynamics module: a mechanical system as a set of equations in the unknowns x = [a, v, q, lambda].
///
/// Words used everywhere below
///   v         velocity coordinates, n of them; a = dv/dt
///   q         configuration, n_q >= n numbers (rigid body: 7 for 6 velocity coordinates, position and unit quaternion)
///   dq        an increment of the configuration: a tangent vector with n entries, in the same coordinates as v dt
///   q (+) dq  the configuration reached from q by the increment dq (retraction); plain addition in a vector space
///   m         number of constraint equations
/// The equations
///   F(q, v, a, lambda, t) + Phi_q^T lambda = 0    motion; residual() gives F, the layer itself adds Phi_q^T lambda
///   Phi(q, t) = 0                                 position level
///   Phi_q v   - nu = 0       nu = -Phi_t          velocity level
///   Phi_q a   - gamma = 0                         acceleration level, gamma = -(d/dt Phi_q) v - d/dt Phi_t
/// where Phi_q is the derivative with respect to increments: Phi(q (+) dq) = Phi(q) + Phi_q dq + O(dq^2).
/// Derivatives of F with respect to q are meant in the same way, and contain the derivative of Phi_q^T lambda.
/// F may depend on lambda itself (friction that grows with a joint's reaction): F_lambda then stands beside Phi_q^T.
#pragma once

#include <array>
#include <cstdint>
#include <memory>
#include <optional>
#include <span>
#include <string>
#include <vector>

#include "base/thread_pool.hpp"
#include "espalier/dae.hpp"

namespace espalier::dynamics {

using Span = std::span<double>;
using ConstSpan = std::span<const double>;

class Component;
class DeviceAssembly;

/// What a call of constraints() shall fill in. An empty span is not wanted (and then not computed).
struct ConstraintBuffers {
  Span phi;           ///< m: Phi(q, t)
  Span nu;            ///< m: right side of the velocity level
  Span gamma;         ///< m: right side of the acceleration level (needs v)
  Span phi_q_values;  ///< entries of Phi_q in the order of its pattern
};

/// A fixed sparsity pattern in compressed form with sorted, unique indices. `ptr` runs over columns for W (compressed
/// sparse column) and over rows for Phi_q (compressed sparse row); `ind` holds the other index.
struct SparsePattern {
  Index rows = 0;
  Index cols = 0;
  std::vector<Offset> ptr;
  std::vector<Index> ind;
  [[nodiscard]] Offset nonzeros() const { return ptr.empty() ? 0 : ptr.back(); }
};

/// Position of entry (major, minor) in a pattern's values: major is the column of W or the row of Phi_q.
/// @throws std::logic_error if the entry was never declared.
[[nodiscard]] Offset find_entry(const SparsePattern& pattern, Index major, Index minor);

/// Collects declared entries and makes the pattern of them. Duplicates are merged; negative indices (ground, fixed
/// coordinates) are skipped.
class PatternBuilder {
 public:
  PatternBuilder(Index rows, Index cols, bool by_columns);
  void add(Index row, Index col);
  /// Declares every (row, col) pair of the two lists; by columns, long lists are kept as they are.
  void add_block(std::span<const Index> rows, std::span<const Index> cols);
  /// Declares the whole diagonal.
  void add_diagonal() { diagonal_ = true; }
  /// Declares 3 x 3 blocks, without a copy: vertex b has the columns first + 3 b and the next two, and in them the
  /// three rows of each vertex ind[ptr[b] .. ptr[b + 1]), which rise. @pre built by columns; ranges of columns come in
  /// rising order and do not overlap; the lists live until the last build()
  void add_vertex_pairs(Index first, std::span<const Offset> ptr, std::span<const Index> ind);
  /// How many entries were declared so far, those declared several times among them; without the diagonal.
  [[nodiscard]] Offset declared() const { return declared_; }
  /// The pattern of all entries declared so far. @param pool  null: the calling thread alone
  [[nodiscard]] SparsePattern build(base::ThreadPool* pool = nullptr) const;

 private:
  struct VertexPairs {
    Index first;
    std::span<const Offset> ptr;
    std::span<const Index> ind;
  };
  /// A column and a list of blocks_ that belongs to it.
  struct BlockColumn {
    Index column, block;
    friend auto operator<=>(const BlockColumn&, const BlockColumn&) = default;
  };
  [[nodiscard]] std::span<const Index> vertices_of(Index major) const;
  void collect(Index major, std::span<const BlockColumn> blocks, std::vector<Index>& out) const;

  Index rows_, cols_;
  bool by_columns_;
  bool diagonal_ = false;
  Offset declared_ = 0;
  std::vector<VertexPairs> pairs_;
  std::vector<std::vector<Index>> lists_;   // minor indices of every major index, compacted lazily
  std::vector<std::vector<Index>> blocks_;  // rows, sorted and unique
  std::vector<BlockColumn> block_columns_;
};

struct Sizes {
  Index configuration = 0;  ///< n_q
  Index velocity = 0;       ///< n
  Index constraints = 0;    ///< m
};

/// A body's turn between two configurations: x_to - centre = rotation (x_from - centre), but for its strain.
struct BodyTurn {
  Index first = 0;                                            ///< first velocity coordinate of the body
  Index vertices = 0;                                         ///< that many times three coordinates turn with it
  std::array<double, 9> rotation{1, 0, 0, 0, 1, 0, 0, 0, 1};  ///< row by row
};

/// Which coordinates belong to bodies on a GPU, and what of them the rest of the system, on the host, has to do with.
struct DeviceShare {
  /// Velocity coordinates v .. v + count of bodies; their configuration has as many numbers, from q on.
  struct Range {
    Index q, v, count;
  };
  std::vector<Range> ranges;               ///< ascending, with gaps between them
  std::vector<Index> seen;                 ///< velocity coordinates among them that others read or act on, ascending
  std::vector<Index> seen_q;               ///< where their configuration stands
  std::vector<Index> own;                  ///< all other velocity coordinates, ascending
  std::vector<const Component*> owners{};  ///< whose these are
};

/// A system of equations that the integrators can integrate. All arrays are global. Implementations need not be safe
/// for concurrent calls on one object.
class System {
 public:
  virtual ~System() = default;

  [[nodiscard]] virtual Sizes sizes() const = 0;
  /// Name of a constraint equation for people, for instance: revolute "hinge-3", rotation about y.
  [[nodiscard]] virtual std::string constraint_name(Index row) const;
  /// Constraint equations, ascending, that hold for velocities alone: A(q) v = nu with A in the place of Phi_q, nothing
  /// on the position level (Phi = 0). There the integrators ask for the same of the displacement of a step; see
  /// Equations::set_slip().
  [[nodiscard]] virtual std::span<const Index> non_holonomic() const { return {}; }
  /// Name of a velocity coordinate for people.
  [[nodiscard]] virtual std::string coordinate_name(Index coordinate) const;

  // The manifold of configurations; the defaults are those of a vector space (n_q = n).
  /// q_out = q (+) dq. q_out may alias q.
  virtual void retract(ConstSpan q, ConstSpan dq, Span q_out) const;
  /// theta with q = base (+) theta (the inverse of retract in its second argument).
  virtual void local(ConstSpan base, ConstSpan q, Span theta) const;
  /// v of a motion base (+) theta(t): v = T(theta) theta_dot. v may alias theta_dot.
  virtual void velocity_of_rate(ConstSpan theta, ConstSpan theta_dot, Span v) const;
  /// Its inverse: theta_dot = T(theta)^-1 v. theta_dot may alias v.
  virtual void rate_of_velocity(ConstSpan theta, ConstSpan v, Span theta_dot) const;
  /// Velocities in the axes of q, each as seen in those of q (+) theta: x := T(-theta)^-1 T(theta) x.
  virtual void carry(ConstSpan /*theta*/, std::span<const Span> /*vectors*/) const {}
  /// Magnitude of each coordinate for relative tolerances: |q_i| by default, 1 for a rotation. n entries.
  virtual void magnitude(ConstSpan q, Span out) const;

  // Equations.
  /// F(q, v, a, lambda, t) without Phi_q^T lambda; overwrites f (n).
  virtual void residual(const StateView& s, Span f) = 0;
  /// Constraint quantities at (t, q, v); v may be empty unless gamma is wanted. Does nothing where m = 0.
  virtual void constraints(double t, ConstSpan q, ConstSpan v, const ConstraintBuffers& out) = 0;
  [[nodiscard]] virtual Energy energy(const StateView& s);
  /// Multiplies gravity, loads, pressures and actuators from now on (1 unless statics puts them on step by step).
  virtual void set_load_factor(double /*factor*/) {}
  /// How bodies whose tangents turn with them have turned from a configuration to another one.
  [[nodiscard]] virtual std::vector<BodyTurn> turns(ConstSpan /*from*/, ConstSpan /*to*/) const { return {}; }
  /// Called by the integrators with every accepted state: the place to remember what has a history (turns of an angle).
  virtual void accept(const StateView& /*s*/) {}
  /// Called where the equations hold at a trial state: whether multipliers that the system keeps to itself (augmented
  /// Lagrangian) were changed, so that they are to be solved again from there.
  virtual bool augment(const StateView& /*s*/) { return false; }

  // Jacobians. The patterns are fixed while pattern_version() stays the same.
  [[nodiscard]] virtual const SparsePattern& tangent_pattern() const = 0;     ///< n x n, by columns
  [[nodiscard]] virtual const SparsePattern& constraint_pattern() const = 0;  ///< m x n, by rows
  [[nodiscard]] virtual std::uint64_t pattern_version() const { return 0; }
  /// Called before W is evaluated at a configuration: the place to make the patterns anew (and to raise
  /// pattern_version()) where bodies have come near each other whose entries they lack.
  virtual void update_pattern(ConstSpan /*q*/) {}
  /// W = weights.a F_a + weights.v F_v + weights.q (F + Phi_q^T lambda)_q; overwrites the values.
  virtual void tangent(const StateView& s, const TangentWeights& weights, Span w_values) = 0;
  // A GPU may take a part of F and W; see device/device_assembly.hpp. residual() then uses it without being asked.
  /// Moves what it can there, unless most of W would have to follow over the link each time. @param k_ptr where the
  /// columns of W begin in the GPU's matrix. @return false: nothing
  virtual bool use_device(DeviceAssembly& /*device*/, std::span<const Offset> /*k_ptr*/) { return false; }
  virtual void leave_device() {}
  /// Positions in W of the entries that components on the host add to, ascending.
  [[nodiscard]] virtual std::vector<Offset> host_entries() const { return {}; }
  /// tangent() in two parts: those on the GPU write theirs there, the others add theirs to w_values, of which
  /// host_entries() alone are set to zero first.
  /// @param there  the state of the bodies on the GPU, in its memory, as StateView but for a configuration in the order
  ///   of the velocity coordinates; s then holds what DeviceShare says is seen or not theirs. Null: s holds all
  virtual void tangent_on_device(const StateView& /*s*/, const TangentWeights& /*weights*/, double* /*device_values*/,
                                 Span /*w_values*/, const StateView* /*there*/ = nullptr) {}
  /// What of it can stay there from step to step; null: nothing, as integrators have to see all of it.
  [[nodiscard]] virtual const DeviceShare* device_share() const { return nullptr; }
  /// residual() in two parts: bodies write theirs to f_there, which like `there` lies in the GPU's memory; the others
  /// add theirs to f, of which only what is seen, or not the bodies', is set to zero first. Waits for both.
  virtual void residual_on_device(const StateView& /*s*/, const StateView& /*there*/, Span /*f*/, double* /*f_there*/) {
  }
  /// Pattern of F_lambda, n x m, by columns. Null: F does not depend on lambda.
  [[nodiscard]] virtual const SparsePattern* multiplier_pattern() const { return nullptr; }
  /// F_lambda without Phi_q^T; overwrites the values. Called where multiplier_pattern() is not null.
  virtual void multiplier_tangent(const StateView& /*s*/, Span /*values*/) {}
};

/// Where a component's own unknowns stand in the global arrays.
struct Placement {
  Index q = 0;  ///< first configuration number
  Index v = 0;  ///< first velocity coordinate
  Index c = 0;  ///< first constraint equation
};

/// A part of a mechanical system: a set of rigid bodies, a flexible body, a joint, a force. It may own coordinates,
/// own constraint equations, both or none, and contributes to the global equations. Every function gets global arrays
/// and touches its own ranges of them (and, for the sums F and W, the coordinates that it acts on).
class Component {
 public:
  explicit Component(std::string name) : name_(std::move(name)) {}
  virtual ~Component() = default;
  Component(const Component&) = delete;
  Component& operator=(const Component&) = delete;

  [[nodiscard]] const std::string& name() const { return name_; }
  /// Numbers of unknowns and equations that it owns. Must not change after it was added.
  [[nodiscard]] virtual Sizes sizes() const = 0;
  /// Threads for what it does; they outlive it; null: the calling thread. A system with threads gives it its own.
  void set_pool(base::ThreadPool* pool) { pool_ = pool; }
  /// Called once when it is added to a system.
  virtual void place(const Placement& at) { at_ = at; }
  [[nodiscard]] const Placement& placement() const { return at_; }
  [[nodiscard]] virtual std::string constraint_name(Index local_row) const;
  [[nodiscard]] virtual std::string coordinate_name(Index local_coordinate) const;
  /// Whether an equation holds for velocities alone; see System.
  [[nodiscard]] virtual bool non_holonomic(Index /*local_row*/) const { return false; }

  /// Writes the initial values of its own coordinates.
  virtual void initial(Span q, Span v) const;

  // Manifold operations on its own ranges; the defaults are those of a vector space.
  /// Whether all but magnitude() are the defaults; the system then makes them itself, for many at a time.
  [[nodiscard]] virtual bool is_vector_space() const { return false; }
  virtual void retract(ConstSpan q, ConstSpan dq, Span q_out) const;
  virtual void local(ConstSpan base, ConstSpan q, Span theta) const;
  virtual void velocity_of_rate(ConstSpan theta, ConstSpan theta_dot, Span v) const;
  virtual void rate_of_velocity(ConstSpan theta, ConstSpan v, Span theta_dot) const;
  virtual void carry(ConstSpan /*theta*/, std::span<const Span> /*vectors*/) const {}
  virtual void magnitude(ConstSpan q, Span out) const;

  /// Declares the entries of W (rows, columns: global velocity coordinates) and of Phi_q (rows: global constraints)
  /// that it will ever touch.
  virtual void declare(PatternBuilder& w, PatternBuilder& phi_q) const = 0;
  /// Whether the entries at a configuration are not all declared; declare() then declares them as well, and all others
  /// that are likely to follow. The system makes its patterns anew.
  virtual bool update_pattern(ConstSpan /*q*/) { return false; }
  /// Called when the patterns stand: look up (find_entry) the positions of the entries, once.
  virtual void bind(const SparsePattern& w, const SparsePattern& phi_q) = 0;

  /// Adds its part of F.
  virtual void residual(const StateView& s, Span f) = 0;
  /// Numbers of tasks, some 20 microseconds each, of two stages. Tasks of a stage run at the same time, those of other
  /// components among them.
  struct Stages {
    std::int64_t first = 0, second = 0;
  };
  /// Leaves residual() to tasks, in part or as a whole. The residual() with the same state that follows does the rest.
  virtual Stages plan_residual(const StateView& /*s*/) { return {}; }
  /// Task `task` of stage 0 or 1; may add to f in its own coordinates.
  virtual void residual_task(int /*stage*/, std::int64_t /*task*/, Span /*f*/) {}
  /// Writes its own constraint rows, with all their entries of Phi_q (they still hold those of the last call).
  virtual void constraints(double t, ConstSpan q, ConstSpan v, const ConstraintBuffers& out);
  /// Adds its part of W.
  virtual void tangent(const StateView& s, const TangentWeights& weights, Span w_values) = 0;
  // On a GPU; see System. What start_*() begins there runs beside the other components, and the call of the same name
  // that follows with the same state takes what it gave.
  [[nodiscard]] virtual bool fits_device() const { return false; }
  virtual void use_device(DeviceAssembly& /*device*/, std::span<const Offset> /*k_ptr*/) {}
  virtual void leave_device() {}
  virtual void start_residual(const StateView& /*s*/) {}
  virtual void start_tangent(const StateView& /*s*/, const TangentWeights& /*weights*/, double* /*device_values*/) {}
  /// The same where the state lies there; see System::tangent_on_device(). Forces stay there, too: the residual() that
  /// follows only waits.
  virtual void start_residual_there(const StateView& /*there*/, double* /*f_there*/) {}
  virtual void start_tangent_there(const StateView& /*there*/, const TangentWeights& /*weights*/,
                                   double* /*device_values*/) {}
  /// Whether what it reads of bodies, but for accepted states, is what it declares: coordinates of its entries of W and
  /// Phi_q. A search for contact reads whole surfaces.
  [[nodiscard]] virtual bool reads_what_it_declares() const { return true; }
  /// The same three for F_lambda (rows: velocity coordinates, columns: constraints), for forces that depend on
  /// multipliers; most do not.
  virtual void declare_multipliers(PatternBuilder& /*f_lambda*/) const {}
  virtual void bind_multipliers(const SparsePattern& /*f_lambda*/) {}
  virtual void multiplier_tangent(const StateView& /*s*/, Span /*values*/) {}
  [[nodiscard]] virtual Energy energy(const StateView& s);
  /// See System::set_load_factor().
  void set_load_factor(double factor) { load_factor_ = factor; }
  /// See System::turns(). None: its tangent does not turn with it.
  [[nodiscard]] virtual std::optional<BodyTurn> turn(ConstSpan /*from*/, ConstSpan /*to*/) const { return {}; }
  /// Called with every accepted state.
  virtual void accept(const StateView& /*s*/) {}
  /// See System::augment().
  virtual bool augment(const StateView& /*s*/) { return false; }
  /// What it remembers beside the state (turns of an angle, measured offsets), for restart files: save() appends,
  /// restore() takes as many numbers from the front.
  virtual void save(std::vector<double>& /*out*/) const {}
  virtual void restore(ConstSpan& /*in*/) {}

 protected:
  [[nodiscard]] double load_factor() const { return load_factor_; }
  [[nodiscard]] base::ThreadPool* pool() const { return pool_; }

 private:
  std::string name_;
  Placement at_;
  base::ThreadPool* pool_ = nullptr;
  double load_factor_ = 1;
};

/// A system made of components. Add all components, then call finish() once; adding more later and calling finish()
/// again raises pattern_version().
class AssembledSystem final : public System {
 public:
  /// Adds a component and places its unknowns after those of its predecessors. Returns a reference of its own type.
  template <class T>
  T& add(std::unique_ptr<T> component) {
    T& reference = *component;
    insert(std::move(component));
    return reference;
  }
  void finish();
  /// Threads for what is done here; outlives the object; null: the calling thread.
  void set_pool(base::ThreadPool* pool);
  /// Initial configuration and velocities as the components state them (not yet consistent with the constraints).
  void initial(Span q, Span v) const;
  [[nodiscard]] const std::vector<std::unique_ptr<Component>>& components() const { return components_; }

  [[nodiscard]] Sizes sizes() const override { return sizes_; }
  [[nodiscard]] std::string constraint_name(Index row) const override;
  [[nodiscard]] std::string coordinate_name(Index coordinate) const override;
  [[nodiscard]] std::span<const Index> non_holonomic() const override { return non_holonomic_; }
  void retract(ConstSpan q, ConstSpan dq, Span q_out) const override;
  void local(ConstSpan base, ConstSpan q, Span theta) const override;
  void velocity_of_rate(ConstSpan theta, ConstSpan theta_dot, Span v) const override;
  void rate_of_velocity(ConstSpan theta, ConstSpan v, Span theta_dot) const override;
  void carry(ConstSpan theta, std::span<const Span> vectors) const override;
  void magnitude(ConstSpan q, Span out) const override;
  void residual(const StateView& s, Span f) override;
  void constraints(double t, ConstSpan q, ConstSpan v, const ConstraintBuffers& out) override;
  [[nodiscard]] Energy energy(const StateView& s) override;
  void set_load_factor(double factor) override;
  [[nodiscard]] std::vector<BodyTurn> turns(ConstSpan from, ConstSpan to) const override;
  void accept(const StateView& s) override;
  bool augment(const StateView& s) override;
  [[nodiscard]] const SparsePattern& tangent_pattern() const override { return w_pattern_; }
  [[nodiscard]] const SparsePattern& constraint_pattern() const override { return phi_q_pattern_; }
  [[nodiscard]] std::uint64_t pattern_version() const override { return version_; }
  void update_pattern(ConstSpan q) override;
  void tangent(const StateView& s, const TangentWeights& weights, Span w_values) override;
  bool use_device(DeviceAssembly& device, std::span<const Offset> k_ptr) override;
  void leave_device() override;
  [[nodiscard]] std::vector<Offset> host_entries() const override { return host_entries_; }
  /// What components that do not fit a GPU declare of W, over the entries of W; 1 where none fits.
  [[nodiscard]] double host_share() const;
  void tangent_on_device(const StateView& s, const TangentWeights& weights, double* device_values, Span w_values,
                         const StateView* there = nullptr) override;
  [[nodiscard]] const DeviceShare* device_share() const override { return share_ ? &*share_ : nullptr; }
  void residual_on_device(const StateView& s, const StateView& there, Span f, double* f_there) override;
  [[nodiscard]] const SparsePattern* multiplier_pattern() const override {
    return f_lambda_pattern_.ind.empty() ? nullptr : &f_lambda_pattern_;
  }
  void multiplier_tangent(const StateView& s, Span values) override;

 private:
  /// Coordinates that form a vector space, of as many components as follow each other: q[q + i] belongs to v[v + i].
  struct FlatRange {
    std::size_t q, v, n;
  };
  /// A component with tasks, and where they end among those of all, stage by stage.
  struct Planned {
    Component* component;
    std::array<std::int64_t, 2> end;
  };
  void insert(std::unique_ptr<Component> component);
  void run_tasks(const StateView& s, Span f);
  void divide_coordinates(const SparsePattern& w_of_host);
  template <class Body>
  void for_each_flat(const Body& body) const;

  base::ThreadPool* pool_ = nullptr;
  std::vector<FlatRange> flat_;
  std::vector<Component*> curved_;  // those with coordinates that form none
  std::vector<std::unique_ptr<Component>> components_;
  std::vector<Component*> owners_of_coordinates_;  // components with velocity coordinates
  std::vector<Component*> owners_of_constraints_;
  Sizes sizes_;
  SparsePattern w_pattern_, phi_q_pattern_, f_lambda_pattern_;
  std::vector<Index> non_holonomic_;
  std::vector<Offset> host_entries_;
  std::optional<DeviceShare> share_;
  std::vector<Offset> declared_;  // components; entries of W that each of them declared
  std::vector<Planned> planned_;  // scratch of residual()
  std::uint64_t version_ = 0;
};

}  // namespace espalier::dynamics
