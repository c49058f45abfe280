#include "solver/ranks/part_calls.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <stdexcept>
#include <utility>
#include <vector>

#include "solver/session/session_calls.hpp"

namespace espalier::solver {

namespace {

std::size_t doubles_in_number(const Session& s) { return at(s.current().system->parts()); }

void factorize_part(Session& s, Factor& factor, std::span<const double> values) {
  const GatheredMatrix::Slice own = s.gathered.own_slice(values, s.link());
  factor.factorize({own.values, own.first, [&] { return GatheredMatrix::gather_values(own, s.link()); }});
}

SolveResult solve_rows(Session& s, std::span<const double> b, std::span<double> x, Index columns,
                       const std::function<SolveResult(double* x)>& whole) {
  const RowRange rows = rows_of(s);
  if (columns < 1) throw Error(StatusCode::invalid_input, "at least one right-hand side is needed");
  const std::size_t doubles = doubles_in_number(s);
  const std::size_t column = doubles * at(rows.count);
  const std::size_t need = column * at(columns);
  if (b.size() < need || x.size() < need)
    throw Error(StatusCode::invalid_input,
                fmt::format("{} right-hand sides of {} rows need {} values on this rank; b has {}, x has {}", columns,
                            rows.count, need / doubles, b.size() / doubles, x.size() / doubles));
  std::vector<double> all = s.gathered.gather_rows(b.first(need), rows, columns, s.link());
  SolveResult result = whole(all.data());
  const std::size_t n = doubles * at(s.current().n());
  for (std::size_t c = 0; c < at(columns); ++c)
    std::copy_n(all.data() + c * n + doubles * at(rows.first), column, x.data() + c * column);
  return result;
}

// Values [0, count) of an array of the device, on the host.
std::vector<double> fetched(device::DeviceLinearSystem& device, const double* from, Offset count) {
  std::vector<double> copy(at(count));
  if (count > 0) device.fetch(copy.data(), from, count);
  return copy;
}

}  // namespace

RowRange rows_of(const Session& s) {
  if (!s.parts) return {0, s.current().n()};
  return s.rows ? *s.rows : s.gathered.rows();
}

void set_rows(Session& s, const char* call, RowRange rows) {
  check_analyzed(s, call);
  const Index n = s.current().n();
  if (rows.first < 0 || rows.count < 0 || rows.first > n || rows.count > n - rows.first)
    throw std::invalid_argument(
        fmt::format("{}: {} rows from row {} on of a matrix of {}", call, rows.count, rows.first, n));
  if (!s.parts) throw std::logic_error(fmt::format("{}: the matrix was not given in parts", call));
  s.rows = rows;
}

FactorResult refactorize_part(Session& s, std::span<const double> values) {
  return factor_by(s, [&](Factor& factor) { factorize_part(s, factor, values); });
}

FactorResult factorize_of_first(Session& s, const std::function<std::span<const double>()>& checked) {
  return factor_by(s, [&](Factor& factor) {
    std::span<const double> mine;
    s.link()->expect_all([&] {
      if (s.link()->rank() == 0) mine = checked();
    });
    factor.factorize({mine, 0, [&] { return std::move(s.link()->all_gather_of(mine).front()); }});
  });
}

SolveResult solve_part(Session& s, std::span<const double> b, std::span<double> x, Index columns,
                       const std::function<SolveResult(double* x)>& whole) {
  return solve_by(s, [&] { return solve_rows(s, b, x, columns, whole); });
}

FactorResult refactorize_part_device(Session& s, const double* values, Offset count, void* queue) {
  return factor_by(s, [&](Factor& factor) {
    device::DeviceLinearSystem* device = factor.device_of_values();
    if (device == nullptr) throw not_on_device(factor.numeric(), "refactorize()");
    const Offset mine = s.gathered.part_entries();
    if (mine > 0) {
      if (count != mine)
        throw Error(StatusCode::invalid_input,
                    fmt::format("{} values for the {} entries of this rank's part", count, mine));
      device->expect_reachable(values, "Solver::refactorize_device: the values");
      device->wait_for(queue);
    }
    if (!s.gathered.is_of_first()) return factorize_part(s, factor, fetched(*device, values, mine));
    factor.factorize({{values, at(mine)},
                      0,
                      [&] {
                        return std::move(
                            s.link()->all_gather_of(std::span<const double>(fetched(*device, values, mine))).front());
                      },
                      true});
  });
}

SolveResult solve_part_device(Session& s, const double* b, double* x, Index columns, void* queue,
                              const std::function<SolveResult(double* x)>& whole) {
  return solve_by(s, [&] {
    device::DeviceLinearSystem* device = s.factor->numeric().device_system();
    if (device == nullptr) throw not_on_device(s.factor->numeric(), "solve()");
    const Offset count = Offset{rows_of(s).count} * std::max<Index>(columns, 0);
    if (count > 0) {
      device->expect_reachable(b, "Solver::solve_device: the right-hand sides");
      device->expect_reachable(x, "Solver::solve_device: the solutions");
      device->wait_for(queue);
    }
    std::vector<double> mine = fetched(*device, b, count);
    SolveResult result = solve_rows(s, mine, mine, columns, whole);
    if (count > 0) {
      device->send(x, mine.data(), count);
      device->finish();
    }
    return result;
  });
}

}  // namespace espalier::solver
