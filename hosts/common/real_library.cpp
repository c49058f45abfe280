#include "common/real_library.hpp"

#include <dlfcn.h>

#include <cstdlib>
#include <cstring>

#include "common/handles.hpp"

namespace espalier::hosts {

namespace {

const void* base_of(const void* address) {
  Dl_info info{};
  return ::dladdr(address, &info) != 0 ? info.dli_fbase : nullptr;
}

// A link to our library under the real one's name would lead us to ourselves.
bool ours(const void* address) {
  static const char here = 0;
  return base_of(address) == base_of(&here);
}

// What the library that calls would find, were we not there.
void* find_for_caller(const char* name) {
  Dl_info caller{};
  if (Caller::current() == nullptr || ::dladdr(Caller::current(), &caller) == 0) return nullptr;
  void* library = ::dlopen(caller.dli_fname, RTLD_LAZY | RTLD_NOLOAD);
  if (library == nullptr) return nullptr;  // the program itself
  void* found = ::dlsym(library, name);
  ::dlclose(library);
  return found;
}

void* unless_ours(void* found) { return found == nullptr || ours(found) ? nullptr : found; }

}  // namespace

const void*& Caller::current() {
  thread_local const void* address = nullptr;
  return address;
}

bool takes_small_systems() {
  const char* text = std::getenv("ESPALIER_SMALL");
  return text != nullptr && std::strcmp(text, "ours") == 0;
}

int& InsideReal::depth() {
  thread_local int depth = 0;
  return depth;
}

void* RealLibrary::open() {
  std::call_once(opened_, [this] {
    for (const std::string& name : names_)
      if (system_ == nullptr) system_ = ::dlopen(name.c_str(), RTLD_LAZY | RTLD_LOCAL);
  });
  return system_;
}

void* RealLibrary::look_up(const char* name) {
  std::call_once(asked_, [this] {
    if (const char* file = std::getenv(variable_)) named_ = ::dlopen(file, RTLD_LAZY | RTLD_LOCAL);
  });
  if (named_ != nullptr) return unless_ours(::dlsym(named_, name));
  void* found = unless_ours(find_for_caller(name));
  if (found == nullptr) found = unless_ours(::dlsym(RTLD_NEXT, name));
  if (found == nullptr && open() != nullptr) found = unless_ours(::dlsym(system_, name));
  return found;
}

// The dynamic linker needs a tenth of a millisecond for each look-up in a program with two hundred libraries.
void* RealLibrary::find(const char* name) {
  const std::pair<const void*, std::string> key(Caller::current(), name);
  {
    const std::lock_guard lock(table_lock());
    if (const auto known = found_.find(key); known != found_.end()) return known->second;
  }
  void* found = look_up(name);
  if (found == nullptr) return nullptr;  // it may come later
  const std::lock_guard lock(table_lock());
  return found_[key] = found;
}

}  // namespace espalier::hosts
