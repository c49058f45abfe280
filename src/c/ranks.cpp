/// \file
/// The C interface: solvers that several ranks share, and matrices in parts.
#include "espalier/ranks.h"

#include <complex>
#include <cstddef>
#include <cstdint>
#include <limits>
#include <span>
#include <string>
#include <vector>

#include "c/handle.hpp"
#include "c/results.hpp"
#include "espalier/nodes.hpp"

namespace espalier::solver {

namespace {

/// A part in our own types, from 0 on.
struct OwnRows {
  Index n = 0, first_row = 0;
  std::vector<Offset> pointers;
  std::vector<Index> indices;
  const double* values = nullptr;  // of complex numbers the parts
  Storage storage = Storage::general;
  bool complex = false;

  [[nodiscard]] LocalRows view() const { return {n, first_row, pointers, indices, values_as(values), storage}; }
  [[nodiscard]] ComplexLocalRows complex_view() const {
    return {n, first_row, pointers, indices, values_as(reinterpret_cast<const std::complex<double>*>(values)), storage};
  }

 private:
  template <class Value>
  [[nodiscard]] std::span<const Value> values_as(const Value* first) const {
    return {first, values == nullptr ? 0 : indices.size()};
  }
};

constexpr std::int64_t kMostRows = std::numeric_limits<Index>::max();

// A column that the matrix does not have becomes one that the solver refuses.
template <class Local>
OwnRows own_rows(const Local& part) {
  require(part.size >= offsetof(Local, numbers), "size is not that of the struct");
  const std::int64_t numbers = part.size >= sizeof(Local) ? part.numbers : std::int64_t{ESPALIER_REAL};
  require(numbers == ESPALIER_REAL || numbers == ESPALIER_COMPLEX, "numbers is none of espalier_numbers");
  require(part.index_base == 0 || part.index_base == 1, "index_base must be 0 or 1");
  require(part.storage >= ESPALIER_GENERAL && part.storage <= ESPALIER_HERMITIAN_BOTH, "an unknown storage");
  require(numbers == ESPALIER_COMPLEX || part.storage < ESPALIER_HERMITIAN_LOWER, "only a complex matrix is Hermitian");
  require(part.n >= 0 && part.n <= kMostRows && part.rows >= 0 && part.rows <= part.n, "rows out of range");
  require(part.rows == 0 || part.pointers != nullptr, "the pointers are null");
  OwnRows own;
  own.n = static_cast<Index>(part.n);
  own.storage = static_cast<Storage>(part.storage);
  own.complex = numbers == ESPALIER_COMPLEX;
  if (part.rows == 0) return own;
  require(part.first_row >= part.index_base && part.first_row - part.index_base <= part.n - part.rows,
          "first_row out of range");
  own.first_row = static_cast<Index>(part.first_row - part.index_base);
  require(part.pointers[0] == part.index_base, "the pointers do not begin with index_base");
  for (std::int64_t r = 0; r <= part.rows; ++r) {  // up to the first one that cannot be
    own.pointers.push_back(static_cast<Offset>(part.pointers[r]) - part.index_base);
    require(r == 0 || part.pointers[r] >= part.pointers[r - 1], "the pointers fall");
  }
  const auto count = static_cast<std::size_t>(own.pointers.back());
  require(count == 0 || part.indices != nullptr, "the indices are null");
  for (std::size_t k = 0; k < count; ++k) {
    const std::int64_t col = static_cast<std::int64_t>(part.indices[k]) - part.index_base;
    own.indices.push_back(col < 0 || col > kMostRows ? -1 : static_cast<Index>(col));
  }
  own.values = part.values;
  return own;
}

// Analysis of a part by `analyze(solver, view)`, after `check()` of other arguments.
template <class Local, class Check, class Analyze>
int analyze_by(espalier_solver* solver, const Local* part, espalier_analysis_info* info, const Check& check,
               const Analyze& analyze) {
  return guarded(solver, [&](espalier_solver& s) {
    if (s.ranks.size() > 1) s.solver.reset(), s.complex_solver.reset();  // as on the other ranks, should it fail here
    const OwnRows own = heard_by_all(s, [&] {
      check();
      require(part != nullptr, "the part is null");
      OwnRows rows = own_rows(*part);
      if (rows.complex)
        (void)make_complex_solver(s);
      else
        (void)make_solver(s);
      return rows;
    });
    const AnalysisResult result =
        own.complex ? analyze(*s.complex_solver, own.complex_view()) : analyze(*s.solver, own.view());
    s.rows = own.n;
    s.nonzeros = static_cast<Offset>(own.indices.size());
    s.transposed = s.conjugated = s.by_rows = false;
    s.null_space = {};
    s.vector_rows = result.status.ok() ? with_analyzed(s, [](auto& cpp) { return cpp.rows().count; }) : 0;
    hand_out(result, info);
    return result.status;
  });
}

template <class Local>
int analyze_rows(espalier_solver* solver, const Local* part, espalier_analysis_info* info) {
  return analyze_by(
      solver, part, info, [] {}, [](auto& cpp, const auto& view) { return cpp.analyze(view); });
}

template <class Local>
int load_rows(espalier_solver* solver, const char* path, const Local* part, espalier_analysis_info* info) {
  return analyze_by(
      solver, part, info, [&] { require(path != nullptr, "the path is null"); },
      [&](auto& cpp, const auto& view) { return cpp.load_analysis(path, view); });
}

}  // namespace

}  // namespace espalier::solver

extern "C" {

int espalier_use_ranks(espalier_solver* solver, const espalier_rank_functions* functions, double patience) {
  return espalier::solver::guarded(solver, [&](espalier_solver& s) {
    espalier::solver::require(functions != nullptr, "the table of functions is null");
    espalier::solver::require(functions->size >= sizeof(espalier_rank_functions), "size is not that of the struct");
    s.solver.reset();
    s.complex_solver.reset();
    s.ranks = espalier::Ranks(*functions, patience == 0 ? espalier::Ranks::kPatience : patience);
    return espalier::Status{};
  });
}

int espalier_set_nodes(espalier_solver* solver, int each_process) {
  return espalier::solver::guarded(solver, [&](espalier_solver& s) {
    espalier::solver::require(s.ranks.link() != nullptr, "call espalier_use_ranks first");
    espalier::solver::require(!s.solver && !s.complex_solver,
                              "the ranks have a solver already: call it before the first analysis");
    espalier::solver::require(each_process == 0 || each_process == 1, "each_process must be 0 or 1");
    espalier::set_nodes(s.ranks, each_process == 1 ? espalier::Nodes::process : espalier::Nodes::host);
    return espalier::Status{};
  });
}

int espalier_analyze_rows_i32(espalier_solver* solver, const espalier_local_rows_i32* part,
                              espalier_analysis_info* info) {
  return espalier::solver::analyze_rows(solver, part, info);
}

int espalier_analyze_rows_i64(espalier_solver* solver, const espalier_local_rows_i64* part,
                              espalier_analysis_info* info) {
  return espalier::solver::analyze_rows(solver, part, info);
}

int espalier_load_analysis_rows_i32(espalier_solver* solver, const char* path, const espalier_local_rows_i32* part,
                                    espalier_analysis_info* info) {
  return espalier::solver::load_rows(solver, path, part, info);
}

int espalier_load_analysis_rows_i64(espalier_solver* solver, const char* path, const espalier_local_rows_i64* part,
                                    espalier_analysis_info* info) {
  return espalier::solver::load_rows(solver, path, part, info);
}

int espalier_set_rows(espalier_solver* solver, int64_t first, int64_t count) {
  return espalier::solver::guarded(solver, [&](espalier_solver& s) {
    espalier::solver::with_analyzed(s, [&](auto& cpp) {
      espalier::solver::require(first >= 0 && count >= 0 && first <= s.rows && count <= s.rows - first,
                                "rows that the matrix does not have");
      cpp.set_rows({static_cast<espalier::Index>(first), static_cast<espalier::Index>(count)});
    });
    s.vector_rows = static_cast<espalier::Index>(count);
    return espalier::Status{};
  });
}

}  // extern "C"
