#include "solver/ranks/first_rank_executor.hpp"

#include <fmt/format.h>

#include <cstring>
#include <string>
#include <utility>
#include <vector>

#include "ranks/first_rank.hpp"
#include "ranks/packing.hpp"

namespace espalier::solver {

namespace {

template <class Outcome, class Use>
void each_field_of_outcome(Outcome& o, Use&& use) {
  use(o.not_positive);
  use(o.negative);
  use(o.two_by_two);
  use(o.replaced);
  use(o.replaced_rows);
  use(o.small);
  use(o.small_negative);
  use(o.failed);
  use(o.halted);
  use(o.determinant_sign);
  use(o.determinant_phase);
  use(o.determinant_log);
  use(o.busy_seconds);
  use(o.waiting_seconds);
  use(o.seconds);
}

template <class Work, class Use>
void each_field_of_work(Work& w, Use&& use) {
  use(w.name);
  use(w.busy_seconds);
  use(w.waiting_seconds);
  use(w.stolen_subtrees);
  use(w.peak_bytes);
  use(w.transferred_bytes);
  use(w.out_of_core);
}

template <class T>
class FirstRankExecutor final : public device::Executor<T> {
 public:
  using Made = std::unique_ptr<device::Executor<T>>;

  FirstRankExecutor(const std::function<Made(base::ThreadPool&)>& make, Index unknowns, const Context& context)
      : link_(*context.link), pool_(context.pool), threads_(link_, pool_), unknowns_(unknowns) {
    ranks::by_first_rank(link_, pool_, [&] { own_ = make(threads_.get()); });
    tell_report();
  }

  void set_pivot_rule(const device::PivotRule& rule) override {
    if (own_) own_->set_pivot_rule(rule);
  }

  device::FactorOutcome factorize(std::span<const T> values) override {
    device::FactorOutcome outcome;
    ranks::by_first_rank(link_, pool_, [&] { outcome = own_->factorize(values); });
    ranks::Packer mine;
    if (own_) each_field_of_outcome(outcome, [&](const auto& field) { mine.pack(field); });
    const std::vector<std::byte> told = ranks::from_first_rank(link_, mine.bytes());
    if (!own_) {
      ranks::Unpacker from(told);
      each_field_of_outcome(outcome, [&](auto& field) { from.get(field); });
    }
    tell_report();
    return outcome;
  }

  void solve(T* x, Index columns, bool transpose) override {
    ranks::by_first_rank(link_, pool_, [&] { own_->solve(x, columns, transpose); });
    const std::span<T> all(x, static_cast<std::size_t>(unknowns_) * static_cast<std::size_t>(columns));
    const std::vector<std::byte> told = ranks::from_first_rank(link_, std::as_bytes(all));
    if (!own_) std::memcpy(x, told.data(), all.size_bytes());
  }

  [[nodiscard]] std::string name() const override { return name_; }
  [[nodiscard]] Offset peak_bytes() const override { return peak_bytes_; }
  [[nodiscard]] device::OutOfCoreReport out_of_core() const override { return out_of_core_; }
  [[nodiscard]] std::vector<device::DeviceWork> device_work() const override { return work_; }

 private:
  void tell_report() {
    ranks::Packer mine;
    if (own_) {
      mine.pack(own_->name());
      mine.pack(own_->peak_bytes());
      mine.pack(own_->out_of_core());
      const std::vector<device::DeviceWork> work = own_->device_work();
      mine.pack(static_cast<std::uint64_t>(work.size()));
      for (const device::DeviceWork& w : work) each_field_of_work(w, [&](const auto& field) { mine.pack(field); });
    }
    const std::vector<std::byte> told = ranks::from_first_rank(link_, mine.bytes());
    ranks::Unpacker from(told);
    std::string name;
    std::uint64_t devices = 0;
    from.get(name);
    from.get(peak_bytes_);
    from.get(out_of_core_);
    from.get(devices);
    work_.assign(static_cast<std::size_t>(devices), {});
    for (device::DeviceWork& w : work_) each_field_of_work(w, [&](auto& field) { from.get(field); });
    name_ = fmt::format("{}, driven by {}", name, link_.name_of(0));
  }

  ranks::Communicator& link_;
  base::ThreadPool& pool_;
  ranks::FirstRankPool threads_;
  Index unknowns_;
  Made own_;  // the first rank's
  std::string name_;
  Offset peak_bytes_ = 0;
  device::OutOfCoreReport out_of_core_;
  std::vector<device::DeviceWork> work_;
};

}  // namespace

template <class T>
std::unique_ptr<device::Executor<T>> make_first_rank_executor(
    const std::function<std::unique_ptr<device::Executor<T>>(base::ThreadPool&)>& make, Index unknowns,
    const Context& context) {
  return std::make_unique<FirstRankExecutor<T>>(make, unknowns, context);
}

#define ESPALIER_INSTANTIATE(T)                                           \
  template std::unique_ptr<device::Executor<T>> make_first_rank_executor( \
      const std::function<std::unique_ptr<device::Executor<T>>(base::ThreadPool&)>&, Index, const Context&);
ESPALIER_FOR_SCALARS(ESPALIER_INSTANTIATE)
#undef ESPALIER_INSTANTIATE

}  // namespace espalier::solver
