/// \file
/// What a device::Backend offers for factorizations that are larger than its devices' memory.
#pragma once

#include <memory>
#include <vector>

#include "device/backend.hpp"
#include "out_of_core/backend.hpp"

namespace espalier::out_of_core {

class Factory {
 public:
  virtual ~Factory() = default;
  /// One for each of job.devices, of one sort; the first one does the solves. They take their memory in prepare().
  [[nodiscard]] virtual std::vector<std::unique_ptr<OutOfCoreBackend<double>>> make(const device::Job& job,
                                                                                    device::Scalar<double>) const = 0;
  [[nodiscard]] virtual std::vector<std::unique_ptr<OutOfCoreBackend<float>>> make(const device::Job& job,
                                                                                   device::Scalar<float>) const = 0;
  /// Only where Backend::limits().complex says so.
  [[nodiscard]] virtual std::vector<std::unique_ptr<OutOfCoreBackend<std::complex<double>>>> make(
      const device::Job& /*job*/, device::Scalar<std::complex<double>>) const {
    return {};
  }
  [[nodiscard]] virtual std::vector<std::unique_ptr<OutOfCoreBackend<std::complex<float>>>> make(
      const device::Job& /*job*/, device::Scalar<std::complex<float>>) const {
    return {};
  }
  /// Bytes that each device would take in core, held against its budget; empty: not known before they are taken.
  [[nodiscard]] virtual std::vector<Offset> in_core_bytes(const device::Job& /*job*/, Precision /*precision*/,
                                                          bool /*complex*/) const {
    return {};
  }
};

/// A factory by `Of`, whose template all<T>(job) serves every real scalar.
template <class Of>
class FactoryOf : public Factory {
 public:
  [[nodiscard]] std::vector<std::unique_ptr<OutOfCoreBackend<double>>> make(const device::Job& job,
                                                                            device::Scalar<double>) const override {
    return Of::template all<double>(job);
  }
  [[nodiscard]] std::vector<std::unique_ptr<OutOfCoreBackend<float>>> make(const device::Job& job,
                                                                           device::Scalar<float>) const override {
    return Of::template all<float>(job);
  }
};

/// ... and every complex one.
template <class Of>
class FactoryOfAll : public FactoryOf<Of> {
 public:
  using FactoryOf<Of>::make;
  [[nodiscard]] std::vector<std::unique_ptr<OutOfCoreBackend<std::complex<double>>>> make(
      const device::Job& job, device::Scalar<std::complex<double>>) const override {
    return Of::template all<std::complex<double>>(job);
  }
  [[nodiscard]] std::vector<std::unique_ptr<OutOfCoreBackend<std::complex<float>>>> make(
      const device::Job& job, device::Scalar<std::complex<float>>) const override {
    return Of::template all<std::complex<float>>(job);
  }
};

}  // namespace espalier::out_of_core
