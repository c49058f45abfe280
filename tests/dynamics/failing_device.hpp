/// \file
/// A GPU, emulated or not, that fails in what it is asked to do with the vectors of an integrator.
#pragma once

#include <memory>
#include <utility>

#include "dynamics/device/device_assembly.hpp"

namespace espalier::dynamics::test {

/// How many calls its vectors still serve before the GPU fails; negative: any number.
struct CallsLeft {
  int sends = -1;  ///< of send()
  int all = -1;
};

class FailingMotion final : public DeviceMotion {
 public:
  FailingMotion(std::unique_ptr<DeviceMotion> motion, CallsLeft& left) : motion_(std::move(motion)), left_(left) {}
  [[nodiscard]] const MotionArrays& arrays() const override { return motion_->arrays(); }
  void use_scale(const double* scale) override { motion_->use_scale(scale); }
  void turn_past() override { motion_->turn_past(); }
  void run(const MotionLoop& loop) override {
    take(left_.all);
    motion_->run(loop);
  }
  [[nodiscard]] MotionRecord measure(const MotionMeasure& what) override {
    take(left_.all);
    return motion_->measure(what);
  }
  void send(ConstSpan from, double* to) override {
    take(left_.sends);
    take(left_.all);
    motion_->send(from, to);
  }
  void fetch(const double* from, Span to) override {
    take(left_.all);
    motion_->fetch(from, to);
  }
  [[nodiscard]] ConstSpan look(List list, std::span<const double* const> from) override {
    take(left_.all);
    return motion_->look(list, from);
  }
  void set(List list, ConstSpan values, double* to) override {
    take(left_.all);
    motion_->set(list, values, to);
  }
  void add(List list, ConstSpan values, double* to) override {
    take(left_.all);
    motion_->add(list, values, to);
  }

 private:
  static void take(int& left) {
    if (left == 0) throw Error(StatusCode::device_error, "the GPU has failed as it was told");
    if (left > 0) --left;
  }

  std::unique_ptr<DeviceMotion> motion_;
  CallsLeft& left_;
};

class FailingAssembly final : public DeviceAssembly {
 public:
  FailingAssembly(std::unique_ptr<DeviceAssembly> assembly, CallsLeft& left)
      : assembly_(std::move(assembly)), left_(left) {}
  std::unique_ptr<DeviceBody> make_body(const DeviceBodyTables& tables) override {
    return assembly_->make_body(tables);
  }
  std::unique_ptr<DeviceMatrix> make_matrix(const DeviceMatrixLayout& layout) override {
    return assembly_->make_matrix(layout);
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
