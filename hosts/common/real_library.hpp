/// \file
/// The library in whose place a host finds ours (by LD_PRELOAD, as a rule): what we do not do, it does.
#pragma once

#include <map>
#include <mutex>
#include <string>
#include <utility>
#include <vector>

namespace espalier::hosts {

/// Where in the host the call of this thread comes from: to be made first in each function that hosts find.
class Caller {
 public:
  explicit Caller(const void* address) : before_(current()) { current() = address; }
  ~Caller() { current() = before_; }
  Caller(const Caller&) = delete;
  Caller& operator=(const Caller&) = delete;
  /// A return address; null outside of all calls.
  static const void*& current();

 private:
  const void* before_;
};
#define ESPALIER_NOTE_CALLER const ::espalier::hosts::Caller caller_of_this(__builtin_return_address(0))

class RealLibrary {
 public:
  /// @param variable  of the environment: a file that counts before all others
  /// @param names     under which the system knows the library
  RealLibrary(const char* variable, std::vector<std::string> names) : variable_(variable), names_(std::move(names)) {}

  /// A function besides ours, of the first of these that has it: the library that the variable names, those that the
  /// caller is linked with (wheels bring their own), the process, the system. Null: none has it.
  template <class Function>
  Function* function(const char* name) {
    return reinterpret_cast<Function*>(find(name));
  }

 private:
  void* find(const char* name);
  void* look_up(const char* name);
  void* open();

  const char* variable_;
  std::vector<std::string> names_;
  std::once_flag asked_, opened_;
  void *named_ = nullptr, *system_ = nullptr;
  std::map<std::pair<const void*, std::string>, void*> found_;  // by caller and name
};

/// Whether small systems are ours as well, for which the real library is faster: ESPALIER_SMALL=ours.
bool takes_small_systems();

/// While one of these lives, its thread is inside the real library: what that asks of itself under the names that we
/// show is answered by it, not by us.
class InsideReal {
 public:
  InsideReal() { ++depth(); }
  ~InsideReal() { --depth(); }
  InsideReal(const InsideReal&) = delete;
  InsideReal& operator=(const InsideReal&) = delete;
  static bool now() { return depth() > 0; }

 private:
  static int& depth();
};

}  // namespace espalier::hosts
