#include "dynamics/model/run/shared_newton.hpp"

#include <atomic>
#include <functional>
#include <map>
#include <span>
#include <stdexcept>
#include <system_error>

#include "base/at.hpp"
#include "dynamics/model/run/newton_solver.hpp"
#include "espalier/dynamics.hpp"
#include "ranks/communicator.hpp"
#include "solver/ranks/on_all_ranks.hpp"

namespace espalier::dynamics::model {
namespace {

using Call = SharedNewton::Call;
using OptionList = std::vector<std::pair<std::string, std::string>>;

struct Announcement {
  Call call{};
  std::int64_t solver = 0;
  std::int64_t number = 0;  // unknowns of make, columns of solve
  OptionList options;       // of make
};

std::vector<std::byte> packed(const Announcement& a) {
  std::vector<std::byte> bytes;
  const auto append = [&bytes](std::span<const std::byte> part) {
    bytes.insert(bytes.end(), part.begin(), part.end());
  };
  const std::int64_t head[] = {static_cast<std::int64_t>(a.call), a.solver, a.number};
  append(std::as_bytes(std::span(head)));
  for (const auto& [key, value] : a.options)
    for (const std::string& text : {key, value}) {
      const auto length = static_cast<std::int64_t>(text.size());
      append(std::as_bytes(std::span(&length, 1)));
      append(std::as_bytes(std::span(text)));
    }
  return bytes;
}

Announcement unpacked(const std::vector<std::byte>& bytes) {
  ranks::Reader reader(bytes.data(), bytes.size());
  std::int64_t head[3] = {};
  reader.get(head, 3);
  Announcement a{static_cast<Call>(head[0]), head[1], head[2], {}};
  const auto text = [&reader] {
    std::int64_t length = 0;
    reader.get(&length, 1);
    std::string t(at(length), ' ');
    reader.get(t.data(), t.size());
    return t;
  };
  while (reader.left() > 0) {
    std::string key = text();
    a.options.emplace_back(std::move(key), text());
  }
  return a;
}

// One exchange, in which rank 0 alone has something to say, and `take` does on the others what can fail there.
Status exchange(const Ranks& ranks, const std::vector<std::byte>& said,
                const std::function<void(const std::vector<std::byte>&)>& take) {
  return solver::on_all_ranks(*ranks.link(), [&]() -> Status {
    try {
      const auto all = ranks.link()->all_gather(said);
      if (ranks.rank() != 0) take(all.front());
    } catch (const Error& error) {
      return error.status();
    } catch (const std::bad_alloc&) {
      return {StatusCode::out_of_memory, "the machine refused memory", -1};
    } catch (const std::system_error& error) {  // threads
      return {StatusCode::out_of_memory, error.what(), -1};
    }
    return {};
  });
}

Status say(const Ranks& ranks, const Announcement& what) {
  return exchange(ranks, packed(what), [](const std::vector<std::byte>&) {});
}

// Solvers of rank 0, by their numbers.
class Served {
 public:
  explicit Served(const Ranks& ranks) : ranks_(ranks) {}

  Status listen() {
    return exchange(ranks_, {}, [this](const std::vector<std::byte>& bytes) {
      now_ = unpacked(bytes);
      if (now_.call == Call::make)
        solvers_.insert_or_assign(now_.solver,
                                  Solver(ranks_, run_options(now_.options, static_cast<Index>(now_.number))));
    });
  }
  [[nodiscard]] bool ended() const { return now_.call == Call::end; }

  // How it ends, rank 0 hears in the call itself.
  void join() {
    if (now_.call == Call::drop) solvers_.erase(now_.solver);
    const auto found = solvers_.find(now_.solver);
    if (found == solvers_.end()) return;
    Solver& solver = found->second;
    try {
      if (now_.call == Call::analyze) (void)solver.analyze(MatrixView{});
      if (now_.call == Call::analyze_change) (void)solver.analyze_change(MatrixView{});
      if (now_.call == Call::factorize) (void)solver.refactorize({});
      if (now_.call == Call::solve) (void)solver.solve({}, {}, static_cast<Index>(now_.number));
    } catch (const std::logic_error&) {  // a call that the solver's state does not allow: rank 0 gets the same
    }
  }

 private:
  Ranks ranks_;
  Announcement now_;
  std::map<std::int64_t, Solver> solvers_;
};

std::int64_t next_number() {
  static std::atomic<std::int64_t> next{0};
  return next++;
}

}  // namespace

SharedNewton::SharedNewton(Ranks ranks, const OptionList& options, Index unknowns)
    : ranks_(std::move(ranks)), number_(next_number()) {
  if (Status status = say(ranks_, {Call::make, number_, unknowns, options}); !status.ok()) throw Error(status);
}

SharedNewton::~SharedNewton() {
  try {
    (void)announce(Call::drop);
  } catch (...) {  // without memory for a message the others keep theirs a while longer
  }
}

Status SharedNewton::announce(Call call, Index columns) const { return say(ranks_, {call, number_, columns, {}}); }

}  // namespace espalier::dynamics::model

namespace espalier {

Status serve_simulations(const Ranks& ranks) {
  if (ranks.size() < 2 || ranks.rank() == 0)
    throw std::logic_error("serve_simulations: is for the ranks beside rank 0, which runs the simulation");
  dynamics::model::Served served(ranks);
  for (;;) {
    if (Status status = served.listen(); status.code == StatusCode::device_error) return status;
    if (served.ended()) return {};
    served.join();
  }
}

Status end_simulations(const Ranks& ranks) {
  if (ranks.size() < 2) return {};
  if (ranks.rank() != 0) throw std::logic_error("end_simulations: is for rank 0, which runs the simulation");
  return dynamics::model::say(ranks, {dynamics::model::SharedNewton::Call::end, 0, 0, {}});
}

}  // namespace espalier
