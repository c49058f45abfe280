/// \file
/// The factors of a store on disk, front by front.
#pragma once

#include <vector>

#include "out_of_core/disk_store.hpp"
#include "out_of_core/front_reader.hpp"
#include "out_of_core/plan.hpp"

namespace espalier::out_of_core {

class DiskFronts final : public FrontReader {
 public:
  /// All arguments outlive it.
  DiskFronts(DiskStore& store, const OutOfCorePlan& plan, const OutOfCoreLayout& layout)
      : store_(store), plan_(plan), layout_(layout), part_of_(plan.factor_store.size(), -1) {}

  void begin_way(std::span<const Index> fronts, bool second) override;
  void need(Index front) override {
    if (in_store(front)) store_.need_part(part(front));
  }
  void done(Index front) override {
    if (in_store(front)) store_.release_part(part(front));
  }
  void give_up() noexcept override { store_.give_up(); }
  void end_way() noexcept override { store_.end(); }
  [[nodiscard]] std::span<const Offset> order() const override { return plan_.factor_store; }

  /// Bytes of the window, in such blocks, without which there is no solve.
  static Offset least_window(const OutOfCorePlan& plan, const OutOfCoreLayout& layout, Offset block_bytes);

 private:
  [[nodiscard]] bool in_store(Index front) const { return plan_.factor_store[at(front)] >= 0; }
  [[nodiscard]] std::size_t part(Index front) const { return static_cast<std::size_t>(part_of_[at(front)]); }

  DiskStore& store_;
  const OutOfCorePlan& plan_;
  const OutOfCoreLayout& layout_;
  std::vector<Index> part_of_;  // fronts; place in the way at hand
};

}  // namespace espalier::out_of_core
