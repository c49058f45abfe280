#include <fmt/format.h>

#include <algorithm>
#include <atomic>
#include <cmath>
#include <utility>

#include "base/at.hpp"
#include "solve/rank_residual.hpp"
#include "solver/factor.hpp"

namespace espalier::solver {

FactorValues::FactorValues(const System& system, Values values, const Context& context)
    : link_(context.link),
      shared_(system.rows_are_shared),
      values_(std::move(values)),
      residual_(system.prepared.a, system.rows, context.pool, system.numbers()) {
  if (shared_) {
    const solve::OwnRows mine = solve::own_rows(system.prepared.n(), link_->rank(), link_->size());
    residual_ = residual_.of_rows(mine.first, mine.end);
  }
  residual_.set_values(values_);
}

std::shared_ptr<const solve::ResidualSpace> FactorValues::space() const {
  if (link_ != nullptr) return std::make_shared<const solve::RankResidual>(residual_, *link_, shared_);
  return {std::shared_ptr<void>(), &residual_};
}

double FactorValues::norm(bool transpose) const {
  return link_ != nullptr ? solve::RankResidual(residual_, *link_, shared_).norm(transpose) : residual_.norm(transpose);
}

void FactorValues::load(const System& system, std::span<const double> from, device::DeviceLinearSystem* device,
                        base::ThreadPool& pool) {
  on_device_ = false;
  if (device != nullptr && system.prepared.keeps_order()) {
    send_range(from, 0, *device, pool);
  } else {
    copy_values(system.prepared, from, values_, pool);
    send(device);
  }
  residual_.set_values(values_);
}

void FactorValues::load(const System& system, const RankValues& from, device::DeviceLinearSystem* device,
                        base::ThreadPool& pool) {
  if (device == nullptr || !device->on_ranks() || !system.prepared.keeps_order())
    return load(system, from.all(), device, pool);
  const auto count = static_cast<Offset>(from.own.size());
  if (!from.on_device)
    send_range(from.own, from.first, *device, pool);
  else if (count > 0)
    device->copy_values(from.own.data(), from.first, count);
  device->share_values(from.first, count);
  on_device_ = from.on_device || from.own.size() < values_.size();
  residual_.set_values(values_);
}

// One range is on the link while the next one is copied: a quarter at a time, between 1 and 32 MiB; two parts of it for
// each thread.
void FactorValues::send_range(std::span<const double> from, Offset first, device::DeviceLinearSystem& device,
                              base::ThreadPool& pool) {
  const auto all = static_cast<Offset>(from.size());
  const Offset range = std::clamp(all / 4, Offset{1} << 17, Offset{1} << 22);
  const std::int64_t part = std::max<std::int64_t>(1 << 14, range / (2 * pool.size()));
  for (Offset done = 0; done < all; done += range) {
    const Offset now = std::min(range, all - done);
    const double* begin_from = from.data() + done;
    double* begin_to = values_.data() + first + done;
    pool.for_each_range(now, part, [&](std::int64_t begin, std::int64_t end) {
      std::copy(begin_from + begin, begin_from + end, begin_to + begin);
    });
    device.send_values(first + done, now);
  }
}

void FactorValues::send(device::DeviceLinearSystem* device) const {
  if (device != nullptr) device->send_values(0, static_cast<Offset>(values_.size()));
}

void FactorValues::fetch(device::DeviceLinearSystem* device) {
  if (!on_device_) return;
  device->read_values(values_);
  residual_.set_values(values_);
  on_device_ = false;
}

namespace {

// Of entries that are stored several times only the sum is known. @param target  of all of the caller's values
void refuse_duplicates(std::span<const Offset> target, std::span<const Offset> places) {
  if (target.empty()) return;
  std::vector<char> times(at(*std::max_element(target.begin(), target.end()) + 1), 0);
  for (const Offset entry : target) times[at(entry)] = static_cast<char>(std::min(2, times[at(entry)] + 1));
  for (const Offset place : places)
    if (times[at(target[at(place)])] > 1)
      throw Error(StatusCode::invalid_input,
                  fmt::format("the entry at place {} is stored more than once, and of its parts only the sum is known; "
                              "give all values",
                              place));
}

}  // namespace

std::vector<double> Factor::values_with(std::span<const Offset> places, std::span<const double> values) {
  const PreparedMatrix& p = analysis_->system->prepared;
  for (const Offset place : places)
    if (place < 0 || place >= p.caller_nonzeros)
      throw Error(StatusCode::invalid_input,
                  fmt::format("there is no place {} among the {} values of the matrix", place, p.caller_nonzeros));
  refuse_duplicates(p.target, places);
  std::vector<double> all = values_by_caller();
  const std::size_t parts = at(base::parts_of(p.numbers));
  for (std::size_t k = 0; k < places.size(); ++k)
    std::copy_n(values.data() + parts * k, parts, all.data() + parts * at(places[k]));
  return all;
}

void Factor::expect_fit(std::span<const double> values) const {
  const PreparedMatrix& p = analysis_->system->prepared;
  constexpr std::int64_t kValues = 1 << 16;
  std::atomic<bool> finite{true};
  context_.pool.for_each_range(static_cast<std::int64_t>(values.size()), kValues,
                               [&](std::int64_t begin, std::int64_t end) {
                                 for (auto k = begin; k < end; ++k)
                                   if (!std::isfinite(values[at(k)])) finite = false;
                               });
  if (finite && p.keeps_order() && p.numbers != base::Numbers::hermitian) return;
  Values mine(values_.values().size());
  copy_values(p, values, mine, context_.pool);
  if (!finite || !has_real_diagonal(p, mine)) refuse_entry(p, mine);
}

}  // namespace espalier::solver
