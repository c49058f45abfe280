/// \file
/// One device of a streaming factorization: three loops, each on a thread of its own, that ask its backend for what the
/// device computes, what comes to it and what leaves it.
#pragma once

#include <deque>
#include <memory>
#include <span>
#include <vector>

#include "base/thread_pool.hpp"
#include "device/stream_backend.hpp"
#include "factor/stream_copies.hpp"
#include "factor/stream_progress.hpp"
#include "factor/streaming_executor.hpp"

namespace espalier::factor {

template <class T>
class StreamDeviceRun {
 public:
  StreamDeviceRun(std::unique_ptr<device::StreamBackend<T>> backend, Index number, const StreamingOptions& options,
                  StreamProgress& progress);

  /// Takes the device's memory; `plan` must stay.
  void prepare(const analysis::StreamingPlan& plan);
  void begin(std::span<const T> values, T* store);
  void run_all();
  void load_all();
  void store_all();

  [[nodiscard]] device::StreamBackend<T>& backend() { return *backend_; }
  [[nodiscard]] const device::StreamBackend<T>& backend() const { return *backend_; }
  /// Threads that copy to the host.
  base::ThreadPool& crew() { return out_crew_; }
  [[nodiscard]] device::StreamReport report(Offset budget_bytes) const;

 private:
  struct Arrival {  // a slot on its way to the host
    int slot;
    const analysis::StreamOp* op;
    std::int64_t number;
    Offset begin, size;
    bool last;
  };

  template <class Meanwhile>
  void wait_for_runs(const analysis::StreamOp& op, Meanwhile&& meanwhile);
  template <class Meanwhile>
  void wait_for_others(const analysis::StreamOp& op, Meanwhile&& meanwhile);
  void load(const analysis::StreamOp& op, int& slot);
  void pieces_of(const analysis::StreamOp& op, int part, HostPieces& pieces);
  void send(const analysis::StreamOp& op, std::int64_t number, int& slot);
  bool receive();

  std::unique_ptr<device::StreamBackend<T>> backend_;
  Index number_;
  const StreamingOptions& options_;
  StreamProgress& progress_;
  const analysis::StreamingPlan* plan_ = nullptr;
  base::ThreadPool in_crew_, out_crew_;
  std::vector<const analysis::StreamOp*> loads_, runs_, stores_;
  std::span<const T> values_;
  T* store_ = nullptr;
  ValuePieces gathered_;            // of the copies to the device
  HostPieces pieces_;               // likewise
  std::deque<Arrival> on_the_way_;  // of the copies to the host
  std::vector<std::byte> outputs_;  // likewise
  double in_seconds_ = 0, out_seconds_ = 0;
};

}  // namespace espalier::factor
