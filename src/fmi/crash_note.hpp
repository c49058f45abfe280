/// \file
/// Who is to blame when the program dies: a line on stderr, where a fault happens within a call of a foreign library.
#pragma once

#include <string>

namespace espalier::fmi {

/// While it lives, a fault of this thread (SIGSEGV, SIGBUS, SIGFPE, SIGILL, SIGABRT) says "TITLE: crashed in FUNCTION"
/// before it takes its way.
class CrashNote {
 public:
  /// Both must outlive it.
  CrashNote(const std::string& title, const char* function);
  ~CrashNote();
  CrashNote(const CrashNote&) = delete;
  CrashNote& operator=(const CrashNote&) = delete;

 private:
  const char *title_before_, *function_before_;
};

}  // namespace espalier::fmi
