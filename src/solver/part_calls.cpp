#include "solver/part_calls.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <stdexcept>
#include <utility>
#include <vector>

#include "solver/session_calls.hpp"

namespace espalier::solver {

namespace {

std::size_t doubles_in_number(const Session& s) { return static_cast<std::size_t>(s.current().system->parts()); }

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
  return factor_by(s, [&](Factor& factor) {
    const GatheredMatrix::Slice own = s.gathered.own_slice(values, s.link());
    factor.factorize({own.values, own.first, [&] { return GatheredMatrix::gather_values(own, s.link()); }});
  });
}

FactorResult factorize_of_first(Session& s, const std::function<std::span<const double>()>& checked) {
  return factor_by(s, [&](Factor& factor) {
    ranks::Link& link = *s.link();
    std::span<const double> mine;
    link.expect_all([&] {
      if (link.rank() == 0) mine = checked();
    });
    factor.factorize({mine, 0, [&] { return std::move(link.all_gather_of(mine).front()); }});
  });
}

SolveResult solve_part(Session& s, std::span<const double> b, std::span<double> x, Index columns,
                       const std::function<SolveResult(double* x)>& whole) {
  return solve_by(s, [&] {
    const RowRange rows = rows_of(s);
    if (columns < 1) throw Error(StatusCode::invalid_input, "at least one right-hand side is needed");
    const std::size_t doubles = doubles_in_number(s);
    const std::size_t column = doubles * static_cast<std::size_t>(rows.count);
    const std::size_t need = column * static_cast<std::size_t>(columns);
    if (b.size() < need || x.size() < need)
      throw Error(StatusCode::invalid_input,
                  fmt::format("{} right-hand sides of {} rows need {} values on this rank; b has {}, x has {}", columns,
                              rows.count, need / doubles, b.size() / doubles, x.size() / doubles));
    std::vector<double> all = s.gathered.gather_rows(b.first(need), rows, columns, s.link());
    SolveResult result = whole(all.data());
    const std::size_t n = doubles * static_cast<std::size_t>(s.current().n());
    for (std::size_t c = 0; c < static_cast<std::size_t>(columns); ++c)
      std::copy_n(all.data() + c * n + doubles * static_cast<std::size_t>(rows.first), column, x.data() + c * column);
    return result;
  });
}

}  // namespace espalier::solver
