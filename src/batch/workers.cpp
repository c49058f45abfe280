#include "batch/workers.hpp"

#include <algorithm>
#include <atomic>

namespace espalier::batch {

Options options_of_worker(Options o, int threads, int workers) {
  o.threads = threads;
  o.log = nullptr;
  o.interrupted = nullptr;
  o.record_timeline = false;
  o.host_memory_bytes = o.host_memory_bytes > 0 ? std::max<Offset>(1, o.host_memory_bytes / workers) : 0;
  return o;
}

void share(base::ThreadPool& pool, int workers, Index count, const std::function<void(int, Index)>& one) {
  std::atomic<Index> next{0};
  const auto work = [&](int worker) {
    if (worker >= workers) return;
    for (Index k = next++; k < count; k = next++) {
      pool.check();
      one(worker, k);
    }
  };
  if (workers == 1)
    work(0);
  else
    pool.share(work);
}

}  // namespace espalier::batch
