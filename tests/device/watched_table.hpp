/// \file
/// Looks at the messages of a rank.
#pragma once

#include <cstddef>
#include <cstdint>

#include "espalier/ranks.h"

namespace espalier::emulated {

using Table = espalier_rank_functions;

/// Hands everything to another table; what is derived looks at it.
class WatchedTable {
 public:
  explicit WatchedTable(const Table& inner) : inner_(inner) {}
  WatchedTable(const WatchedTable&) = delete;
  WatchedTable& operator=(const WatchedTable&) = delete;
  virtual ~WatchedTable() = default;

  Table table() {
    Table t = inner_;
    t.context = this;
    t.send = [](void* c, const void* data, std::size_t bytes, std::int32_t to, void** request) {
      return of(c).send(data, bytes, to, request);
    };
    t.test = [](void* c, void** request, std::int32_t* done) { return of(c).test(request, done); };
    t.probe = [](void* c, std::int32_t* from, std::size_t* bytes) {
      return of(c).inner_.probe(of(c).inner_.context, from, bytes);
    };
    t.receive = [](void* c, void* data, std::size_t bytes, std::int32_t from, void** request) {
      return of(c).inner_.receive(of(c).inner_.context, data, bytes, from, request);
    };
    t.dead_rank = nullptr;
    t.release = [](void* c) { of(c).inner_.release(of(c).inner_.context); };
    return t;
  }

 protected:
  virtual int send(const void* data, std::size_t bytes, std::int32_t to, void** request) {
    return inner_.send(inner_.context, data, bytes, to, request);
  }
  virtual int test(void** request, std::int32_t* done) { return inner_.test(inner_.context, request, done); }

  Table inner_;

 private:
  static WatchedTable& of(void* context) { return *static_cast<WatchedTable*>(context); }
};

}  // namespace espalier::emulated
