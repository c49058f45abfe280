/// \file
/// A GPU for bodies, K and the vectors of an integrator that is none: its memory is the host's, and what is written
/// there is never read as the host's by mistake, as both have their own arrays. For tests on machines without one.
#pragma once

#include <algorithm>
#include <cmath>
#include <memory>
#include <numeric>
#include <optional>
#include <utility>
#include <vector>

#include "base/at.hpp"
#include "dynamics/bodies/flexible_body.hpp"
#include "dynamics/dae/assembled_system.hpp"
#include "dynamics/dae/linear_solver.hpp"
#include "dynamics/device/device_assembly.hpp"
#include "dynamics/device/divided_body.hpp"

namespace espalier::dynamics::test {

/// Unknowns dealt to GPUs in pieces, so that bodies have many borders between parts.
inline GpuPlaces dealt(std::vector<int> gpus, Index unknowns) {
  constexpr Index kPiece = 150;
  GpuPlaces places{std::move(gpus), {}};
  for (Index i = 0; i < unknowns; ++i)
    places.of_unknown.push_back((i / kPiece) % static_cast<Index>(places.gpus.size()));
  return places;
}

/// Espalier's solver on the host, which says that its memory is that of GPU 0.
class EmulatedSolver final : public LinearSolver {
 public:
  explicit EmulatedSolver(Index unknowns, int gpus = 1)
      : solver_(make_espalier_solver(newton_options(unknowns))), gpus_(gpus), unknowns_(unknowns) {}
  Status analyze(const MatrixView& a) override {
    size_ = static_cast<std::size_t>(a.cols);
    return solver_->analyze(a);
  }
  Status factorize(std::span<const double> values) override { return solver_->factorize(values); }
  [[nodiscard]] int gpu() const override { return lost ? -1 : 0; }
  [[nodiscard]] GpuPlaces gpu_places() const override {
    std::vector<int> numbers(static_cast<std::size_t>(gpus_));
    std::iota(numbers.begin(), numbers.end(), 0);
    return dealt(numbers, unknowns_);
  }
  Status factorize_device(const double* values, Offset count, void*) override {
    if (left_ >= 0 && left_-- == 0) {
      lost = true;
      return {StatusCode::device_error, "the emulated GPU has failed", -1};
    }
    return solver_->factorize({values, static_cast<std::size_t>(count)});
  }
  Status solve_device(double* b, Index columns, void*) override {
    const Span x(b, size_ * static_cast<std::size_t>(columns));
    return solver_->solve(x, x, columns);
  }
  [[nodiscard]] FactorWork work() const override { return solver_->work(); }
  Status solve(std::span<const double> b, std::span<double> x, Index columns) override {
    return solver_->solve(b, x, columns);
  }
  /// The GPU fails in the factorization after so many.
  void fail_after(int factorizations) { left_ = factorizations; }
  bool lost = false;

 private:
  std::unique_ptr<LinearSolver> solver_;
  int gpus_;
  Index unknowns_;
  std::size_t size_ = 0;
  int left_ = -1;
};

/// A body, or a part of it, is another body of the same model. What a part does not have is NaN: who uses it shows.
class EmulatedBody final : public DeviceBody {
 public:
  /// All of it.
  EmulatedBody(AssembledSystem& twin, FlexibleBody& body)
      : twin_(twin), body_(body), ptr_(body.assembly().pattern().ptr), entries_(at(ptr_.back())) {
    vertices_.resize(at(body.vertices()));
    std::iota(vertices_.begin(), vertices_.end(), 0);
    std::iota(entries_.begin(), entries_.end(), 0);
    own_ = vertices_;
  }
  EmulatedBody(AssembledSystem& twin, FlexibleBody& body, const BodySubdomain& part)
      : twin_(twin),
        body_(body),
        vertices_(part.vertices),
        own_(part.own),
        ptr_(part.pattern.ptr),
        entries_(part.entries) {}
  void bind(std::span<const Offset> column_start, std::span<const std::int32_t> shift) override {
    column_start_.assign(column_start.begin(), column_start.end());
    shift_.assign(shift.begin(), shift.end());
  }
  void start_forces(const BodyState& state) override {
    take(state);
    std::vector<double> f(v_.size());
    body_.residual(view(), f);
    f_.assign(3 * vertices_.size(), std::nan(""));
    for (const Index c : own_) std::copy_n(f.begin() + body_.coordinate(vertices_[at(c)]), 3, f_.begin() + 3 * c);
  }
  Offset finish_forces(double, const double*, double* f) override {
    for (std::size_t k = 0; k < f_.size(); ++k) f[k] += f_[k];
    return -1;
  }
  void put_forces(double, double* f) override { std::copy(f_.begin(), f_.end(), f); }
  void start_tangent(const BodyState& state, const TangentWeights& weights, double* values) override {
    take(state);
    const SparsePattern& w = twin_.tangent_pattern();
    std::vector<double> tangent(at(w.nonzeros()));
    body_.tangent(view(), weights, tangent);
    for (const Index c : own_)
      for (Offset e = ptr_[at(c)]; e < ptr_[at(c) + 1]; ++e)
        for (Offset j = 0; j < 3; ++j) {
          const Index row = body_.coordinate(body_.assembly().pattern().ind[at(entries_[at(e)])]);
          const auto column = at(body_.coordinate(vertices_[at(c)]) + j);
          const auto end = w.ind.begin() + w.ptr[column + 1];
          const auto from = std::lower_bound(w.ind.begin() + w.ptr[column], end, row) - w.ind.begin();
          for (Offset i = 0; i < 3; ++i)
            values[column_start_[at(3 * c + j)] + shift_[at(3 * e + j)] + i] += tangent[at(from + i)];
        }
  }
  Offset finish() override { return -1; }

 private:
  [[nodiscard]] StateView view() const { return {0, q_, v_, a_, {}}; }
  void take(const BodyState& state) {
    const Sizes sizes = twin_.sizes();
    const auto taken = [&](const double* from, Index size, Index first) {
      std::vector<double> all(at(size), from == nullptr ? 0.0 : std::nan(""));
      for (std::size_t c = 0; c < vertices_.size() && from != nullptr; ++c)
        std::copy_n(from + 3 * c, 3, all.begin() + first + 3 * vertices_[c]);
      return all;
    };
    q_ = taken(state.q, sizes.configuration, body_.placement().q);
    v_ = taken(state.v, sizes.velocity, body_.placement().v);
    a_ = taken(state.a, sizes.velocity, body_.placement().v);
  }

  AssembledSystem& twin_;
  FlexibleBody& body_;
  std::vector<Index> vertices_, own_;  // see BodySubdomain
  std::vector<Offset> ptr_, entries_;  // likewise
  std::vector<Offset> column_start_;
  std::vector<std::int32_t> shift_;
  std::vector<double> q_, v_, a_, f_;
};

class EmulatedCarrier final : public PartCarrier {
 public:
  explicit EmulatedCarrier(const BodySubdomain& part)
      : vertices_(part.vertices), own_(part.own), forces_(3 * part.vertices.size()) {}
  BodyState bring(const BodyState& body) override {
    const auto brought = [&](const double* from, std::vector<double>& to) -> const double* {
      if (from == nullptr) return nullptr;
      to.clear();
      for (const Index v : vertices_) to.insert(to.end(), from + 3 * v, from + 3 * v + 3);
      return to.data();
    };
    return {brought(body.q, q_), brought(body.v, v_), brought(body.a, a_), true};
  }
  [[nodiscard]] double* forces() override { return forces_.data(); }
  void take_forces(double* f) override {
    for (const Index c : own_) std::copy_n(forces_.begin() + 3 * c, 3, f + 3 * vertices_[at(c)]);
  }
  void bind(std::span<const Offset> positions) override {
    positions_.assign(positions.begin(), positions.end());
    values_.resize(3 * positions.size());
  }
  [[nodiscard]] double* values(double* k) override {
    if (positions_.empty()) return k;
    std::fill(values_.begin(), values_.end(), 0.0);
    return values_.data();
  }
  void take_values(double* k) override {
    for (std::size_t p = 0; p < positions_.size(); ++p)
      for (std::size_t i = 0; i < 3; ++i) k[at(positions_[p]) + i] += values_[3 * p + i];
  }
  void finish() override {}

 private:
  std::vector<Index> vertices_, own_;
  std::vector<Offset> positions_;
  std::vector<double> q_, v_, a_, forces_, values_;
};

class EmulatedVectors final : public DeviceVectors {
 public:
  explicit EmulatedVectors(const std::vector<double>& scale) : scale_(scale) {}
  void solve(Span b, const Solve& solve) override { solve_columns(b.data(), b.size() / scale_.size(), solve); }
  void solve_there(double* b, const Solve& solve) override { solve_columns(b, 1, solve); }
  [[nodiscard]] const double* scale() const override { return scale_.data(); }
  void put_lower(ConstSpan r, double* b) override {
    std::fill_n(b, scale_.size() - r.size(), 0.0);
    std::copy(r.begin(), r.end(), b + scale_.size() - r.size());
  }
  void make_columns(std::span<const Index> rows, const Solve& solve) override {
    columns_.assign(rows.size() * scale_.size(), 0.0);
    for (std::size_t c = 0; c < rows.size(); ++c) columns_[c * scale_.size() + static_cast<std::size_t>(rows[c])] = 1;
    solve_columns(columns_.data(), rows.size(), solve);
  }
  void combine_columns(ConstSpan factors, Span x) override { combine_columns_there(factors, x.data()); }
  void combine_columns_there(ConstSpan factors, double* x) override {
    for (std::size_t i = 0; i < scale_.size(); ++i) {
      x[i] = 0;
      for (std::size_t c = 0; c < factors.size(); ++c) x[i] += factors[c] * columns_[c * scale_.size() + i];
    }
  }
  void fetch_columns(Span to) override { std::copy(columns_.begin(), columns_.end(), to.begin()); }
  [[nodiscard]] void* stream() const override { return nullptr; }

 private:
  void solve_columns(double* b, std::size_t count, const Solve& solve) {
    const auto scale = [&] {
      for (std::size_t k = 0; k < count * scale_.size(); ++k) b[k] *= scale_[k % scale_.size()];
    };
    scale();
    for (std::size_t first = 0; first < count; first += kMostColumns)
      solve(b + first * scale_.size(),
            static_cast<Index>(std::min(count - first, static_cast<std::size_t>(kMostColumns))));
    scale();
  }

  const std::vector<double>& scale_;
  std::vector<double> columns_;
};

class EmulatedMatrix final : public DeviceMatrix {
 public:
  explicit EmulatedMatrix(const DeviceMatrixLayout& layout)
      : w_(*layout.w),
        k_ptr_(layout.k_ptr.begin(), layout.k_ptr.end()),
        w_of_host_(layout.w_of_host.begin(), layout.w_of_host.end()),
        rest_(layout.rest.begin(), layout.rest.end()),
        values_(static_cast<std::size_t>(k_ptr_.back())),
        scale_(k_ptr_.size() - 1) {}
  double* clear() override {
    std::fill(values_.begin(), values_.end(), 0.0);
    return values_.data();
  }
  void add_from_host(const Fill& fill) override {
    std::vector<double> part(w_of_host_.size());
    fill(0, static_cast<Offset>(part.size()), part.data());
    for (std::size_t e = 0; e < part.size(); ++e) values_[static_cast<std::size_t>(w_of_host_[e])] += part[e];
  }
  void column_sizes(Span diagonal, Span largest) override {
    std::fill(diagonal.begin(), diagonal.end(), 0.0);
    std::fill(largest.begin(), largest.end(), 0.0);
    for_each_of_w([&](std::size_t i, std::size_t j, double& value, std::size_t) {
      largest[j] = std::max(largest[j], std::abs(value));
      if (i == j) diagonal[j] = std::abs(value);
    });
  }
  const double* complete(ConstSpan scale, ConstSpan rest) override {
    std::copy(scale.begin(), scale.end(), scale_.begin());
    for_each_of_w(
        [&](std::size_t i, std::size_t j, double& value, std::size_t) { value = value * scale_[i] * scale_[j]; });
    for (std::size_t e = 0; e < rest.size(); ++e) values_[static_cast<std::size_t>(rest_[e])] = rest[e];
    return values_.data();
  }
  void set_scale(ConstSpan scale) override { std::copy(scale.begin(), scale.end(), scale_.begin()); }
  void fetch_w(Span values) const override {
    for_each_of_w([&](std::size_t i, std::size_t j, const double& value, std::size_t p) {
      values[p] = value / scale_[j] / scale_[i];
    });
  }
  void sum_rows(ConstSpan x, Span out) const override {
    std::fill(out.begin(), out.end(), 0.0);
    for_each_of_w([&](std::size_t i, std::size_t j, const double& value, std::size_t) {
      out[i] += std::abs(value / scale_[j] / scale_[i]) * x[j];
    });
  }
  [[nodiscard]] void* stream() const override { return nullptr; }
  std::unique_ptr<DeviceVectors> make_vectors() override { return std::make_unique<EmulatedVectors>(scale_); }

 private:
  template <class Body>
  void for_each_of_w(const Body& body) const {
    for (std::size_t j = 0; j + 1 < w_.ptr.size(); ++j)
      for (Offset p = w_.ptr[j]; p < w_.ptr[j + 1]; ++p)
        body(static_cast<std::size_t>(w_.ind[static_cast<std::size_t>(p)]), j,
             values_[static_cast<std::size_t>(k_ptr_[j] + p - w_.ptr[j])], static_cast<std::size_t>(p));
  }

  const SparsePattern& w_;
  std::vector<Offset> k_ptr_, w_of_host_, rest_;
  mutable std::vector<double> values_;
  std::vector<double> scale_;
};

/// Numbers that no body owns are NaN, but for right-hand sides: who uses them shows.
class EmulatedMotion final : public DeviceMotion {
 public:
  EmulatedMotion(const Sizes& sizes, const MotionDemand& demand, const DeviceShare& share)
      : share_(share), points_(demand.points) {
    const auto n = static_cast<std::size_t>(sizes.velocity), m = static_cast<std::size_t>(sizes.constraints);
    for (const MotionVector vector : demand.vectors) arrays_.*vector = made(n);
    for (const MotionVector vector : demand.right_sides) arrays_.*vector = made(n + m);
    for (int j = 0; j < points_; ++j)
      for (auto* past : {&arrays_.past_q, &arrays_.past_v, &arrays_.past_theta}) (*past)[j] = made(n);
    right_side_ = share.own;
    for (std::size_t i = n; i < n + m; ++i) right_side_.push_back(static_cast<Index>(i));
  }
  [[nodiscard]] const MotionArrays& arrays() const override { return arrays_; }
  void use_scale(const double* scale) override { arrays_.scale = scale; }
  void turn_past() override {
    for (auto* past : {&arrays_.past_q, &arrays_.past_v, &arrays_.past_theta})
      std::rotate(*past, *past + points_ - 1, *past + points_);
  }
  void run(const MotionLoop& loop) override {
    std::visit([&](const auto& of_kind) { for_each([&](std::size_t i) { of_kind(arrays_, i); }); }, loop);
  }
  [[nodiscard]] MotionRecord measure(const MotionMeasure& what) override {
    MotionRecord record{};
    for_each([&](std::size_t i) { what.add(arrays_, i, record); });
    return record;
  }
  void send(ConstSpan from, double* to) override { std::copy(from.begin(), from.end(), to); }
  void fetch(const double* from, Span to) override { std::copy_n(from, to.size(), to.begin()); }
  [[nodiscard]] ConstSpan gather(List list, std::span<const double* const> from) override {
    looked_.clear();
    for (const double* x : from)
      for (const Index i : of(list)) looked_.push_back(x[i]);
    return looked_;
  }
  void set(List list, ConstSpan values, double* to) override {
    for (std::size_t k = 0; k < values.size(); ++k) to[of(list)[k]] = values[k];
  }
  void add(List list, ConstSpan values, double* to) override {
    for (std::size_t k = 0; k < values.size(); ++k) to[of(list)[k]] += values[k];
  }

 private:
  double* made(std::size_t size) { return memory_.emplace_back(size, std::nan("")).data(); }
  [[nodiscard]] const std::vector<Index>& of(List list) const { return list == List::seen ? share_.seen : right_side_; }
  template <class Body>
  void for_each(const Body& body) const {
    for (const DeviceShare::Range& r : share_.ranges)
      for (Index k = 0; k < r.count; ++k) body(static_cast<std::size_t>(r.v + k));
  }

  DeviceShare share_;
  int points_;
  MotionArrays arrays_;
  std::vector<std::vector<double>> memory_;
  std::vector<Index> right_side_;
  std::vector<double> looked_;
};

/// Its bodies are those of `twin`, the same system once more.
class EmulatedAssembly final : public DeviceAssembly {
 public:
  EmulatedAssembly(AssembledSystem& twin, GpuPlaces places) : twin_(twin), places_(std::move(places)) {
    divide_from(0);
    for (const auto& c : twin.components())
      if (auto* body = dynamic_cast<FlexibleBody*>(c.get()); body != nullptr && body->fits_device())
        bodies_.push_back(body);
  }
  std::unique_ptr<DeviceBody> make_body(const DeviceBodyTables& tables) override {
    FlexibleBody& body = *bodies_.at(next_++);
    auto divided = make_divided_body(tables, places_, fewest_, nullptr, [&](const BodySubdomain& part) {
      return SubdomainOnGpu{std::make_unique<EmulatedBody>(twin_, body, part), std::make_unique<EmulatedCarrier>(part),
                            part.place == 0};
    });
    if (divided != nullptr) return divided;
    return std::make_unique<EmulatedBody>(twin_, body);
  }
  std::unique_ptr<DeviceMatrix> make_matrix(const DeviceMatrixLayout& layout) override {
    return std::make_unique<EmulatedMatrix>(layout);
  }
  std::unique_ptr<DeviceMotion> make_motion(const Sizes& sizes, const MotionDemand& demand,
                                            const DeviceShare& share) override {
    return std::make_unique<EmulatedMotion>(sizes, demand, share);
  }

 private:
  AssembledSystem& twin_;
  GpuPlaces places_;
  std::vector<FlexibleBody*> bodies_;
  std::size_t next_ = 0;
};

}  // namespace espalier::dynamics::test
