// The textbook as a backend: `--device reference`.
#include "device/backend.hpp"

#include <limits>

#include "device/reference/executor.hpp"

namespace espalier::device::reference {

namespace {

class ReferenceBackend final : public Backend {
 public:
  [[nodiscard]] std::string_view name() const override { return "reference"; }
  [[nodiscard]] std::string_view noun() const override { return "reference"; }
  [[nodiscard]] FoundDevices find() const override { return {{"reference"}, {}}; }
  [[nodiscard]] Limits limits() const override { return {}; }
  [[nodiscard]] const plan::MachineModel& model(const plan::Machine& machine) const override { return machine.host; }
  [[nodiscard]] PredictedTime predict(const analysis::AssemblyTree&, const PlanWish&) const override {
    return {std::numeric_limits<double>::infinity(), false, {}};
  }
  // Fronts are not cut: the tiles of this plan only say where its entries stand.
  [[nodiscard]] plan::PlanOptions plan_options(const PlanWish& wish) const override {
    plan::PlanOptions o;
    o.unsymmetric = wish.kind == Kind::lu;
    o.ldlt = wish.kind == Kind::ldlt;
    o.devices = wish.devices;
    return o;
  }
  [[nodiscard]] Offset executor_bytes(const plan::Plan& plan, Kind, Precision precision, int) const override {
    Offset values = 0;
    for (const plan::FrontLayout& l : plan.layout) values += Offset{l.rows} * l.rows;
    return values * static_cast<Offset>(precision == Precision::fp64 ? sizeof(double) : sizeof(float));
  }
  [[nodiscard]] std::unique_ptr<Executor<double>> make_executor(const Job& job, Scalar<double>) const override {
    return make_reference_executor<double>(job);
  }
  [[nodiscard]] std::unique_ptr<Executor<float>> make_executor(const Job& job, Scalar<float>) const override {
    return make_reference_executor<float>(job);
  }
};

}  // namespace

const Backend& backend() {
  static const ReferenceBackend the_backend;
  return the_backend;
}

}  // namespace espalier::device::reference
