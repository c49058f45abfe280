/// \file
/// Which devices carry out a plan: those that the caller wished for, or those that the machine model predicts to be
/// fastest.
#pragma once

#include <optional>
#include <string>
#include <vector>

#include "device/registry.hpp"
#include "espalier/solver.hpp"
#include "ranks/communicator.hpp"

namespace espalier::solver {

struct DeviceChoice {
  const device::Backend* backend = nullptr;  ///< never null in a choice that was made
  std::vector<int> numbers = {0};            ///< of its devices that share the plan
  std::string reason;                        ///< one sentence for the report
  bool ours = false;                         ///< the caller left it to us
  bool budgeted = true;                      ///< Options::device_memory_bytes is meant for these devices
  bool unequal = false;                      ///< the devices are not all of one kind, or not equally fast
  std::vector<double> speed = {};            ///< of the devices, relative to the fastest; empty: all are equal
  std::vector<std::size_t> places = {};      ///< of the devices among those asked for; empty: all are there
  std::string notice = {};                   ///< which devices were left out, and why
  bool one_a_rank = false;                   ///< numbers are by rank: each process has one of the devices

  [[nodiscard]] int devices() const { return static_cast<int>(numbers.size()); }
};

/// The host with all of its memory and threads.
DeviceChoice whole_host(const device::Registry& registry, std::string reason);

/// The devices among several that are of use: they can be started and are not so slow that the others would wait for
/// them. Speeds are rounded to eighths of the fastest, so that equal devices get equal parts in every run.
/// @param rates  of choice.numbers, measured
/// @throws Error(device_error) when none is left
DeviceChoice leave_out(DeviceChoice choice, const std::vector<device::DeviceRates>& rates);

/// The number of devices, at most `most`, that are predicted to be fastest; fewer where more would gain next to
/// nothing.
int fastest_count(const device::PredictedTime& time, int most);

/// The devices that Options::device names, without a look at what they can do; nothing where it names none, or one that
/// is not there, or leaves the choice to us.
std::optional<DeviceChoice> named_devices(const std::string& device, const device::Registry& registry);

/// Reads options.device. Where the choice is ours, as many devices are taken as the machine model says are fastest.
/// @param tree, wish  what is to be factorized: for the prediction; wish.devices does not matter
/// @throws Error(invalid_input) for a text that is no device; Error(device_error) for a device or a backend that is not
///         there, with the reason
DeviceChoice choose_device(const Options& options, const device::Registry& registry, const analysis::AssemblyTree& tree,
                           const device::PlanWish& wish);

/// Who takes over where `failed` could not be used: one device instead of several, then the host. Nothing when the
/// caller has named the devices, or when it was the host that failed.
/// @param why  what failed, for the report
std::optional<DeviceChoice> take_over(const DeviceChoice& failed, const std::string& why,
                                      const device::Registry& registry);

/// Where a factorization that ranks share will work: on each rank's host, or on a device of each rank where these were
/// named, or where the choice is ours (see `tree` and `wish` of choose_device()). Of the devices named, or all that a
/// rank sees, the ranks of a machine take one each, in turn. Collective.
/// @throws Error on all ranks: (invalid_input) for a text that is no device; (device_error) for devices that ranks
///         cannot share, or that one of them has not
DeviceChoice device_of_ranks(const Options& options, const device::Registry& registry, ranks::Communicator& link,
                             const analysis::AssemblyTree& tree, const device::PlanWish& wish);

/// The number of the device that this rank takes of those named; nothing where it takes none.
std::optional<int> own_device(const Options& options, const device::Registry& registry,
                              const ranks::Communicator& link);

/// Budget of each device in bytes; 0: what is free.
std::vector<Offset> budgets_of(const DeviceChoice& choice, const Options& options);

}  // namespace espalier::solver
