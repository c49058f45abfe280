#include "dynamics/model/run/restart.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <cstring>

#include "base/checksum.hpp"
#include "base/output_file.hpp"
#include "matrix/file.hpp"
#include "solver/session/build_info.hpp"

namespace espalier::dynamics::model {
namespace {

constexpr char kMagic[16] = "ESPALIER-RST-4\n";
constexpr std::string_view kAnyFormat = "ESPALIER-RST-";
constexpr std::size_t kChecked = sizeof kMagic + 8;  // the checksum covers everything from here on

struct Counts {
  std::uint64_t text_bytes = 0, numbers = 0, configuration = 0, velocity = 0, constraints = 0;
};

/// What stands in the text of a file.
struct Text {
  std::string version;
  std::vector<std::string> components;
  ModelKeys keys;
};

Counts counts_of(const Mechanism& mechanism) {
  const Sizes s = mechanism.system.sizes();
  return {0, 0, static_cast<std::uint64_t>(s.configuration), static_cast<std::uint64_t>(s.velocity),
          static_cast<std::uint64_t>(s.constraints)};
}

std::vector<std::string> component_names(const Mechanism& mechanism) {
  std::vector<std::string> names;
  for (const auto& component : mechanism.system.components()) names.push_back(component->name());
  return names;
}

std::string encode(const Mechanism& mechanism) {
  std::string text = std::string(solver::version()) + '\0';
  for (const std::string& name : component_names(mechanism)) text += name + '\0';
  text += '\0';
  for (const auto& [key, value] : mechanism.keys) text.append(key).append(1, '\0').append(value).append(1, '\0');
  text += '\0';
  text.resize((text.size() + 7) / 8 * 8);
  return text;
}

/// The texts of a file that passed its checksum; what is malformed all the same comes out as other names and keys.
Text decode(std::string_view text) {
  const auto take = [&text] {
    const std::size_t end = std::min(text.find('\0'), text.size());
    std::string part(text.substr(0, end));
    text.remove_prefix(std::min(end + 1, text.size()));
    return part;
  };
  Text result;
  result.version = take();
  for (std::string name = take(); !name.empty(); name = take()) result.components.push_back(std::move(name));
  for (std::string key = take(); !key.empty(); key = take()) result.keys.emplace_back(std::move(key), take());
  return result;
}

/// The bytes of a restart file, checked in themselves.
class RestartFile {
 public:
  RestartFile(std::string name, std::string_view bytes) : name_(std::move(name)), bytes_(bytes) {
    if (!bytes_.starts_with(kAnyFormat)) refuse("this is not a restart file");
    if (bytes_.size() < kChecked + sizeof(Counts)) refuse("the file ends too early");
    if (std::memcmp(bytes_.data(), kMagic, sizeof kMagic) != 0)
      refuse(fmt::format(
          "its layout is another one ({}), or it is damaged; this program reads {}: go on with the version "
          "that wrote it, or run again",
          bytes_.substr(0, std::min(bytes_.find('\n'), kAnyFormat.size() + 1)), std::string_view(kMagic, 14)));
    std::memcpy(&counts_, bytes_.data() + kChecked, sizeof counts_);
    const std::size_t rest = bytes_.size() - kChecked - sizeof counts_;
    if (counts_.text_bytes > rest || counts_.numbers > rest / 8 || rest - counts_.text_bytes != 8 * counts_.numbers)
      refuse("the file ends too early, or is damaged");
    std::uint64_t expected = 0;
    std::memcpy(&expected, bytes_.data() + sizeof kMagic, sizeof expected);
    if (expected != base::checksum(bytes_.data() + kChecked, bytes_.size() - kChecked))
      refuse("the checksum does not match: the file is damaged; take an older one, or run again");
    const char* text = bytes_.data() + kChecked + sizeof counts_;
    text_ = decode({text, counts_.text_bytes});
    numbers_.resize(counts_.numbers);
    if (!numbers_.empty()) std::memcpy(numbers_.data(), text + counts_.text_bytes, 8 * numbers_.size());
  }

  [[noreturn]] void refuse(const std::string& what) const {
    throw Error(StatusCode::invalid_input, fmt::format("{}: {}", name_, what));
  }
  /// @return what differs, where that is accepted
  [[nodiscard]] std::vector<std::string> compare(const Mechanism& mechanism, bool accept_changes) const {
    const Counts here = counts_of(mechanism);
    std::vector<std::string> differ = differences(text_.keys, mechanism.keys);
    const bool fits = counts_.configuration == here.configuration && counts_.velocity == here.velocity &&
                      counts_.constraints == here.constraints && text_.components == component_names(mechanism);
    if (fits && (differ.empty() || accept_changes)) return differ;
    std::string list;
    constexpr std::size_t kShown = 12;
    for (std::size_t k = 0; k < std::min(kShown, differ.size()); ++k) list += "\n          " + differ[k];
    if (differ.size() > kShown) list += fmt::format("\n          and {} more", differ.size() - kShown);
    if (!fits)
      refuse(
          fmt::format("it belongs to another model ({} velocities and {} constraints there, {} and {} here, or bodies "
                      "and joints of other names or order); give the same model and the same --set{}",
                      counts_.velocity, counts_.constraints, here.velocity, here.constraints, list));
    refuse(
        fmt::format("it belongs to another model; give the same model and the same --set, or --accept-changes to go on "
                    "with what differs:{}",
                    list));
  }
  void restore(Mechanism& mechanism, Integrator& integrator) const {
    ConstSpan rest = numbers_;
    try {
      integrator.restore(rest);
      mechanism.system.restore(rest);
    } catch (const Error& error) {
      refuse(error.what());
    }
    if (!rest.empty()) refuse("the file holds more numbers than this model takes; was the integrator changed?");
  }

 private:
  std::string name_;
  std::string_view bytes_;
  Counts counts_;
  Text text_;
  std::vector<double> numbers_;
};

}  // namespace

std::string restart_bytes(Mechanism& mechanism, Integrator& integrator) {
  std::vector<double> numbers;
  integrator.save(numbers);
  mechanism.system.save(numbers);
  const std::string text = encode(mechanism);
  Counts counts = counts_of(mechanism);
  counts.text_bytes = text.size();
  counts.numbers = numbers.size();
  const std::array<std::string_view, 3> parts = {
      std::string_view(reinterpret_cast<const char*>(&counts), sizeof counts), text,
      std::string_view(reinterpret_cast<const char*>(numbers.data()), 8 * numbers.size())};
  base::Checksum sum;
  for (const std::string_view part : parts) sum.add(part.data(), part.size());
  const std::uint64_t checksum = sum.value();
  std::string bytes(kMagic, sizeof kMagic);
  bytes.append(reinterpret_cast<const char*>(&checksum), sizeof checksum);
  for (const std::string_view part : parts) bytes += part;
  return bytes;
}

void write_restart(const std::string& path, Mechanism& mechanism, Integrator& integrator) {
  const std::string bytes = restart_bytes(mechanism, integrator);
  base::OutputFile out(path, base::OutputFile::Durability::power_failure);
  out.write(bytes);
  out.commit();
}

void take_restart_bytes(std::string_view bytes, const std::string& name, Mechanism& mechanism, Integrator& integrator) {
  const RestartFile file(name, bytes);
  (void)file.compare(mechanism, false);
  file.restore(mechanism, integrator);
}

std::vector<std::string> read_restart(const std::string& path, bool accept_changes, Mechanism& mechanism,
                                      Integrator& integrator) {
  const matrix::FileBytes bytes(path, kAnyFormat);
  const RestartFile file("restart file " + path, bytes.bytes());
  std::vector<std::string> accepted = file.compare(mechanism, accept_changes);
  file.restore(mechanism, integrator);
  return accepted;
}

}  // namespace espalier::dynamics::model
