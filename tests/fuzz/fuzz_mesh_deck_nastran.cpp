// Arbitrary bytes as a deck of Nastran, see fuzz_deck.hpp.
#include "fuzz/fuzz_deck.hpp"

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  return espalier::dynamics::fuzz_deck(espalier::dynamics::parse_nastran_deck, data, size);
}
