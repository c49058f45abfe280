#include "ranks/first_rank.hpp"

#include <algorithm>
#include <chrono>
#include <exception>
#include <future>
#include <utility>

#include "base/beside.hpp"

namespace espalier::ranks {

namespace {

void work_beside(Communicator& link, base::ThreadPool& pool, const std::function<void()>& work) {
  std::future<void> done = base::start_beside(work);
  const auto state = [&] { return done.wait_for(std::chrono::seconds(0)); };
  if (state() == std::future_status::deferred) return done.get();  // no thread to be had: without signs of life
  std::exception_ptr failed;
  try {
    link.wait([](int, const Message&) {},
              [&] {
                pool.check();
                return state() == std::future_status::ready;
              });
  } catch (...) {
    failed = std::current_exception();
  }
  done.wait();  // it uses what belongs to the caller
  if (failed) std::rethrow_exception(failed);
  done.get();
}

}  // namespace

void by_first_rank(Communicator& link, base::ThreadPool& pool, const std::function<void()>& work) {
  link.begin_operation();
  link.expect_all([&] {
    if (link.rank() == 0) work_beside(link, pool, work);
  });
}

FirstRankPool::FirstRankPool(const Communicator& link, base::ThreadPool& own) : own_(own) {
  if (link.rank() != 0) return;
  const int threads = std::min(base::available_cores(), link.neighbours() * own.size());
  if (threads > own.size()) more_.emplace(threads, own.interruption());
}

std::vector<std::byte> from_first_rank(Communicator& link, std::span<const std::byte> mine) {
  return std::move(link.all_gather(link.rank() == 0 ? mine : std::span<const std::byte>()).front());
}

}  // namespace espalier::ranks
