/// \file
/// A system made of components.
#pragma once

#include <array>
#include <cstdint>
#include <memory>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include "dynamics/dae/system_on_device.hpp"

namespace espalier::dynamics {

/// A system made of components. Add all components, then call finish() once; adding more later and calling finish()
/// again raises pattern_version().
class AssembledSystem final : public System, public SystemOnDevice {
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
  /// The memory of all components, in their order: appends what they remember; takes as much from the front.
  void save(std::vector<double>& out) const;
  void restore(ConstSpan& in);

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
                         const StateView* there) override;
  [[nodiscard]] const DeviceShare* device_share() const override { return share_ ? &*share_ : nullptr; }
  void residual_on_device(const StateView& s, const StateView& there, Span f, double* f_there) override;
  [[nodiscard]] const SparsePattern* multiplier_pattern() const override {
    return f_lambda_pattern_.ind.empty() ? nullptr : &f_lambda_pattern_;
  }
  void multiplier_tangent(const StateView& s, Span values) override;

 private:
  /// A component and a capability that it has.
  template <class Capability>
  struct Able {
    Component* component;
    Capability* with;
  };
  /// Notes a component that has a capability.
  template <class Capability>
  static void note(Component& component, std::vector<Able<Capability>>& list) {
    if (auto* const with = dynamic_cast<Capability*>(&component)) list.push_back({&component, with});
  }
  /// Coordinates without functions of their own, of as many components as follow each other: q[q + i] belongs to
  /// v[v + i].
  struct Range {
    std::size_t q, v, n;
  };
  static void extend(std::vector<Range>& ranges, const OwnCoordinates& own);
  /// A component with tasks, and where they end among those of all, stage by stage.
  struct Planned {
    HasTasks* component;
    std::array<std::int64_t, 2> end;
  };
  void insert(std::unique_ptr<Component> component);
  template <class Call>
  void evaluate_all(bool on_device, const Call& call);
  void run_tasks(const StateView& s, Span f);
  void divide_coordinates(const SparsePattern& w_of_host);
  [[nodiscard]] bool fits_device(std::size_t component) const;
  template <class Body>
  void for_each_entry_of(const std::vector<Range>& ranges, const Body& body) const;

  base::ThreadPool* pool_ = nullptr;
  std::vector<std::unique_ptr<Component>> components_;
  std::vector<OwnCoordinates> coordinates_;  // of those that own some
  std::vector<Range> flat_;                  // of vector spaces
  std::vector<Range> plain_;                 // whose magnitudes are |q_i|
  std::vector<Able<Curved>> curved_;
  std::vector<Able<Scaled>> scaled_;
  std::vector<Able<Constrains>> constraints_;  // of those that own some
  std::vector<Able<Remembers>> remembering_;
  std::vector<Able<ChangesPattern>> changing_;
  std::vector<Able<Augmented>> augmented_;
  std::vector<Able<ReadsMultipliers>> reading_multipliers_;
  std::vector<Able<Turns>> turning_;
  std::vector<Able<HasTasks>> with_tasks_;
  std::vector<OnDevice*> on_device_;  // of all components; null: it never is
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
