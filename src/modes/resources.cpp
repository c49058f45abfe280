#include "modes/resources.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>

#include "base/stage.hpp"
#include "matrix/file.hpp"
#include "solver/session/session.hpp"
#include "solver/session/status_of.hpp"

namespace espalier::modes {

namespace {

// A share of the machine's memory, where the caller sets no limit: the rest is for the factor, and for others.
constexpr double kShareOfMachine = 0.25;

base::Interruption::Clock::duration period_of(const Options& o) {
  return std::chrono::duration_cast<base::Interruption::Clock::duration>(
      std::chrono::duration<double>(o.interrupted_every));
}

}  // namespace

Resources::Resources(const Options& the_options)
    : options(the_options),
      interruption(base::telling(options.interrupted), period_of(options)),
      pool(solver::threads_of(options), &interruption),
      budget("host memory", options.host_memory_bytes) {}

Tall Resources::basis(Index n, Index wanted, Index least, Offset factor_bytes) {
  const Offset column = Offset{n} * static_cast<Offset>(sizeof(double));
  const Offset limit = options.host_memory_bytes;
  const auto machine = static_cast<Offset>(kShareOfMachine * static_cast<double>(matrix::machine_memory()));
  const Offset room = limit > 0 ? limit - factor_bytes - budget.held() : machine;
  const auto fits = static_cast<Index>(std::clamp<Offset>(room / column, 0, wanted));
  if (fits < least)
    throw Error(
        StatusCode::out_of_memory,
        fmt::format("{} vectors of {} rows take {} beside the {} of the factor and the modes found, and {} are "
                    "allowed; allow more host memory, or ask for fewer modes",
                    least, n, base::format_bytes(least * column), base::format_bytes(factor_bytes + budget.held()),
                    base::format_bytes(limit > 0 ? limit : machine)));
  return {n, fits, &budget};
}

Status guarded(Resources& shop, const std::function<void()>& body) {
  return solver::status_of(shop.interruption, "ask for fewer modes, or use a machine with more", body);
}

void check_options(const ModesOptions& o) {
  const auto refuse = [](const std::string& text) { throw Error(StatusCode::invalid_input, text); };
  if (o.count < 0) refuse(fmt::format("count = {}: give a number of modes, or 0 and a bound", o.count));
  if (std::isnan(o.below) || o.below == -std::numeric_limits<double>::infinity())
    refuse(fmt::format("below = {}: give a number", o.below));
  if (o.count == 0 && std::isinf(o.below))
    refuse("nothing is asked for: give a count of modes, or a bound below which all are sought");
  if (std::isinf(o.shift)) refuse(fmt::format("shift = {}: give a number", o.shift));
  if (!(o.tolerance > 0) || o.tolerance > 0.1)
    refuse(fmt::format("tolerance = {:g}: give a number above 0, at most 0.1", o.tolerance));
  if (o.block_size < 0 || o.block_size > 256)
    refuse(fmt::format("block_size = {}: give 0 (our choice) to 256", o.block_size));
  if (o.basis_size < 0) refuse(fmt::format("basis_size = {}: give 0 (our choice) or more", o.basis_size));
}

}  // namespace espalier::modes
