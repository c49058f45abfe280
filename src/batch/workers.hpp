/// \file
/// Work of a batch on several threads.
#pragma once

#include <functional>

#include "base/thread_pool.hpp"
#include "espalier/solver.hpp"

namespace espalier::batch {

/// The options of a session that works beside others: it must not call back from threads of ours, and they share what
/// memory there is.
Options options_of_worker(Options o, int threads, int workers);

/// one(worker, k) for all k below `count`, each worker one at a time.
void share(base::ThreadPool& pool, int workers, Index count, const std::function<void(int, Index)>& one);

}  // namespace espalier::batch
