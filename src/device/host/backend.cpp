// The host as a backend: N devices of this machine's threads and memory.
#include "device/backend.hpp"

#include "device/host/host_executor.hpp"
#include "device/host/out_of_core/backend.hpp"
#include "device/host/pivot_placement.hpp"
#include "device/host/ranks/rank_executor.hpp"
#include "out_of_core/factory.hpp"

namespace espalier::device::host {

namespace {

// Each device has its part of the threads.
struct HostOutOfCore {
  template <class T>
  static std::vector<std::unique_ptr<out_of_core::OutOfCoreBackend<T>>> all(const Job& job) {
    std::vector<std::unique_ptr<out_of_core::OutOfCoreBackend<T>>> list;
    const auto devices = static_cast<int>(job.devices.size());
    for (int d = 0; d < devices; ++d) {
      HostOutOfCoreOptions host;
      host.device = d;
      host.devices = devices;
      if (devices > 1) host.threads = std::max(1, job.pool.size() / devices);
      list.push_back(make_host_out_of_core_backend<T>(job, host));
    }
    return list;
  }
};

class HostFactory final : public out_of_core::FactoryOfAll<HostOutOfCore> {
 public:
  [[nodiscard]] std::vector<Offset> in_core_bytes(const Job& job, Precision precision, bool complex) const override {
    const int threads = job.pool.size();
    const bool fp64 = precision == Precision::fp64;
    if (complex)
      return fp64 ? device_bytes<std::complex<double>>(job.plan, job.kind, threads)
                  : device_bytes<std::complex<float>>(job.plan, job.kind, threads);
    return fp64 ? device_bytes<double>(job.plan, job.kind, threads) : device_bytes<float>(job.plan, job.kind, threads);
  }
};

class HostBackend final : public Backend {
 public:
  [[nodiscard]] std::string_view name() const override { return "host"; }
  [[nodiscard]] std::string_view noun() const override { return "host device"; }
  [[nodiscard]] FoundDevices find() const override { return {{"host"}, {}}; }
  [[nodiscard]] Limits limits() const override {
    Limits limits;
    limits.most_devices = kMostHostDevices;
    limits.keeps_border = true;
    limits.ranks = true;
    limits.complex = true;
    limits.parts_with_zeros = true;
    return limits;
  }

  [[nodiscard]] const plan::MachineModel& model(const plan::Machine& machine) const override { return machine.host; }
  [[nodiscard]] PredictedTime predict(const analysis::AssemblyTree& tree, const PlanWish& wish) const override {
    const bool single = wish.precision != Precision::fp64;
    PredictedTime t;
    // A complex multiplication and addition are four real ones.
    t.fixed = plan::host_seconds(tree, wish.kind, single, wish.threads, model(wish.machine)) * (wish.complex ? 4 : 1);
    return t;
  }

  [[nodiscard]] plan::PlanOptions plan_options(const PlanWish& wish) const override {
    plan::PlanOptions o;
    const std::size_t value =
        (wish.precision == Precision::fp64 ? sizeof(double) : sizeof(float)) * (wish.complex ? 2 : 1);
    o.tiles.panel = static_cast<Index>(64 / value);
    o.tiles.max_block_size = wish.max_block_size;
    o.machine = model(wish.machine);
    o.unsymmetric = wish.kind == Kind::lu;
    o.ldlt = wish.kind == Kind::ldlt;
    o.devices = wish.devices;
    o.additional_subtrees = wish.sharing.additional_subtrees;
    o.stealing = wish.sharing.stealing;
    o.shared_top = wish.sharing.shared_top;
    o.interleave = static_cast<Index>(2 * wish.threads);
    o.reuse_distance = static_cast<Index>(16 * wish.threads);
    o.keep_contributions = wish.keep_contributions;
    if (wish.ranks > 1) share_among_ranks(o, wish);
    return o;
  }

  [[nodiscard]] Offset executor_bytes(const plan::Plan& plan, Kind kind, Precision precision,
                                      int threads) const override {
    return precision == Precision::fp64 ? host_bytes<double>(plan, kind, threads)
                                        : host_bytes<float>(plan, kind, threads);
  }
  [[nodiscard]] Offset complex_executor_bytes(const plan::Plan& plan, Kind kind, Precision precision,
                                              int threads) const override {
    return precision == Precision::fp64 ? host_bytes<std::complex<double>>(plan, kind, threads)
                                        : host_bytes<std::complex<float>>(plan, kind, threads);
  }

  [[nodiscard]] std::unique_ptr<Executor<double>> make_executor(const Job& job, Scalar<double>) const override {
    return make<double>(job);
  }
  [[nodiscard]] std::unique_ptr<Executor<float>> make_executor(const Job& job, Scalar<float>) const override {
    return make<float>(job);
  }
  [[nodiscard]] std::unique_ptr<Executor<std::complex<double>>> make_executor(
      const Job& job, Scalar<std::complex<double>>) const override {
    return make<std::complex<double>>(job);
  }
  [[nodiscard]] std::unique_ptr<Executor<std::complex<float>>> make_executor(
      const Job& job, Scalar<std::complex<float>>) const override {
    return make<std::complex<float>>(job);
  }
  [[nodiscard]] std::optional<std::vector<analysis::PivotMove>> place_pivots(const PlacementJob& job) const override {
    return host::place_pivots(job);
  }
  [[nodiscard]] std::optional<std::vector<analysis::PivotMove>> place_pivots(
      const ComplexPlacementJob& job) const override {
    return host::place_pivots(job);
  }
  [[nodiscard]] const out_of_core::Factory* out_of_core() const override { return &factory_; }

 private:
  // As little of the tree as possible is shared: what is passes through messages, and each rank keeps a copy.
  static void share_among_ranks(plan::PlanOptions& o, const PlanWish& wish) {
    o.devices = o.ranks = wish.ranks;
    o.rank = wish.rank;
    o.additional_subtrees = 0;
    o.stealing = false;
    o.balance_columns = true;
  }

  static constexpr int kMostHostDevices = 4096;  // as many as there may be threads

  template <class T>
  static std::unique_ptr<Executor<T>> make(const Job& job) {
    if (job.link != nullptr) return make_rank_executor<T>(job);
    HostOptions options;
    options.device_memory_bytes = job.memory_bytes;
    return make_host_executor<T>(job, std::move(options));
  }

  HostFactory factory_;
};

}  // namespace

const Backend& backend() {
  static const HostBackend the_backend;
  return the_backend;
}

}  // namespace espalier::device::host
