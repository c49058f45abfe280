/// \file
/// A pressure that is a function of time alone, for tests below the model.
#pragma once

#include <functional>
#include <memory>

#include "dynamics/dae/assembled_system.hpp"
#include "dynamics/forces/face_pressure.hpp"

namespace espalier::dynamics::test {

class TimeValue final : public StateFunction {
 public:
  explicit TimeValue(std::function<double(double)> f) : f_(std::move(f)) {}
  [[nodiscard]] double value(const StateView& s) const override { return f_(s.t); }

 protected:
  void add_gradient(const StateView& /*s*/, StateGradient& /*out*/) const override {}

 private:
  std::function<double(double)> f_;
};

/// Adds it to the system that the body stands in, before that is finished.
inline void press(AssembledSystem& system, const FlexibleBody& body, const Mesh& mesh, std::span<const MeshFace> faces,
                  std::function<double(double)> pressure) {
  system.add(std::make_unique<FacePressure>("pressure", press_nodal(body, mesh, faces)))
      .set_pressure(std::make_shared<TimeValue>(std::move(pressure)));
}

}  // namespace espalier::dynamics::test
