/// \file
/// A search for modes in the memory of the GPU that has the factor: basis, products with M, solves.
#pragma once

#include <memory>
#include <optional>
#include <vector>

#include "modes/lanczos.hpp"
#include "modes/pencil.hpp"
#include "modes/product.hpp"
#include "modes/resources.hpp"

namespace espalier::modes {

class DeviceSearch {
 public:
  /// @returns null where the factor of the pencil is not on a GPU, or the GPU has no room for M; the log says so
  /// @param diagonal  of M
  static std::unique_ptr<DeviceSearch> make(Pencil& pencil, const Product& mass, const std::vector<double>& diagonal,
                                            Resources& shop, ModesResult& result);

  /// Room for a basis of `most` columns, or of fewer where memory lacks, but at least `least`; nothing where that is
  /// too much as well. Workspaces of before end.
  std::optional<Workspace> workspace(Index most, Index least, Index block);
  [[nodiscard]] const SpectralOperator& op() const { return op_; }
  void send(double* to, const double* from, Index columns) { space_->send(to, from, columns); }
  /// V S of columns of the workspace, which it overwrites, to the host.
  void fetch(double* v, const Dense& s, double* to);

 private:
  DeviceSearch(std::unique_ptr<device::TallSpace> space, Resources& shop);

  std::unique_ptr<device::TallSpace> space_;
  Resources& shop_;
  DeviceBlocks blocks_;
  SpectralOperator op_;
};

}  // namespace espalier::modes
