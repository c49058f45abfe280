#include "hsl/cached_factors.hpp"

#include <unistd.h>

#include <algorithm>
#include <atomic>
#include <cstdlib>
#include <cstring>
#include <list>
#include <mutex>

#include "common/handles.hpp"

namespace espalier::hosts {

namespace {

// An array of the host begins with these.
struct Header {
  std::int32_t mark[2];
  std::int32_t generation;
  std::int32_t n, entries;
  std::int32_t id[2];
  std::int32_t threshold[2], zero_pivot[2];  // doubles
};
constexpr std::int32_t kMark[2] = {0x45737061, 0x6c696572};
constexpr int kHeader = sizeof(Header) / sizeof(std::int32_t);

struct CachedFactor {
  CachedFactor(const std::string& interface, const KeptMatrix& m)
      : id(m.id),
        solver(interface,
               std::make_shared<const HostPattern>(HostPattern::from_coordinates(m.n, m.entries, m.rows, m.columns))) {}
  const std::int64_t id;
  std::mutex mutex;    // of all below
  int generation = 0;  // of the factor that is there
  InertiaSolver solver;
  std::atomic<std::int64_t> bytes{0};
};

// The factors used last come first. A solver has threads of its own, so their number is bounded as well as their bytes.
class Cache {
 public:
  static constexpr std::size_t kMostFactors = 32;

  std::shared_ptr<CachedFactor> find(std::int64_t id) {
    const std::lock_guard lock(table_lock());
    const auto found = std::find_if(factors_.begin(), factors_.end(), [&](const auto& f) { return f->id == id; });
    if (found == factors_.end()) return nullptr;
    factors_.splice(factors_.begin(), factors_, found);
    return factors_.front();
  }
  void add(std::shared_ptr<CachedFactor> factor) {
    const std::lock_guard lock(table_lock());
    factors_.push_front(std::move(factor));
  }
  // What is too much goes, the one used last never.
  void settle() {
    std::list<std::shared_ptr<CachedFactor>> gone;  // they end after the lock
    const std::lock_guard lock(table_lock());
    const std::int64_t most = budget();
    std::int64_t bytes = 0;
    std::size_t count = 0;
    for (auto f = factors_.begin(); f != factors_.end();) {
      const auto here = f++;
      bytes += (*here)->bytes;
      if (++count > 1 && (count > kMostFactors || bytes > most)) gone.splice(gone.end(), factors_, here);
    }
  }
  std::int64_t next_id() {
    const std::lock_guard lock(table_lock());
    return ++last_id_;
  }

 private:
  // A quarter of the machine's memory, or what ESPALIER_HSL_CACHE says in MiB.
  static std::int64_t budget() {
    if (const char* text = std::getenv("ESPALIER_HSL_CACHE")) return std::max(std::atoll(text), 0LL) << 20;
    return std::int64_t{::sysconf(_SC_PHYS_PAGES)} * ::sysconf(_SC_PAGESIZE) / 4;
  }

  std::list<std::shared_ptr<CachedFactor>> factors_;
  std::int64_t last_id_ = 0;
};

Cache& cache() {
  static auto& the_cache = *new Cache;
  return the_cache;
}

std::shared_ptr<CachedFactor> factor_of(const std::string& interface, const KeptMatrix& m) {
  if (auto found = cache().find(m.id)) return found;
  auto made = std::make_shared<CachedFactor>(interface, m);
  cache().add(made);
  return made;
}

Inertia factorize(CachedFactor& f, const KeptMatrix& m, const double* values) {
  const Inertia result = f.solver.factorize(values, m.wish);
  f.generation = result.status == ESPALIER_OK ? m.generation : 0;
  f.bytes = f.solver.solver().factor().peak_host_bytes + f.solver.pattern().bytes();
  return result;
}

}  // namespace

std::int64_t kept_length(int entries) { return kHeader + 2 * std::int64_t{entries}; }

void keep(const KeptMatrix& m, int* to) {
  const auto count = static_cast<std::size_t>(m.entries);
  if (m.rows != to + kHeader) {
    std::copy_n(m.rows, count, to + kHeader);
    std::copy_n(m.columns, count, to + kHeader + count);
  }
  Header h{{kMark[0], kMark[1]}, m.generation, m.n, m.entries, {}, {}, {}};
  std::memcpy(h.id, &m.id, sizeof h.id);
  std::memcpy(h.threshold, &m.wish.threshold, sizeof h.threshold);
  std::memcpy(h.zero_pivot, &m.wish.zero_pivot, sizeof h.zero_pivot);
  std::memcpy(to, &h, sizeof h);
}

std::optional<KeptMatrix> kept(const int* from, std::int64_t length) {
  if (from == nullptr || length < kHeader) return {};
  Header h;
  std::memcpy(&h, from, sizeof h);
  if (h.mark[0] != kMark[0] || h.mark[1] != kMark[1] || h.n < 1 || h.entries < 0 || length < kept_length(h.entries))
    return {};
  KeptMatrix m;
  m.generation = h.generation;
  m.n = h.n;
  m.entries = h.entries;
  std::memcpy(&m.id, h.id, sizeof m.id);
  std::memcpy(&m.wish.threshold, h.threshold, sizeof h.threshold);
  std::memcpy(&m.wish.zero_pivot, h.zero_pivot, sizeof h.zero_pivot);
  m.rows = from + kHeader;
  m.columns = m.rows + h.entries;
  return m;
}

// Memory that a host was given again may hold what was left there.
std::int64_t cached_id(const KeptMatrix& m, const int* in, std::int64_t length) {
  const std::optional<KeptMatrix> before = kept(in, length);
  const bool same = before && before->n == m.n && before->entries == m.entries &&
                    std::equal(m.rows, m.rows + m.entries, before->rows) &&
                    std::equal(m.columns, m.columns + m.entries, before->columns);
  return same ? before->id : 0;
}

Inertia factorize_cached(const std::string& interface, KeptMatrix& m, const double* values) {
  if (m.id == 0) m.id = cache().next_id();
  const std::shared_ptr<CachedFactor> f = factor_of(interface, m);
  Inertia result;
  {
    const std::lock_guard lock(f->mutex);
    m.generation = static_cast<int>(cache().next_id());
    result = factorize(*f, m, values);
  }
  cache().settle();
  return result;
}

int solve_cached(const std::string& interface, const KeptMatrix& m, const double* values, double* x, int columns,
                 int stride) {
  const std::shared_ptr<CachedFactor> f = factor_of(interface, m);
  int status = ESPALIER_OK;
  {
    const std::lock_guard lock(f->mutex);
    if (f->generation != m.generation) status = factorize(*f, m, values).status;  // it has gone, or become another
    if (status == ESPALIER_OK) status = f->solver.solve(x, columns, stride);
  }
  cache().settle();
  return status;
}

std::shared_ptr<const espalier_analysis_info> cached_analysis(const KeptMatrix& m) {
  const std::shared_ptr<CachedFactor> f = cache().find(m.id);
  if (f == nullptr) return nullptr;
  return {f, &f->solver.solver().analysis()};
}

}  // namespace espalier::hosts
