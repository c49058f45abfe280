#include "modes/device_search.hpp"

#include <fmt/format.h>

#include <algorithm>

#include "base/stopwatch.hpp"
#include "device/registry.hpp"

namespace espalier::modes {

namespace {

enum Slot : Index { kBasis, kImage, kDiagonal };

}  // namespace

DeviceSearch::DeviceSearch(std::unique_ptr<device::TallSpace> space, Resources& shop)
    : space_(std::move(space)), shop_(shop), blocks_(*space_, shop.pool) {}

std::unique_ptr<DeviceSearch> DeviceSearch::make(Pencil& pencil, const Product& mass,
                                                 const std::vector<double>& diagonal, Resources& shop,
                                                 ModesResult& result) {
  if (pencil.gpu() < 0) return nullptr;
  const Options& options = shop.options;
  const Offset budget =
      options.device_memory_each_bytes.empty() ? options.device_memory_bytes : options.device_memory_each_bytes.front();
  const Offset left = budget > 0 ? std::max<Offset>(1, budget - pencil.device_bytes) : 0;
  try {
    const device::Backend* backend = device::registry().find("gpu");
    auto space = backend != nullptr ? backend->make_tall_space(pencil.n(), pencil.gpu(), left) : nullptr;
    if (space == nullptr) return nullptr;
    std::unique_ptr<DeviceSearch> made(new DeviceSearch(std::move(space), shop));
    device::TallSpace& on_device = *made->space_;
    const Index matrix = on_device.add_matrix(mass.first(), mass.column(), mass.value());
    double* const d = on_device.block(kDiagonal, 1);
    on_device.send(d, diagonal.data(), 1);
    SpectralOperator& op = made->op_;
    op.n = pencil.n();
    op.inner = "M";
    op.b = [&on_device, matrix, &result](const double* x, double* y, Index columns) {
      const base::Stopwatch watch(result.seconds.products);
      on_device.multiply(matrix, x, y, columns);
    };
    op.solve = [&on_device, &pencil](const double* x, double* y, Index columns) {
      pencil.solve_device(x, y, columns, on_device.queue());
    };
    op.weights = [&on_device, d](const double* w, Index columns) {
      Eigen::VectorXd out(columns);
      on_device.weighted_squares(d, w, columns, out.data());
      return out;
    };
    return made;
  } catch (const Error& e) {
    if (e.status().code != StatusCode::out_of_memory) throw;
    shop.log(fmt::format("modes: the basis stays on the host: {}", e.what()));
    return nullptr;
  }
}

std::optional<Workspace> DeviceSearch::workspace(Index most, Index least, Index block) {
  constexpr Index kLongest = 2048;  // columns that the kernels take at a time
  if (least > kLongest) return std::nullopt;
  for (Index columns = std::min(most, kLongest);; columns = std::max(least, columns - columns / 4)) {
    try {
      double* const image = space_->block(kImage, block);
      return Workspace{blocks_, space_->block(kBasis, columns), columns, image, block};
    } catch (const Error& e) {
      if (e.status().code != StatusCode::out_of_memory) throw;
      if (columns > least) continue;
      shop_.log(fmt::format("modes: the basis goes to the host: {}", e.what()));
      return std::nullopt;
    }
  }
}

void DeviceSearch::fetch(double* v, const Dense& s, double* to) {
  blocks_.combine(v, s, v);
  space_->fetch(to, v, static_cast<Index>(s.cols()));
}

}  // namespace espalier::modes
