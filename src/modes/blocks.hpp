/// \file
/// Where the vectors of a search live: the host's memory, or a GPU's beside the factor.
#pragma once

#include "base/thread_pool.hpp"
#include "device/tall_space.hpp"
#include "modes/tall.hpp"

namespace espalier::modes {

/// Dense algebra of tall blocks (tall.hpp) there. Pointers to blocks are memory of that place, small matrices of the
/// host.
class Blocks {
 public:
  virtual ~Blocks() = default;
  [[nodiscard]] virtual Dense gram(const double* v, Index p, const double* w, Index b) const = 0;
  virtual void subtract(const double* v, const Dense& h, double* w) const = 0;
  virtual void combine(const double* v, const Dense& s, double* out) const = 0;
  virtual void randomize(double* w, Index b, std::uint64_t seed) const = 0;
  /// Columns from the first to the last.
  virtual void copy(const double* from, double* to, Index columns) const = 0;
};

class HostBlocks final : public Blocks {
 public:
  HostBlocks(base::ThreadPool& pool, Index n) : pool_(pool), n_(n) {}
  [[nodiscard]] Dense gram(const double* v, Index p, const double* w, Index b) const override {
    return modes::gram(pool_, n_, v, p, w, b);
  }
  void subtract(const double* v, const Dense& h, double* w) const override { modes::subtract(pool_, n_, v, h, w); }
  void combine(const double* v, const Dense& s, double* out) const override { modes::combine(pool_, n_, v, s, out); }
  void randomize(double* w, Index b, std::uint64_t seed) const override { modes::randomize(pool_, n_, w, b, seed); }
  void copy(const double* from, double* to, Index columns) const override;

 private:
  base::ThreadPool& pool_;
  Index n_;
};

/// The sums of a GPU have another order than the host's: the same modes to rounding.
class DeviceBlocks final : public Blocks {
 public:
  DeviceBlocks(device::TallSpace& space, base::ThreadPool& pool) : space_(space), pool_(pool) {}
  [[nodiscard]] Dense gram(const double* v, Index p, const double* w, Index b) const override;
  void subtract(const double* v, const Dense& h, double* w) const override;
  void combine(const double* v, const Dense& s, double* out) const override;
  /// The numbers of the host.
  void randomize(double* w, Index b, std::uint64_t seed) const override;
  void copy(const double* from, double* to, Index columns) const override { space_.copy(from, to, columns); }

 private:
  device::TallSpace& space_;
  base::ThreadPool& pool_;
};

}  // namespace espalier::modes
