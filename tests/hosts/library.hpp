/// \file
/// A host library as a host finds it: loaded at run time, functions by name.
#pragma once

#include <dlfcn.h>
#include <gtest/gtest.h>

#include <cstdio>
#include <set>
#include <stdexcept>
#include <string>

namespace espalier::test {

class Library {
 public:
  explicit Library(const char* path) : path_(path), handle_(::dlopen(path, RTLD_NOW | RTLD_LOCAL)) {
    if (handle_ == nullptr) throw std::runtime_error(::dlerror());
  }
  template <class Function>
  Function* function(const char* name) const {
    void* found = ::dlsym(handle_, name);
    if (found == nullptr) throw std::runtime_error(::dlerror());
    return reinterpret_cast<Function*>(found);
  }
  void close() { ::dlclose(handle_); }
  /// As readelf prints it.
  [[nodiscard]] std::string dynamic_section() const {
    std::string text;
    std::FILE* readelf = ::popen(("readelf -d " + path_).c_str(), "r");
    for (int c; readelf != nullptr && (c = std::fgetc(readelf)) != EOF;) text += static_cast<char>(c);
    if (readelf != nullptr) ::pclose(readelf);
    return text;
  }
  /// All names that the library defines for others.
  [[nodiscard]] std::set<std::string> names() const {
    std::set<std::string> found;
    std::FILE* nm = ::popen(("nm -D --defined-only " + path_).c_str(), "r");
    char name[256];
    while (nm != nullptr && std::fscanf(nm, "%*s %*s %255s", name) == 1) found.insert(name);
    if (nm != nullptr) ::pclose(nm);
    return found;
  }

 private:
  std::string path_;
  void* handle_;
};

/// A variable of the environment for the life of this object.
class Variable {
 public:
  Variable(const char* name, const std::string& value) : name_(name) { ::setenv(name, value.c_str(), 1); }
  ~Variable() { ::unsetenv(name_); }
  Variable(const Variable&) = delete;
  Variable& operator=(const Variable&) = delete;

 private:
  const char* name_;
};

}  // namespace espalier::test
