/// \file
/// Runs on a GPU, in each of which another call of CUDA is refused. Truth: the name of the refused call in the message,
/// and a right answer of the same object afterwards.
#pragma once

#include <gtest/gtest.h>

#include <algorithm>
#include <functional>
#include <string>

#include "device/cuda/runtime/cuda_faults.hpp"
#include "solver/gpu/gpu_fixture.hpp"

namespace espalier::test {

class RefusedCalls : public OnGpu {
 protected:
  void TearDown() override { device::cuda::call_faults().arm(0); }
};

/// An object that has been made for one refusal.
struct Attempt {
  std::function<Status()> run;         ///< its calls are refused; once more afterwards, when none is
  std::function<void()> expect_right;  ///< what the last run gave, after one that ended well
  /// Whether a run may end well without the call. Empty: without any, as what fails on the GPU goes on on the host.
  std::function<bool(const std::string&)> can_do_without = {};
};

/// Also true of a text that tells of several failures, or of a notice.
inline bool names_the_call(const Status& status, const std::string& call) {
  return status.code == StatusCode::out_of_memory || status.message.find(call) != std::string::npos;
}

/// What came of the refusals.
struct Refusals {
  std::int64_t calls = 0;  ///< of one run
  int errors = 0;          ///< runs that ended in an error
  int tried = 0;
  bool steady = true;  ///< each run came as far as the call to be refused
};

/// Refuses every `step`-th call of a run. @param make  makes an Attempt
template <class Make>
Refusals refuse_every(const Make& make, int step) {
  auto& faults = device::cuda::call_faults();
  const device::Backend& gpus = *device::registry().find("gpu");
  Refusals told;
  for (int k = 0; k < 2; ++k) {  // some calls are made once in a process
    const Attempt attempt = make();
    faults.arm(0);
    const Status status = attempt.run();
    told.calls = faults.made;
    EXPECT_TRUE(status.ok()) << status.message;
    if (!status.ok()) return told;
    attempt.expect_right();
  }
  const Offset free = gpus.free_bytes(0);
  for (std::int64_t k = 1; k <= told.calls; k += step) {
    SCOPED_TRACE(::testing::Message() << "call " << k << " of " << told.calls);
    const Attempt attempt = make();
    faults.arm(k);
    const Status status = attempt.run();
    const char* const refused = faults.refused;
    faults.arm(0);
    if (refused == nullptr) {
      told.steady = false;
      break;
    }
    SCOPED_TRACE(refused);
    ++told.tried;
    if (status.ok()) {
      EXPECT_TRUE(!attempt.can_do_without || attempt.can_do_without(refused)) << "was refused in silence";
      attempt.expect_right();
    } else {
      ++told.errors;
      EXPECT_TRUE(status.code == StatusCode::out_of_memory || status.code == StatusCode::device_error)
          << status.message;
      EXPECT_TRUE(names_the_call(status, refused)) << status.message;
    }
    const Status again = attempt.run();
    EXPECT_TRUE(again.ok()) << "once more: " << again.message;
    if (!again.ok()) break;
    attempt.expect_right();
    if (testing::Test::HasFailure()) break;
  }
  constexpr Offset kOfTheRuntime = Offset{64} << 20;
  EXPECT_GT(gpus.free_bytes(0) + kOfTheRuntime, free) << "memory of the GPU is not given back";
  return told;
}

/// About `most` calls of a run, one after the other in equal steps.
template <class Make>
Refusals refuse_some(const Make& make, int most) {
  const Attempt attempt = make();
  device::cuda::call_faults().arm(0);
  EXPECT_TRUE(attempt.run().ok());
  const std::int64_t calls = device::cuda::call_faults().made;
  EXPECT_GT(calls, 10) << "the calls are counted";
  return refuse_every(make, static_cast<int>(std::max<std::int64_t>(1, calls / most)));
}

}  // namespace espalier::test
