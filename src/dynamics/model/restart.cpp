#include "dynamics/model/restart.hpp"

#include <fmt/format.h>

#include <cstring>
#include <filesystem>
#include <fstream>

#include "base/output_file.hpp"

namespace espalier::dynamics::model {
namespace {

constexpr char kMagic[16] = "ESPALIER-RST-2\n";

/// What a file must agree on with the model: sizes, and the names of all components.
std::vector<std::uint64_t> identity(const Mechanism& mechanism) {
  std::uint64_t hash = 1469598103934665603ULL;  // FNV-1a
  for (const auto& component : mechanism.system.components())
    for (const char c : component->name() + '\n') hash = (hash ^ static_cast<unsigned char>(c)) * 1099511628211ULL;
  const Sizes s = mechanism.system.sizes();
  return {static_cast<std::uint64_t>(s.configuration), static_cast<std::uint64_t>(s.velocity),
          static_cast<std::uint64_t>(s.constraints), hash};
}

}  // namespace

void write_restart(const std::string& path, Mechanism& mechanism, Integrator& integrator) {
  std::vector<double> numbers;
  integrator.save(numbers);
  for (const auto& component : mechanism.system.components()) component->save(numbers);
  const std::vector<std::uint64_t> head = identity(mechanism);
  const std::uint64_t count = numbers.size();
  base::OutputFile out(path);
  out.write({kMagic, sizeof kMagic});
  out.write({reinterpret_cast<const char*>(head.data()), 8 * head.size()});
  out.write({reinterpret_cast<const char*>(&count), 8});
  out.write({reinterpret_cast<const char*>(numbers.data()), 8 * numbers.size()});
  out.commit();
}

void read_restart(const std::string& path, Mechanism& mechanism, Integrator& integrator) {
  const auto refuse = [&path](const std::string& what) { throw Error(StatusCode::invalid_input, path + ": " + what); };
  std::ifstream in(path, std::ios::binary);
  if (!in) refuse("cannot read the restart file");
  char magic[sizeof kMagic] = {};
  in.read(magic, sizeof magic);
  if (!in || std::memcmp(magic, kMagic, sizeof kMagic) != 0) refuse("this is not a restart file of this version");
  const std::vector<std::uint64_t> expected = identity(mechanism);
  std::vector<std::uint64_t> head(expected.size() + 1);
  in.read(reinterpret_cast<char*>(head.data()), static_cast<std::streamsize>(8 * head.size()));
  if (!in) refuse("the file ends too early");
  const std::uint64_t count = head.back();
  head.pop_back();
  if (head != expected)
    refuse(
        fmt::format("it belongs to another model ({} velocities and {} constraints there, {} and {} here, or other "
                    "names); give the same model and the same --set",
                    head[1], head[2], expected[1], expected[2]));
  if (count > std::filesystem::file_size(path) / 8) refuse("the file ends too early");
  std::vector<double> numbers(count);
  in.read(reinterpret_cast<char*>(numbers.data()), static_cast<std::streamsize>(8 * count));
  if (!in) refuse("the file ends too early");
  ConstSpan rest = numbers;
  try {
    integrator.restore(rest);
    for (const auto& component : mechanism.system.components()) component->restore(rest);
  } catch (const Error& error) {
    refuse(error.what());
  }
  if (!rest.empty()) refuse("the file holds more numbers than this model takes; was the integrator changed?");
}

}  // namespace espalier::dynamics::model
