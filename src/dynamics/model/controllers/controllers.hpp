/// \file
/// Parts of a model that other programs have made: FMUs that step through time beside the run. Between two exchanges
/// what they tell is held; then they get our quantities and step up to the present time.
#pragma once

#include <memory>
#include <string>
#include <vector>

#include "dynamics/dae/capabilities.hpp"
#include "dynamics/forces/state_function.hpp"
#include "fmi/foreign.hpp"

namespace espalier::dynamics::model {

struct ControllerSpec;

/// A component without unknowns, so that it goes into restart files: with the FMUs' states, where they give them.
class Controllers final : public Component, public Remembers {
 public:
  struct Output {
    std::string name;
    fmi::ForeignVariable variable;
    double value = 0;  ///< since the last exchange
  };
  struct Controller {
    std::string name;
    std::unique_ptr<fmi::ForeignFmu> fmu;
    double begin = 0, step = 0;                   ///< exchanges are at begin + k step
    long done = 0;                                ///< steps of the FMU
    std::vector<fmi::ForeignVariable> variables;  ///< of the inputs
    std::vector<StateFunctionPtr> inputs;
    std::vector<Output> outputs;
    [[nodiscard]] double next() const { return begin + static_cast<double>(done + 1) * step; }
    void give_inputs(const StateView& s);
    /// @return whether anything changed
    bool take_outputs();
  };

  Controllers() : Component("controllers") {}
  /// Loads an FMU, and asks what it tells before it knows our state. @throws Error(invalid_input)
  void add(const ControllerSpec& spec, double begin);
  [[nodiscard]] const std::vector<std::unique_ptr<Controller>>& parts() const { return parts_; }
  [[nodiscard]] const Controller* part(const std::string& name) const;

  /// With the state at the start. @return whether what FMUs tell has changed by it
  bool begin(const StateView& s);
  /// The time of the next exchange.
  [[nodiscard]] double next() const;
  /// Steps all FMUs that are due up to the time of the state. @return the name of one that ends the run, or ""
  [[nodiscard]] std::string exchange(const StateView& s);

  [[nodiscard]] Sizes sizes() const override { return {}; }
  void declare(PatternBuilder& /*w*/, PatternBuilder& /*phi_q*/) const override {}
  void bind(const SparsePattern& /*w*/, const SparsePattern& /*phi_q*/) override {}
  void residual(const StateView& /*s*/, Span /*f*/) override {}
  void tangent(const StateView& /*s*/, const TangentWeights& /*weights*/, Span /*w_values*/) override {}
  void save(std::vector<double>& out) const override;
  void restore(ConstSpan& in) override;

 private:
  std::vector<std::unique_ptr<Controller>> parts_;
};

}  // namespace espalier::dynamics::model
