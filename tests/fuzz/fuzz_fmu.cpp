// Arbitrary bytes as an FMU, as its description, and as what our own FMUs hold: each is read or refused, with no more
// memory than the bytes justify.
#include <cstddef>
#include <cstdint>
#include <cstdlib>
#include <string>

#include "espalier/types.hpp"
#include "fmi/contents.hpp"
#include "fmi/model_description.hpp"
#include "fmi/zip.hpp"

namespace {

template <class Action>
void read_or_refuse(const Action& action) {
  try {
    action();
  } catch (const espalier::Error& error) {
    if (std::string(error.what()).empty()) std::abort();
  }
}

}  // namespace

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  using namespace espalier::fmi;
  const std::string bytes(reinterpret_cast<const char*>(data), size);
  read_or_refuse([&] {
    const ZipArchive archive("fuzz.fmu", bytes, std::uint64_t{1} << 28);
    for (const std::string& name : archive.names())
      read_or_refuse([&] {
        const std::string content = archive.read(name);
        if (content.size() > 1100 * size + 64) std::abort();
        (void)read_description(content, "fuzz.fmu");
      });
  });
  read_or_refuse([&] { (void)read_description(bytes, "fuzz.fmu"); });
  read_or_refuse([&] {
    const Contents contents = parse_contents(bytes);
    if (to_text(parse_contents(to_text(contents))) != to_text(contents)) std::abort();
  });
  return 0;
}
