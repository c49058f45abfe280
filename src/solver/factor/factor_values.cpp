#include <fmt/format.h>

#include <algorithm>
#include <atomic>
#include <bit>
#include <cmath>
#include <cstdint>
#include <cstring>
#include <utility>

#include "base/at.hpp"
#include "solve/rank_residual.hpp"
#include "solver/factor/factor.hpp"

namespace espalier::solver {

namespace {

bool has_bits_of(double a, double b) { return std::bit_cast<std::uint64_t>(a) == std::bit_cast<std::uint64_t>(b); }

}  // namespace

FactorValues::FactorValues(const System& system, Values values, const Context& context)
    : link_(context.link),
      shared_(system.rows_are_shared),
      compares_(context.options.partial_refactorization && context.link == nullptr),
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
  changed_.reset();
  const bool known = knows_changes(device);
  on_device_ = false;
  if (device != nullptr && system.prepared.keeps_order()) {
    if (known)
      send_changed(from, *device, pool);
    else
      send_range(from, 0, *device, pool);
  } else if (known) {
    Values mine(values_.size());
    copy_values(system.prepared, from, mine, pool);
    send_changed(mine, *device, pool);
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

bool FactorValues::knows_changes(device::DeviceLinearSystem* device) const {
  return compares_ && !on_device_ && device != nullptr && device->has_values();
}

void FactorValues::load(std::span<const Offset> places, std::span<const double> numbers,
                        device::DeviceLinearSystem* device) {
  fetch(device);
  changed_.reset();
  const bool known = knows_changes(device);
  std::vector<std::pair<Offset, double>> before;  // of each place the first is what stood there
  before.reserve(places.size());
  for (std::size_t k = 0; k < places.size(); ++k)
    before.emplace_back(places[k], std::exchange(values_[at(places[k])], numbers[k]));
  residual_.set_values(values_);
  if (!known) return send(device);
  const auto lower = [](const auto& a, const auto& b) { return a.first < b.first; };
  if (!std::is_sorted(before.begin(), before.end(), lower)) std::stable_sort(before.begin(), before.end(), lower);
  changed_.emplace();
  std::vector<double> changed;
  for (std::size_t k = 0; k < before.size(); ++k) {
    const auto [place, was] = before[k];
    if ((k > 0 && before[k - 1].first == place) || has_bits_of(was, values_[at(place)])) continue;
    changed_->push_back(place);
    changed.push_back(values_[at(place)]);
  }
  device->replace_values(*changed_, changed);
}

// Where many have changed, all are sent, which takes no longer.
void FactorValues::send_changed(std::span<const double> from, device::DeviceLinearSystem& device,
                                base::ThreadPool& pool) {
  constexpr std::int64_t kRange = 1 << 15;
  constexpr std::size_t kSome = 64;
  const auto all = static_cast<std::int64_t>(from.size());
  std::vector<std::vector<Offset>> found(at((all + kRange - 1) / kRange));
  pool.for_each_range(all, kRange, [&](std::int64_t begin, std::int64_t end) {
    const auto bytes = at(end - begin) * sizeof(double);
    if (std::memcmp(&from[at(begin)], &values_[at(begin)], bytes) == 0) return;
    for (auto k = begin; k < end; ++k)
      if (!has_bits_of(from[at(k)], values_[at(k)])) found[at(begin / kRange)].push_back(k);
  });
  std::vector<std::size_t> first{0};
  for (const auto& of_range : found) first.push_back(first.back() + of_range.size());
  changed_.emplace(first.back());
  pool.for_each_range(static_cast<std::int64_t>(found.size()), 1, [&](std::int64_t begin, std::int64_t end) {
    for (auto k = begin; k < end; ++k)
      std::copy(found[at(k)].begin(), found[at(k)].end(), changed_->data() + first[at(k)]);
  });
  if (changed_->size() > from.size() / kSome) return send_range(from, 0, device, pool);
  std::vector<double> numbers;
  numbers.reserve(changed_->size());
  for (const Offset place : *changed_) numbers.push_back(values_[at(place)] = from[at(place)]);
  device.replace_values(*changed_, numbers);
}

void FactorValues::follow(std::span<const double> before, const plan::SourceMap& now, base::ThreadPool& pool) {
  constexpr std::int64_t kRange = 1 << 15;
  const auto ranges = [&](std::size_t count, auto&& use) {
    pool.for_each_range(static_cast<std::int64_t>(count), kRange, use);
  };
  ranges(values_.size(),
         [&](std::int64_t begin, std::int64_t end) { std::fill(values_.begin() + begin, values_.begin() + end, 0.0); });
  ranges(before.size(), [&](std::int64_t begin, std::int64_t end) {
    plan::SourceMap::Cursor place(now);
    for (auto k = begin; k < end; ++k)
      if (const Offset to = place(k); to >= 0) values_[at(to)] = before[at(k)];
  });
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

// Where entries are stored several times, only the sum is known. @param target  of all of the caller's values
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

bool Factor::accepts(std::span<const Offset> entries, std::span<const double> values) const {
  const PreparedMatrix& p = analysis_->system->prepared;
  for (const Offset place : entries)
    if (place < 0 || place >= p.caller_nonzeros)
      throw Error(StatusCode::invalid_input,
                  fmt::format("there is no place {} among the {} values of the matrix", place, p.caller_nonzeros));
  const bool finite = std::all_of(values.begin(), values.end(), [](double v) { return std::isfinite(v); });
  return finite && p.keeps_order() && p.numbers != base::Numbers::hermitian;
}

void Factor::factorize_entries(std::span<const Offset> entries, std::span<const double> values) {
  const double start = base::now_seconds();
  if (numeric_) values_.fetch(numeric_->device_system());  // which may be another one in a moment
  begin();                                                 // makes the numbers' object where a failure has taken it
  const Offset parts = analysis_->system->parts();
  std::vector<Offset> places;
  places.reserve(values.size());
  for (const Offset entry : entries)
    for (Offset part = 0; part < parts; ++part) places.push_back(parts * entry + part);
  values_.load(places, values, numeric_->device_system());
  if (values_.changed()) numeric_->expect_changes(*values_.changed());
  finish(settle_pivots(), start);
}

std::vector<double> Factor::values_at(std::span<const Offset> entries) {
  values_.fetch(numeric_->device_system());
  const auto parts = at(analysis_->system->parts());
  std::vector<double> out(parts * entries.size());
  for (std::size_t k = 0; k < entries.size(); ++k)
    std::copy_n(values_.values().data() + parts * at(entries[k]), parts, out.data() + parts * k);
  return out;
}

std::vector<double> Factor::values_with(std::span<const Offset> places, std::span<const double> values) {
  const PreparedMatrix& p = analysis_->system->prepared;
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
