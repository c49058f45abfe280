/// \file
/// A GPU for each rank that is none: it works as the host does, its memory is the host's, and the linear system there
/// has arrays of its own. For what the solver does with devices of ranks, on machines without GPUs. Each rank makes the
/// whole factor.
#pragma once

#include <algorithm>
#include <atomic>
#include <cmath>
#include <limits>
#include <memory>
#include <optional>
#include <span>
#include <stdexcept>
#include <string>
#include <utility>
#include <vector>

#include "device/registry.hpp"
#include "ranks/communicator.hpp"
#include "solve/residual.hpp"

namespace espalier::ranks {

/// What calls have done, of one rank. Several threads may have a system on its device.
struct EmulatedWork {
  std::atomic<int> sent{0};                      ///< ranges of values from the host
  std::atomic<int> copied{0};                    ///< ranges of values from the device
  std::atomic<const void*> waited_for{nullptr};  ///< the last queue
};

class EmulatedSystem final : public device::DeviceLinearSystem {
 public:
  EmulatedSystem(const device::LinearSystemArrays& a, device::Executor<double>& executor, const device::PivotRule& rule,
                 Communicator* link, base::ThreadPool& pool, EmulatedWork& work)
      : executor_(executor),
        rule_(rule),
        link_(link),
        work_(work),
        numbers_(a.real_columns.empty() ? base::Numbers::real
                 : a.hermitian          ? base::Numbers::hermitian
                                        : base::Numbers::complex),
        pattern_{a.pattern.rows,
                 a.pattern.cols,
                 {a.pattern.col_ptr.begin(), a.pattern.col_ptr.end()},
                 {a.pattern.row_ind.begin(), a.pattern.row_ind.end()},
                 std::vector<double>(parts() * a.pattern.row_ind.size(), std::numeric_limits<double>::quiet_NaN()),
                 a.pattern.storage},
        real_columns_(a.real_columns.begin(), a.real_columns.end()),
        order_(a.order.begin(), a.order.end()),
        row_of_col_(a.row_of_col.begin(), a.row_of_col.end()),
        row_scale_(a.row_scale.begin(), a.row_scale.end()),
        col_scale_(a.col_scale.begin(), a.col_scale.end()),
        host_values_(a.values),
        residual_(pattern_.view(), solve::ResidualOperator::rows_of(pattern_.view(), pool), pool, numbers_) {}

  [[nodiscard]] int number() const override { return 0; }
  void take_values(const double* values) override {
    std::copy_n(values, pattern_.values.size(), pattern_.values.begin());
  }
  void send_values(Offset first, Offset count) override {
    ++work_.sent;
    std::copy_n(host_values_.data() + first, count, pattern_.values.data() + first);
  }
  [[nodiscard]] bool on_ranks() const override { return link_ != nullptr; }
  void copy_values(const double* from, Offset first, Offset count) override {
    ++work_.copied;
    std::copy_n(from, count, pattern_.values.data() + first);
  }
  void share_values(Offset first, Offset count) override {
    const std::int64_t at = first;
    const auto firsts = link_->all_numbers(at);
    const auto parts =
        link_->all_gather_of(std::span<const double>(pattern_.values.data() + first, static_cast<std::size_t>(count)));
    for (std::size_t r = 0; r < parts.size(); ++r)
      std::copy(parts[r].begin(), parts[r].end(), pattern_.values.begin() + firsts[r]);
  }
  std::optional<device::FactorOutcome> factorize(double smallest_pivot) override {
    std::vector<double> scaled(pattern_.values);
    double largest = 0;
    for (Index c = 0; c < pattern_.cols; ++c)
      for (std::size_t q = begin_of(c); q < begin_of(c + 1); ++q) {
        double* number = scaled.data() + parts() * q;
        for (std::size_t part = 0; part < parts(); ++part) {
          number[part] *= scale(row_scale_, pattern_.row_ind[q]) * scale(col_scale_, c);
          if (!std::isfinite(number[part])) return std::nullopt;
        }
        largest = std::max(largest, parts() == 1 ? std::abs(number[0]) : std::hypot(number[0], number[1]));
      }
    rule_.tiny = smallest_pivot * largest;
    rule_.largest = largest;
    executor_.set_pivot_rule(rule_);
    residual_.set_values(pattern_.values);
    return executor_.factorize(parts() == 1 ? scaled : real_form_of(scaled));
  }
  void read_values(std::span<double> to) const override {
    std::copy(pattern_.values.begin(), pattern_.values.end(), to.begin());
  }

  void substitute(const double* b, double* x, Index columns, bool transpose) override {
    const std::size_t n = order_.size();
    std::vector<double> rhs(n);
    for (std::size_t c = 0; c < static_cast<std::size_t>(columns); ++c) {
      for (std::size_t k = 0; k < n; ++k) {
        const Place at = place_of(order_[k], !transpose);
        const double value = scale(transpose ? col_scale_ : row_scale_, at.row) * b[c * n + at.number];
        rhs[k] = at.conjugates && numbers_ == base::Numbers::complex ? -value : value;
      }
      executor_.solve(rhs.data(), 1, transpose);
      for (std::size_t k = 0; k < n; ++k) {
        const Place at = place_of(order_[k], transpose);
        x[c * n + at.number] = scale(transpose ? row_scale_ : col_scale_, at.row) * rhs[k];
      }
    }
  }
  // Batches alone ask for parts, and no batch is shared by ranks.
  void compute_parts(const device::ResidualColumns&, std::span<device::BackwardError>, bool) const override {
    throw std::logic_error("no parts here");
  }
  void copy_parts(const double*, double*, Index, std::span<const char>) const override {
    throw std::logic_error("no parts here");
  }
  std::shared_ptr<double[]> host_memory(Offset count) override {
    return std::shared_ptr<double[]>(new double[static_cast<std::size_t>(count)]);
  }
  double take_substitution_seconds() override { return -1; }
  void finish() override {}
  void settle() noexcept override {}
  double* right_hand_sides(Index columns) override { return grown(right_hand_sides_, columns); }
  double* solutions(Index columns) override { return grown(solutions_, columns); }
  void expect_reachable(const double* array, const char* what) const override {
    if (array == nullptr) throw std::invalid_argument(std::string(what) + " are not in the memory of a GPU");
  }
  void wait_for(void* queue) override { work_.waited_for = queue; }
  void copy_vectors(const double* from, double* to, Offset count) override { std::copy_n(from, count, to); }
  void send(double* to, const double* from, Offset count) override { std::copy_n(from, count, to); }
  void fetch(double* to, const double* from, Offset count) override { std::copy_n(from, count, to); }

  [[nodiscard]] Index size() const override { return residual_.size(); }
  void compute(std::span<device::ResidualColumn> columns, bool transpose) const override {
    residual_.compute(columns, transpose);
  }
  void copy(const double* from, double* to) const override { residual_.copy(from, to); }
  bool add(const double* from, double* to) const override { return residual_.add(from, to); }
  void multiply(const double* x, double* y, bool transpose) const override { residual_.multiply(x, y, transpose); }
  void combine(double a, const double* x, double b, double* y) const override { residual_.combine(a, x, b, y); }
  [[nodiscard]] double dot(const double* a, const double* b) const override { return residual_.dot(a, b); }
  [[nodiscard]] Vectors vectors(Index slot, Index columns) const override { return residual_.vectors(slot, columns); }

 private:
  static double scale(const std::vector<double>& list, Index k) {
    return list.empty() ? 1.0 : list[static_cast<std::size_t>(k)];
  }
  [[nodiscard]] Index row_of(Index col) const {
    return row_of_col_.empty() ? col : row_of_col_[static_cast<std::size_t>(col)];
  }
  [[nodiscard]] std::size_t parts() const { return static_cast<std::size_t>(base::parts_of(numbers_)); }
  [[nodiscard]] std::size_t begin_of(Index c) const {
    return static_cast<std::size_t>(pattern_.col_ptr[static_cast<std::size_t>(c)]);
  }

  // Where an unknown of the factor stands in vectors of the system.
  struct Place {
    Index row;
    std::size_t number;
    bool conjugates;  // an imaginary part
  };
  [[nodiscard]] Place place_of(Index unknown, bool matched) const {
    const auto each = static_cast<Index>(parts());
    const Index col = unknown / each, part = unknown % each, row = matched ? row_of(col) : col;
    return {row, parts() * static_cast<std::size_t>(row) + static_cast<std::size_t>(part), part == 1};
  }

  // The blocks of each number, column after column; of a diagonal entry those of the triangle that is stored.
  [[nodiscard]] std::vector<double> real_form_of(const std::vector<double>& numbers) const {
    std::vector<double> real(static_cast<std::size_t>(real_columns_.back()));
    const double sign = numbers_ == base::Numbers::hermitian ? 1 : -1;
    for (Index c = 0; c < pattern_.cols; ++c) {
      Offset next[2] = {real_columns_[2 * static_cast<std::size_t>(c)],
                        real_columns_[2 * static_cast<std::size_t>(c) + 1]};
      for (std::size_t q = begin_of(c); q < begin_of(c + 1); ++q) {
        const double re = numbers[2 * q], im = numbers[2 * q + 1];
        const double block[2][2] = {{re, -im}, {sign * im, sign * re}};
        const bool diagonal = pattern_.row_ind[q] == c;
        for (int row = 0; row < 2; ++row)
          for (int col = 0; col < 2; ++col) {
            if (diagonal && row < col && pattern_.storage == Storage::symmetric_lower) continue;
            if (diagonal && row > col && pattern_.storage == Storage::symmetric_upper) continue;
            real[static_cast<std::size_t>(next[col]++)] = block[row][col];
          }
      }
    }
    return real;
  }

  double* grown(std::vector<double>& array, Index columns) const {
    array.resize(std::max(array.size(), order_.size() * static_cast<std::size_t>(columns)));
    return array.data();
  }

  device::Executor<double>& executor_;
  device::PivotRule rule_;
  Communicator* link_;
  EmulatedWork& work_;
  base::Numbers numbers_;
  SparseMatrix pattern_;              // with the values there, of complex ones the parts
  std::vector<Offset> real_columns_;  // complex: of the factor's columns
  std::vector<Index> order_, row_of_col_;
  std::vector<double> row_scale_, col_scale_;
  std::span<const double> host_values_;
  solve::ResidualOperator residual_;
  std::vector<double> right_hand_sides_, solutions_;
};

class EmulatedExecutor final : public device::Executor<double> {
 public:
  EmulatedExecutor(const device::Job& job, EmulatedWork& work)
      : rule_(job.rule), pool_(job.pool), link_(job.link), work_(work) {
    const device::Job own{job.plan,   job.kind,     job.hermitian, job.rule, job.pool,
                          job.budget, job.timeline, {0},           {},       nullptr};
    host_ = device::registry().host().make_executor(own, device::Scalar<double>());
  }
  void set_pivot_rule(const device::PivotRule& rule) override { host_->set_pivot_rule(rule); }
  device::FactorOutcome factorize(std::span<const double> values) override { return host_->factorize(values); }
  void solve(double* x, Index columns, bool transpose) override { host_->solve(x, columns, transpose); }
  [[nodiscard]] std::string name() const override { return "an emulated GPU"; }
  [[nodiscard]] Offset peak_bytes() const override { return host_->peak_bytes(); }
  std::unique_ptr<device::DeviceLinearSystem> make_linear_system(const device::LinearSystemArrays& arrays,
                                                                 Offset) override {
    return std::make_unique<EmulatedSystem>(arrays, *host_, rule_, link_, pool_, work_);
  }

 private:
  device::PivotRule rule_;
  base::ThreadPool& pool_;
  Communicator* link_;
  EmulatedWork& work_;
  std::unique_ptr<device::Executor<double>> host_;
};

/// Each rank has one, and a registry with it, so that it knows its own work.
class EmulatedGpu final : public device::Backend {
 public:
  [[nodiscard]] std::string_view name() const override { return "emulated"; }
  [[nodiscard]] std::string_view noun() const override { return "emulated GPU"; }
  [[nodiscard]] device::FoundDevices find() const override { return {std::vector<std::string>(8, "emulated"), {}}; }
  [[nodiscard]] device::Limits limits() const override {
    device::Limits limits;
    limits.most_devices = 8;
    limits.own_memory = limits.ranks = true;
    return limits;
  }
  [[nodiscard]] const plan::MachineModel& model(const plan::Machine& machine) const override { return machine.host; }
  [[nodiscard]] device::PredictedTime predict(const analysis::AssemblyTree&, const device::PlanWish&) const override {
    return {seconds, false, {}};
  }
  [[nodiscard]] plan::PlanOptions plan_options(const device::PlanWish& wish) const override {
    device::PlanWish one = wish;
    one.devices = one.ranks = 1;
    one.rank = 0;
    return host().plan_options(one);
  }
  [[nodiscard]] Offset executor_bytes(const plan::Plan& plan, Kind kind, Precision precision,
                                      int threads) const override {
    return host().executor_bytes(plan, kind, precision, threads);
  }
  [[nodiscard]] Offset free_bytes(int) const override { return std::numeric_limits<Offset>::max(); }
  [[nodiscard]] std::unique_ptr<device::Executor<double>> make_executor(const device::Job& job,
                                                                        device::Scalar<double>) const override {
    if (refuses) throw Error(StatusCode::out_of_memory, "others have its memory");
    return std::make_unique<EmulatedExecutor>(job, work);
  }
  [[nodiscard]] std::unique_ptr<device::Executor<float>> make_executor(const device::Job& job,
                                                                       device::Scalar<float> scalar) const override {
    return host().make_executor(job, scalar);
  }

  bool refuses = false;  ///< it has no memory left
  double seconds = 0;    ///< predicted for anything
  mutable EmulatedWork work;

 private:
  static const device::Backend& host() { return device::registry().host(); }
};

}  // namespace espalier::ranks
