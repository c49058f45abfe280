// The public class: what the caller may do in which order. The numbers are made by Condensation.
#include <fmt/format.h>

#include <stdexcept>
#include <utility>

#include "espalier/schur.hpp"
#include "schur/condensation.hpp"

namespace espalier {

struct SchurComplement::Impl : schur::Condensation {
  using Condensation::Condensation;

  // So many right-hand sides of n (or of the list's size) values.
  static void check(const char* call, const char* name, std::size_t have, Index rows, Index columns) {
    if (columns < 1)
      throw std::invalid_argument(fmt::format("SchurComplement::{}: {} right-hand sides", call, columns));
    if (const std::size_t need = at(rows) * at(columns); have != need)
      throw std::invalid_argument(
          fmt::format("SchurComplement::{}: {} right-hand sides of {} values need {}; {} has {}", call, columns, rows,
                      need, name, have));
  }
  void expect_factorized(const char* call) const {
    if (!factorized()) throw std::logic_error(fmt::format("SchurComplement::{}: there is no factorization", call));
  }
};

SchurComplement::SchurComplement(Options options) : impl_(std::make_unique<Impl>(std::move(options))) {}
SchurComplement::~SchurComplement() = default;
SchurComplement::SchurComplement(SchurComplement&&) noexcept = default;
SchurComplement& SchurComplement::operator=(SchurComplement&&) noexcept = default;

AnalysisResult SchurComplement::analyze(const MatrixView& a, std::span<const Index> unknowns) {
  return impl_->analyze(a, unknowns);
}

SchurResult SchurComplement::factorize(std::span<const double> values) {
  if (!impl_->analyzed()) throw std::logic_error("SchurComplement::factorize: call analyze() first");
  if (static_cast<Offset>(values.size()) != impl_->nonzeros())
    throw std::invalid_argument(fmt::format("SchurComplement::factorize: {} values for a pattern of {} entries",
                                            values.size(), impl_->nonzeros()));
  return impl_->factorize(values);
}

Index SchurComplement::size() const { return static_cast<Index>(unknowns().size()); }
const std::vector<Index>& SchurComplement::unknowns() const { return impl_->unknowns(); }
const AnalysisResult& SchurComplement::analysis() const { return impl_->analysis(); }
bool SchurComplement::factorized() const { return impl_->factorized(); }

std::span<const double> SchurComplement::complement() const {
  impl_->expect_factorized("complement");
  return impl_->complement();
}

SolveResult SchurComplement::condense(std::span<const double> b, std::span<double> g, Index columns,
                                      Transpose transpose) {
  impl_->expect_factorized("condense");
  Impl::check("condense", "b", b.size(), impl_->n(), columns);
  Impl::check("condense", "g", g.size(), size(), columns);
  return impl_->condense({b.data(), nullptr, nullptr, g.data(), columns, transpose != Transpose::no});
}

SolveResult SchurComplement::expand(std::span<const double> b, std::span<const double> xs, std::span<double> x,
                                    Index columns, Transpose transpose) {
  impl_->expect_factorized("expand");
  Impl::check("expand", "b", b.size(), impl_->n(), columns);
  Impl::check("expand", "xs", xs.size(), size(), columns);
  Impl::check("expand", "x", x.size(), impl_->n(), columns);
  return impl_->expand({b.data(), xs.data(), x.data(), nullptr, columns, transpose != Transpose::no});
}

SolveResult SchurComplement::solve(std::span<const double> b, std::span<double> x, Index columns, Transpose transpose) {
  impl_->expect_factorized("solve");
  Impl::check("solve", "b", b.size(), impl_->n(), columns);
  Impl::check("solve", "x", x.size(), impl_->n(), columns);
  return impl_->solve({b.data(), nullptr, x.data(), nullptr, columns, transpose != Transpose::no});
}

SchurInertia SchurComplement::inertia() {
  impl_->expect_factorized("inertia");
  return impl_->inertia();
}

}  // namespace espalier
