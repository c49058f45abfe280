/// \file
/// Memory of a GPU for the vectors of a linear system. For this backend alone: needs the CUDA runtime.
#pragma once

#include <memory>
#include <vector>

#include "device/cuda/runtime/device_guard.hpp"
#include "device/cuda/runtime/device_memory.hpp"

namespace espalier::device::cuda {

class SystemVectors {
 public:
  /// @param budget  outlives this object
  /// @param doubles  of a vector
  SystemVectors(DeviceBudget& budget, int device, Index doubles)
      : budget_(budget), device_(device), doubles_(doubles) {}

  double* slot(Index slot, Index columns) {
    const auto at = static_cast<std::size_t>(slot);
    if (slots_.size() <= at) slots_.resize(at + 1);
    return grown(slots_[at], columns);
  }
  double* right_hand_sides(Index columns) { return grown(right_hand_sides_, columns); }
  double* solutions(Index columns) { return grown(solutions_, columns); }

  /// Memory of the caller's own, who may keep it longer than this object lives.
  std::shared_ptr<double[]> take(Index columns) const {
    const DeviceGuard guard(device_);
    const Offset count = static_cast<Offset>(doubles_) * columns;
    auto array = std::make_shared<DeviceArray<double>>(count, budget_, budget_.held() + bytes_of(count));
    double* const data = array->data();
    return {data, [array, &budget = budget_, alive = std::weak_ptr<int>(alive_), device = device_](double*) mutable {
              if (!alive.expired()) budget.give_back(array->bytes());
              const DeviceGuard on(device, std::nothrow);
              array.reset();
            }};
  }

 private:
  static Offset bytes_of(Offset count) { return count * static_cast<Offset>(sizeof(double)); }

  double* grown(DeviceArray<double>& array, Index columns) {
    const Offset count = static_cast<Offset>(doubles_) * columns;
    if (array.size() < count) {
      const DeviceGuard guard(device_);
      budget_.give_back(array.bytes());
      array = DeviceArray<double>();
      array = DeviceArray<double>(count, budget_, budget_.held() + bytes_of(count));
    }
    return array.data();
  }

  DeviceBudget& budget_;
  int device_;
  Index doubles_;
  std::vector<DeviceArray<double>> slots_;
  DeviceArray<double> right_hand_sides_, solutions_;
  std::shared_ptr<int> alive_ = std::make_shared<int>();
};

}  // namespace espalier::device::cuda
