// Every call of the table of messages fails once, on each rank in turn: a status on all ranks that names the rank,
// never a hang.
#include <gtest/gtest.h>

#include <chrono>
#include <cstdio>
#include <functional>
#include <memory>
#include <string>
#include <thread>
#include <vector>

#include "espalier/espalier.hpp"
#include "matrix/generators/generate.hpp"
#include "ranks/on_threads.hpp"
#include "reference/reference.hpp"

namespace espalier::ranks {
namespace failing_messages_test {

enum class Call { send, probe, receive, test };

constexpr int kRefused = 77;  // no error of ThreadRanks

/// A table that refuses one call of a kind without making it. Counts these calls.
class FailingTable {
 public:
  /// @param at  from 1; 0: none
  FailingTable(const espalier_rank_functions& inner, Call call, std::int64_t at)
      : inner_(inner), call_(call), at_(at) {}
  FailingTable(const FailingTable&) = delete;
  FailingTable& operator=(const FailingTable&) = delete;
  ~FailingTable() { inner_.release(inner_.context); }

  [[nodiscard]] std::int64_t made() const { return made_; }
  [[nodiscard]] bool refused() const { return at_ > 0 && made_ >= at_; }

  espalier_rank_functions table() {
    espalier_rank_functions t = inner_;
    t.context = this;
    t.send = [](void* c, const void* data, std::size_t bytes, std::int32_t to, void** request) {
      return of(c, Call::send) ? kRefused : own(c).send(own(c).context, data, bytes, to, request);
    };
    t.probe = [](void* c, std::int32_t* from, std::size_t* bytes) {
      return of(c, Call::probe) ? kRefused : own(c).probe(own(c).context, from, bytes);
    };
    t.receive = [](void* c, void* data, std::size_t bytes, std::int32_t from, void** request) {
      return of(c, Call::receive) ? kRefused : own(c).receive(own(c).context, data, bytes, from, request);
    };
    t.test = [](void* c, void** request, std::int32_t* done) {
      return of(c, Call::test) ? kRefused : own(c).test(own(c).context, request, done);
    };
    t.explain = [](void* c, int error, char* text, std::size_t size) {
      if (error != kRefused) return own(c).explain(own(c).context, error, text, size);
      std::snprintf(text, size, "a refused call");
    };
    t.dead_rank = [](void* c) { return own(c).dead_rank(own(c).context); };
    t.release = [](void*) {};  // by the destructor, as it is left out after a loss
    return t;
  }

 private:
  static FailingTable& self(void* context) { return *static_cast<FailingTable*>(context); }
  static espalier_rank_functions& own(void* context) { return self(context).inner_; }
  static bool of(void* context, Call call) {
    FailingTable& me = self(context);
    return call == me.call_ && ++me.made_ == me.at_;
  }

  espalier_rank_functions inner_;
  Call call_;
  std::int64_t at_, made_ = 0;
};

SparseMatrix system_of(Kind kind) {
  if (kind == Kind::llt)
    return matrix::generate(matrix::parse_generator(std::vector<std::string>{"elasticity", "3", "2", "2"}));
  return kind == Kind::ldlt ? reference::saddle_point(60, 12, 3)
                            : reference::random_system(80, 4, reference::Values::general, 5);
}

// Analysis, two factorizations and solutions; the first failure.
Status life_of(const Ranks& ranks, const SparseMatrix& a, Kind kind) {
  Options o;
  o.threads = 1;
  o.kind = kind;
  Solver solver(ranks, o);
  if (Status s = solver.analyze(a).status; !s.ok()) return s;
  const std::vector<double> b(static_cast<std::size_t>(a.rows), 1.0);
  for (int k = 0; k < 2; ++k) {
    if (Status s = solver.factorize(a).status; !s.ok()) return s;
    std::vector<double> x(b.size());
    if (Status s = solver.solve(b, x).status; !s.ok()) return s;
    if (ranks.rank() == 0) {
      EXPECT_LE(reference::backward_error(a, b, x), 1e-14);
    }
  }
  return {};
}

struct Lives {
  std::vector<Status> ends;
  std::int64_t made = 0;  ///< calls of the rank that fails
  bool refused = false;
  double seconds = 0;
};

Lives lives_of(int count, int victim, Call call, std::int64_t at, const SparseMatrix& a, Kind kind) {
  Lives lives;
  lives.ends.resize(static_cast<std::size_t>(count));
  const auto begin = std::chrono::steady_clock::now();
  {
    const ThreadRanks shared(count);
    std::vector<std::unique_ptr<FailingTable>> tables;
    for (int r = 0; r < count; ++r)
      tables.push_back(std::make_unique<FailingTable>(shared.table(r), call, r == victim ? at : 0));
    std::vector<std::thread> threads;
    for (int r = 0; r < count; ++r)
      threads.emplace_back([&, r] {
        Status& end = lives.ends[static_cast<std::size_t>(r)];
        try {
          end = life_of(Ranks(tables[static_cast<std::size_t>(r)]->table(), at > 0 ? 0.7 : 60), a, kind);
        } catch (const Error& e) {  // in the first exchange
          end = e.status();
        }
      });
    for (std::thread& t : threads) t.join();
    lives.made = tables[static_cast<std::size_t>(victim)]->made();
    lives.refused = tables[static_cast<std::size_t>(victim)]->refused();
  }
  lives.seconds = std::chrono::duration<double>(std::chrono::steady_clock::now() - begin).count();
  return lives;
}

// Calls of the same number: all of those that send, which are as many in each life, and of the others, that wait, a
// share.
void refuse_in_turn(int count, int victim, Call call, Kind kind, int share) {
  const SparseMatrix a = system_of(kind);
  const Lives whole = lives_of(count, victim, call, 0, a, kind);
  for (const Status& end : whole.ends) ASSERT_TRUE(end.ok()) << end.message;
  ASSERT_GT(whole.made, 10);
  int refused = 0;
  for (std::int64_t at = 1; at <= whole.made; at += share) {
    SCOPED_TRACE("call " + std::to_string(at) + " of " + std::to_string(whole.made));
    const Lives lives = lives_of(count, victim, call, at, a, kind);
    EXPECT_LT(lives.seconds, 20) << "a hang";
    if (!lives.refused) break;  // calls that wait are not as many each time
    ++refused;
    for (int r = 0; r < count; ++r) {
      const Status& end = lives.ends[static_cast<std::size_t>(r)];
      // Once the last message is on its way nobody needs what comes later.
      if (end.ok() && at > whole.made * 9 / 10) continue;
      EXPECT_EQ(end.code, StatusCode::device_error) << "rank " << r << ": " << end.message;
      EXPECT_NE(end.message.find("rank " + std::to_string(victim)), std::string::npos) << end.message;
    }
    if (testing::Test::HasFailure()) return;
  }
  EXPECT_GT(refused, 3);
}

TEST(FailingMessages, EachIsNamedOnAllRanks) {
  for (const int count : {2, 3})
    for (int victim = 0; victim < count; ++victim)
      for (const Kind kind : {Kind::llt, Kind::ldlt, Kind::lu})
        for (const Call call : {Call::send, Call::receive}) {
          if (kind != Kind::llt && call == Call::receive && count == 3) continue;
          SCOPED_TRACE(std::to_string(count) + " ranks, rank " + std::to_string(victim) + ", kind " +
                       std::to_string(static_cast<int>(kind)) + ", call " + std::to_string(static_cast<int>(call)));
          refuse_in_turn(count, victim, call, kind, 1);
          if (testing::Test::HasFailure()) return;
        }
}

TEST(FailingMessages, CallsThatLookForThemToo) {
  for (const Call call : {Call::probe, Call::test}) {
    SCOPED_TRACE(static_cast<int>(call));
    refuse_in_turn(3, 1, call, Kind::llt, call == Call::probe ? 29 : 7);
  }
}

}  // namespace failing_messages_test
}  // namespace espalier::ranks
