/// \file
/// The ranks as one of them sees them: messages, calls that all make together, and the end of waiting.
#pragma once

#include <cstdint>
#include <deque>
#include <functional>
#include <map>
#include <mutex>
#include <span>
#include <string>
#include <utility>
#include <vector>

#include "espalier/ranks.h"
#include "espalier/types.hpp"
#include "ranks/message.hpp"

namespace espalier::ranks {

/// Takes a message of the current operation.
using Handler = std::function<void(int from, const Message& message)>;

/// Ranks make the same *calls* of a solver in the same order, and in them the same *operations* (a factorization, the
/// gathering of values). A message belongs to one operation: what comes early is kept until its receiver gets there,
/// what comes from a call that has failed is dropped. So a failure leaves nothing behind, and the next call works.
///
/// Whoever waits drives all messages. A rank from which nothing has come for `patience` seconds, while this one waits,
/// counts as lost: ranks that wait send a sign of life now and then, so that only who is dead, stopped, or elsewhere is
/// silent. After a loss nothing works any more: all calls end with the same sentence.
///
/// Only post() may be called by several threads, all else by the thread that calls the solver.
class Communicator {
 public:
  /// Collective: exchanges the names of hosts. Takes the table over.
  /// @param patience  seconds, above 0
  /// @throws Error(device_error) where a rank does not answer; Error(invalid_input) for a table that cannot be
  Communicator(const espalier_rank_functions& functions, double patience);
  ~Communicator();
  Communicator(const Communicator&) = delete;
  Communicator& operator=(const Communicator&) = delete;

  [[nodiscard]] int rank() const { return table_.rank; }
  [[nodiscard]] int size() const { return table_.ranks; }
  /// "rank 2 on host node7".
  [[nodiscard]] std::string name_of(int rank) const;
  [[nodiscard]] const std::vector<std::string>& hosts() const { return hosts_; }
  /// Ranks on this host that may use the same cores, this one included.
  [[nodiscard]] int neighbours() const { return neighbours_; }

  /// Ranks of one machine have the same number. A machine is a host, unless set_machines() says otherwise.
  [[nodiscard]] int machine_of(int rank) const;
  /// So many ranks after each other are a machine; 0: those of a host. The same on all ranks.
  void set_machines(int ranks) { machine_ranks_ = ranks; }
  /// Where what comes in is put from now on, if there is room; else it goes to the heap. The last caller's memory
  /// counts.
  /// @param owner  for forget_memory(). @param take  memory of at least so many bytes, or null
  void use_memory(const void* owner, std::function<std::shared_ptr<std::byte[]>(std::size_t bytes)> take) {
    memory_owner_ = owner;
    take_ = std::move(take);
  }
  /// Ends that, if the memory is still this owner's.
  void forget_memory(const void* owner) {
    if (memory_owner_ == owner) use_memory(nullptr, {});
  }

  /// Before and after what a collective call does. `own` is how it ended here; all ranks return the same: the first
  /// failure that is not another's.
  void begin_call();
  Status end_call(Status own);

  /// Messages of the next operation are handed out from now on.
  void begin_operation();
  /// Any thread: to be sent to each of them in the current operation, soon.
  void post(std::span<const int> to, Message message);
  /// Sends, receives, and hands out what has come. @throws Error when a rank has given up or is lost
  void drive(const Handler& handler);
  /// Drives until `done`. @throws as drive(), and when nothing comes for too long
  void wait(const Handler& handler, const std::function<bool()>& done);
  /// For waits of others than wait(): begin to be impatient now; has nothing come for too long?
  void begin_waiting() { waiting_since_ = now(); }
  void expect_patience();

  /// The bytes of each rank, by rank. One operation.
  std::vector<std::vector<std::byte>> all_gather(std::span<const std::byte> mine);
  template <class T>
  std::vector<std::vector<T>> all_gather_of(std::span<const T> mine) {
    std::vector<std::vector<T>> all;
    for (const auto& bytes : all_gather(std::as_bytes(mine))) {
      all.emplace_back(bytes.size() / sizeof(T));
      if (!bytes.empty()) std::memcpy(all.back().data(), bytes.data(), bytes.size());
    }
    return all;
  }
  /// What each rank has for this one, by rank. One operation. @param mine  for each rank
  std::vector<std::vector<std::byte>> all_to_all(std::span<const std::span<const std::byte>> mine);
  /// One number of each rank.
  std::vector<std::int64_t> all_numbers(std::int64_t mine);
  /// How something that can fail on one rank alone has ended: throws on all ranks what was thrown on the first of them.
  void expect_all(const std::function<void()>& body);

  /// Seconds.
  [[nodiscard]] double patience() const { return patience_; }
  /// Bytes that were sent so far.
  [[nodiscard]] std::int64_t sent_bytes() const { return sent_bytes_; }

 private:
  static constexpr std::uint32_t kLeave = 0xffffffff;  // the operation in which a call ends
  struct Outgoing {
    Message message;
    void* request;
  };
  struct Incoming {
    Message message;
    void* request;
    bool done;
  };

  [[nodiscard]] static double now();
  void exchange_hosts();
  void keep_what_is_open();
  void check(int error);
  void send_posted();
  void finish_sent();
  void receive();
  void deliver(const Handler& handler);
  void hand_out(int from, const Message& message, const Handler& handler);
  void hand_out_early(const Handler& handler);
  void post_parts(std::span<const int> to, std::span<const std::byte> bytes);
  void take_parts(std::vector<std::vector<std::byte>>& all);
  void give_sign_of_life();
  void tell_all(std::int32_t kind, const std::string& text);
  [[noreturn]] void lose(const std::string& why);
  Status meet(const Status& own);
  void take_abort(const Message& message);

  espalier_rank_functions table_;
  double patience_;
  std::vector<std::string> hosts_;
  int neighbours_ = 1;
  int machine_ranks_ = 0;
  const void* memory_owner_ = nullptr;
  std::function<std::shared_ptr<std::byte[]>(std::size_t)> take_;
  std::uint32_t call_ = 0, operation_ = 0;
  std::mutex mutex_;
  std::vector<std::pair<int, Message>> posted_;  // guarded by mutex_
  std::deque<Outgoing> outgoing_;
  std::vector<std::deque<Incoming>> incoming_;  // by rank, in the order in which they were sent
  std::size_t incoming_bytes_ = 0;
  std::map<std::pair<std::uint32_t, std::uint32_t>, std::vector<std::pair<int, Message>>> early_;
  std::vector<double> heard_;  // by rank; when something came last
  double waiting_since_ = 0, signed_ = 0;
  std::map<std::uint32_t, std::string> aborts_;  // by call: what another rank has said when it gave up
  std::string aborted_;                          // of this call
  std::string lost_;                             // for good
  std::int64_t sent_bytes_ = 0;
  std::int64_t moved_ = 0;  // messages that were sent, seen or received
};

}  // namespace espalier::ranks
