#include "modes/blocks.hpp"

#include <algorithm>

namespace espalier::modes {

void HostBlocks::copy(const double* from, double* to, Index columns) const {
  std::copy_n(from, static_cast<std::int64_t>(n_) * columns, to);
}

Dense DeviceBlocks::gram(const double* v, Index p, const double* w, Index b) const {
  Dense out(p, b);
  space_.gram(v, p, w, b, out.data());
  return out;
}

void DeviceBlocks::subtract(const double* v, const Dense& h, double* w) const {
  space_.subtract(v, static_cast<Index>(h.rows()), h.data(), static_cast<Index>(h.cols()), w);
}

void DeviceBlocks::combine(const double* v, const Dense& s, double* out) const {
  space_.combine(v, static_cast<Index>(s.rows()), s.data(), static_cast<Index>(s.cols()), out);
}

void DeviceBlocks::randomize(double* w, Index b, std::uint64_t seed) const {
  Tall drawn(space_.rows(), b, nullptr);
  modes::randomize(pool_, space_.rows(), drawn.col(0), b, seed);
  space_.send(w, drawn.col(0), b);
}

}  // namespace espalier::modes
