/// \file
/// Streams of texts: alike in every language, and with an exception where there is no memory, instead of an early end.
#pragma once

#include <ios>
#include <locale>
#include <sstream>
#include <string>

namespace espalier::base {

template <class Stream>
class TextStream : public Stream {
 public:
  explicit TextStream(const std::string& text = {}) : Stream(text) {
    this->imbue(std::locale::classic());
    this->exceptions(std::ios::badbit);
  }
};

using TextReader = TextStream<std::istringstream>;
using TextWriter = TextStream<std::ostringstream>;

}  // namespace espalier::base
