/// \file
/// What the out-of-core planner asks of a GPU: where a front's columns stand, and how many bytes its tables take.
#pragma once

#include <memory>
#include <vector>

#include "device/cuda/out_of_core/part_tables.hpp"
#include "out_of_core/backend.hpp"

namespace espalier::device::cuda {

/// What the backends of one plan share.
struct OutOfCoreSource {
  /// @param the_plan  of any number of devices; must outlive this
  OutOfCoreSource(const plan::Plan& the_plan, Kind kind, Offset element_bytes)
      : own(the_plan.ownership.devices > 1 ? std::make_unique<plan::Plan>(plan::plan_for_one_device(the_plan))
                                           : nullptr),
        plan(own != nullptr ? *own : the_plan),
        tables(plan, kind, element_bytes) {}
  std::unique_ptr<plan::Plan> own;
  const plan::Plan& plan;  ///< for one device
  OutOfCoreTables tables;
};

/// The backend's side of the planner; offsets in elements.
template <class T>
class CudaOutOfCoreLayout : public out_of_core::OutOfCoreBackend<T> {
 public:
  explicit CudaOutOfCoreLayout(std::shared_ptr<const OutOfCoreSource> source);

  [[nodiscard]] const plan::Plan& plan() const override { return source_->plan; }
  [[nodiscard]] Offset element_bytes() const override { return sizeof(T); }
  [[nodiscard]] const plan::TaskList& order() const override { return out_of_core_tables().order(); }
  [[nodiscard]] const plan::ArraySizes& sizes() const override { return sizes_; }
  [[nodiscard]] Offset factor_offset(Index f, Index column) const override;
  [[nodiscard]] Offset contribution_offset(Index f, Index column) const override;
  void slab(Index f, Index begin, Index end, Index row, std::vector<out_of_core::Extent>& extents) const override;
  [[nodiscard]] Offset share_bytes(Index f) const override { return out_of_core_tables().share_bytes(f); }
  [[nodiscard]] Offset table_bytes(const out_of_core::InCoreStep& s) const override {
    return out_of_core_tables().tables(s).bytes;
  }
  [[nodiscard]] Offset scratch_bytes(const out_of_core::InCoreStep& s) const override {
    return out_of_core_tables().scratch(s).bytes;
  }
  [[nodiscard]] Offset output_bytes(const out_of_core::InCoreStep& s) const override {
    return out_of_core_tables().scratch(s).flags;
  }
  [[nodiscard]] Offset table_bytes(Index f, Index b, Index e) const override {
    return out_of_core_tables().tables(f, b, e).bytes;
  }
  [[nodiscard]] Offset scratch_bytes(Index f, Index b, Index e) const override {
    return out_of_core_tables().scratch(f, b, e).bytes;
  }
  [[nodiscard]] Offset output_bytes(Index f, Index b, Index e) const override {
    return out_of_core_tables().scratch(f, b, e).flags;
  }
  [[nodiscard]] bool copies_values() const override { return true; }
  [[nodiscard]] Offset solve_bytes(const std::vector<Index>& fronts, Index columns) const override {
    return PartTables::most_bytes(plan(), out_of_core_tables(), fronts, sizeof(T), columns);
  }

 protected:
  [[nodiscard]] const OutOfCoreTables& out_of_core_tables() const { return source_->tables; }
  [[nodiscard]] const Front& front(Index f) const {
    return out_of_core_tables().device_plan().fronts[static_cast<std::size_t>(f)];
  }

 private:
  std::shared_ptr<const OutOfCoreSource> source_;
  plan::ArraySizes sizes_;
};

}  // namespace espalier::device::cuda
