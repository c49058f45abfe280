/// \file
/// A backend that is always there, always predicted to be fast, and refuses every factorization: what a GPU does whose
/// memory others have taken.
#pragma once

#include <string>

#include "device/registry.hpp"

namespace espalier::test {

class FakeBackend final : public device::Backend {
 public:
  [[nodiscard]] std::string_view name() const override { return "fake"; }
  [[nodiscard]] std::string_view noun() const override { return "fake"; }
  [[nodiscard]] device::FoundDevices find() const override {
    ++finds;
    return {{"fake", "fake"}, {}};
  }
  [[nodiscard]] device::Limits limits() const override { return {4, widest_tile, true}; }
  [[nodiscard]] const plan::MachineModel& model(const plan::Machine& machine) const override { return machine.gpu; }
  // The prediction of work that devices share and the host never does as fast.
  [[nodiscard]] device::PredictedTime predict(const analysis::AssemblyTree&, const device::PlanWish&) const override {
    if (seconds > 1) return {seconds, false, {}};
    return {-1e6, true, {1e5, 0}};
  }
  [[nodiscard]] plan::PlanOptions plan_options(const device::PlanWish& wish) const override {
    return device::registry().host().plan_options(wish);
  }
  [[nodiscard]] Offset executor_bytes(const plan::Plan& plan, Kind kind, Precision precision,
                                      int threads) const override {
    return device::registry().host().executor_bytes(plan, kind, precision, threads);
  }
  [[nodiscard]] std::unique_ptr<device::Executor<double>> make_executor(const device::Job& job,
                                                                        device::Scalar<double>) const override {
    return refuse<double>(job);
  }
  [[nodiscard]] std::unique_ptr<device::Executor<float>> make_executor(const device::Job& job,
                                                                       device::Scalar<float>) const override {
    return refuse<float>(job);
  }

  double seconds = 0;     ///< infinity: not taken unless asked for
  Index widest_tile = 0;  ///< see Limits
  bool works = false;     ///< as the host does, instead of refusing
  mutable int finds = 0;  ///< how often somebody looked for the devices
  mutable int asked = 0;  ///< how many executors were asked for

 private:
  template <class T>
  std::unique_ptr<device::Executor<T>> refuse(const device::Job& job) const {
    ++asked;
    if (works) return device::registry().host().make_executor(job, device::Scalar<T>());
    throw Error(StatusCode::out_of_memory, "others have its memory");
  }
};

}  // namespace espalier::test
