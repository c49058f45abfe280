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
  [[nodiscard]] virtual std::vector<std::unique_ptr<StreamBackend<double>>> make(const device::Job& job,
                                                                                 device::Scalar<double>) const = 0;
  [[nodiscard]] virtual std::vector<std::unique_ptr<StreamBackend<float>>> make(const device::Job& job,
                                                                                device::Scalar<float>) const = 0;
};

}  // namespace espalier::out_of_core
