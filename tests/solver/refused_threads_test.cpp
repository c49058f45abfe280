// Threads that the system refuses: fewer work. Truth: the bits of the solution by one thread, the backward error.
#include <gtest/gtest.h>

#if !defined(ESPALIER_SANITIZED)  // sanitizers have a pthread_create of their own

#include <dlfcn.h>
#include <pthread.h>

#include <atomic>
#include <cerrno>

#include "solver/solver_common.hpp"

namespace {
std::atomic<int> threads_left{1 << 30};  // none: pthread_create() refuses as at the limit of processes (ulimit -u)
}

// The calls of the whole program: what std::thread and std::async call.
extern "C" int pthread_create(pthread_t* thread, const pthread_attr_t* attributes, void* (*start)(void*),
                              void* argument) noexcept {
  static const auto real = reinterpret_cast<decltype(&pthread_create)>(::dlsym(RTLD_NEXT, "pthread_create"));
  if (threads_left.fetch_sub(1) <= 0) return EAGAIN;
  return real(thread, attributes, start, argument);
}

namespace espalier {
namespace {

using namespace test;

TEST(RefusedThreads, FewerDoTheWork) {
  const SparseMatrix a = generated({"elasticity", "6"});
  const std::vector<double> b = reference::random_vector(a.rows, 1);
  std::vector<double> alone(b.size());
  for (const char* device : {"cpu", "host:1"})
    for (const int left : {1 << 30, 0, 1, 2, 5}) {
      SCOPED_TRACE(std::string(device) + ", " + std::to_string(left) + " threads left");
      Options o;
      o.device = device;
      o.threads = 4;
      threads_left = left;
      Solver s(o);
      const Status analysis = s.analyze(a).status;
      const Status factor = analysis.ok() ? s.factorize(a).status : analysis;
      std::vector<double> x(b.size());
      const Status solved = factor.ok() ? s.solve(b, x).status : factor;
      threads_left = 1 << 30;
      ASSERT_TRUE(solved.ok()) << solved.message;
      if (left == 1 << 30) alone = x;
      EXPECT_EQ(x, alone);
      EXPECT_LE(reference::backward_error(a, b, x), 8 * kEps);
    }
}

// Two host devices need two threads, a factor out of core its loader and its storer: said, and the solver goes on
// later.
TEST(RefusedThreads, WhereSomeAreNeededTheStatusSaysSo) {
  const SparseMatrix a = generated({"elasticity", "6"});
  const std::vector<double> b = reference::random_vector(a.rows, 1);
  std::vector<double> x(b.size());
  Options o;
  o.device = "host:1";
  o.threads = 1;
  Solver whole(o);
  ASSERT_TRUE(whole.analyze(a).status.ok());
  o.device_memory_bytes = whole.factorize(a).devices.front().peak_bytes / 2;
  for (const int left : {0, 1}) {
    Solver s(o);
    ASSERT_TRUE(s.analyze(a).status.ok());
    threads_left = left;
    const Status refused = s.factorize(a).status;
    threads_left = 1 << 30;
    EXPECT_EQ(refused.code, StatusCode::out_of_memory) << refused.message;
    EXPECT_NE(refused.message.find("threads"), std::string::npos) << refused.message;
    ASSERT_TRUE(s.factorize(a).status.ok());
    EXPECT_TRUE(s.solve(b, x).status.ok());
    EXPECT_LE(reference::backward_error(a, b, x), 8 * kEps);
  }
}

}  // namespace
}  // namespace espalier

#endif
