/// \file
/// A GPU, emulated or not, that fails in what it is asked to do with bodies, K, its solutions and the vectors of an
/// integrator.
#pragma once

#include <memory>
#include <utility>

#include "dynamics/device/device_assembly.hpp"

namespace espalier::dynamics::test {

/// How many calls it still serves before the GPU fails; negative: any number.
struct CallsLeft {
  int sends = -1;  ///< of DeviceMotion::send()
  int all = -1;
  static void take(int& left) {
    if (left == 0) throw Error(StatusCode::device_error, "the GPU has failed as it was told");
    if (left > 0) --left;
  }
};

class FailingMotion final : public DeviceMotion {
 public:
  FailingMotion(std::unique_ptr<DeviceMotion> motion, CallsLeft& left) : motion_(std::move(motion)), left_(left) {}
  [[nodiscard]] const MotionArrays& arrays() const override { return motion_->arrays(); }
  void use_scale(const double* scale) override { motion_->use_scale(scale); }
  void turn_past() override { motion_->turn_past(); }
  void run(const MotionLoop& loop) override {
    CallsLeft::take(left_.all);
    motion_->run(loop);
  }
  [[nodiscard]] MotionRecord measure(const MotionMeasure& what) override {
    CallsLeft::take(left_.all);
    return motion_->measure(what);
  }
  void send(ConstSpan from, double* to) override {
    CallsLeft::take(left_.sends);
    CallsLeft::take(left_.all);
    motion_->send(from, to);
  }
  void fetch(const double* from, Span to) override {
    CallsLeft::take(left_.all);
    motion_->fetch(from, to);
  }
  [[nodiscard]] ConstSpan gather(List list, std::span<const double* const> from) override {
    CallsLeft::take(left_.all);
    return motion_->gather(list, from);
  }
  void set(List list, ConstSpan values, double* to) override {
    CallsLeft::take(left_.all);
    motion_->set(list, values, to);
  }
  void add(List list, ConstSpan values, double* to) override {
    CallsLeft::take(left_.all);
    motion_->add(list, values, to);
  }

 private:
  std::unique_ptr<DeviceMotion> motion_;
  CallsLeft& left_;
};

class FailingBody final : public DeviceBody {
 public:
  FailingBody(std::unique_ptr<DeviceBody> body, CallsLeft& left) : body_(std::move(body)), left_(left) {}
  void bind(std::span<const Offset> column_start, std::span<const std::int32_t> shift) override {
    body_->bind(column_start, shift);
  }
  void start_forces(const BodyState& state) override {
    CallsLeft::take(left_.all);
    body_->start_forces(state);
  }
  Offset finish_forces(double load, const double* weight, double* f) override {
    CallsLeft::take(left_.all);
    return body_->finish_forces(load, weight, f);
  }
  void put_forces(double load, double* f) override {
    CallsLeft::take(left_.all);
    body_->put_forces(load, f);
  }
  void start_tangent(const BodyState& state, const TangentWeights& weights, double* values) override {
    CallsLeft::take(left_.all);
    body_->start_tangent(state, weights, values);
  }
  Offset finish() override {
    CallsLeft::take(left_.all);
    return body_->finish();
  }

 private:
  std::unique_ptr<DeviceBody> body_;
  CallsLeft& left_;
};

class FailingVectors final : public DeviceVectors {
 public:
  FailingVectors(std::unique_ptr<DeviceVectors> vectors, CallsLeft& left) : vectors_(std::move(vectors)), left_(left) {}
  void solve(Span b, const Solve& solve) override {
    CallsLeft::take(left_.all);
    vectors_->solve(b, solve);
  }
  void solve_there(double* b, const Solve& solve) override {
    CallsLeft::take(left_.all);
    vectors_->solve_there(b, solve);
  }
  [[nodiscard]] const double* scale() const override { return vectors_->scale(); }
  void put_lower(ConstSpan r, double* b) override {
    CallsLeft::take(left_.all);
    vectors_->put_lower(r, b);
  }
  void make_columns(std::span<const Index> rows, const Solve& solve) override {
    CallsLeft::take(left_.all);
    vectors_->make_columns(rows, solve);
  }
  void combine_columns(ConstSpan factors, Span x) override {
    CallsLeft::take(left_.all);
    vectors_->combine_columns(factors, x);
  }
  void combine_columns_there(ConstSpan factors, double* x) override {
    CallsLeft::take(left_.all);
    vectors_->combine_columns_there(factors, x);
  }
  void fetch_columns(Span to) override {
    CallsLeft::take(left_.all);
    vectors_->fetch_columns(to);
  }
  [[nodiscard]] void* stream() const override { return vectors_->stream(); }

 private:
  std::unique_ptr<DeviceVectors> vectors_;
  CallsLeft& left_;
};

class FailingMatrix final : public DeviceMatrix {
 public:
  FailingMatrix(std::unique_ptr<DeviceMatrix> matrix, CallsLeft& left) : matrix_(std::move(matrix)), left_(left) {}
  double* clear() override {
    CallsLeft::take(left_.all);
    return matrix_->clear();
  }
  void add_from_host(const Fill& fill) override {
    CallsLeft::take(left_.all);
    matrix_->add_from_host(fill);
  }
  void column_sizes(Span diagonal, Span largest) override {
    CallsLeft::take(left_.all);
    matrix_->column_sizes(diagonal, largest);
  }
  const double* complete(ConstSpan scale, ConstSpan rest) override {
    CallsLeft::take(left_.all);
    return matrix_->complete(scale, rest);
  }
  void set_scale(ConstSpan scale) override {
    CallsLeft::take(left_.all);
    matrix_->set_scale(scale);
  }
  void fetch_w(Span values) const override {
    CallsLeft::take(left_.all);
    matrix_->fetch_w(values);
  }
  void sum_rows(ConstSpan x, Span out) const override {
    CallsLeft::take(left_.all);
    matrix_->sum_rows(x, out);
  }
  [[nodiscard]] void* stream() const override { return matrix_->stream(); }
  std::unique_ptr<DeviceVectors> make_vectors() override {
    return std::make_unique<FailingVectors>(matrix_->make_vectors(), left_);
  }

 private:
  std::unique_ptr<DeviceMatrix> matrix_;
  CallsLeft& left_;
};

class FailingAssembly final : public DeviceAssembly {
 public:
  FailingAssembly(std::unique_ptr<DeviceAssembly> assembly, CallsLeft& left)
      : assembly_(std::move(assembly)), left_(left) {}
  std::unique_ptr<DeviceBody> make_body(const DeviceBodyTables& tables) override {
    return std::make_unique<FailingBody>(assembly_->make_body(tables), left_);
  }
  std::unique_ptr<DeviceMatrix> make_matrix(const DeviceMatrixLayout& layout) override {
    return std::make_unique<FailingMatrix>(assembly_->make_matrix(layout), left_);
  }
  std::unique_ptr<DeviceMotion> make_motion(const Sizes& sizes, const MotionDemand& demand,
                                            const DeviceShare& share) override {
    return std::make_unique<FailingMotion>(assembly_->make_motion(sizes, demand, share), left_);
  }

 private:
  std::unique_ptr<DeviceAssembly> assembly_;
  CallsLeft& left_;
};

}  // namespace espalier::dynamics::test
