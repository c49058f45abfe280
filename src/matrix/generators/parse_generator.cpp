#include <fmt/format.h>

#include <array>
#include <vector>

#include "base/at.hpp"
#include "matrix/generators/generate.hpp"
#include "matrix/text.hpp"

namespace espalier::matrix {

namespace {

// How the words of a family are read.
struct Form {
  const char* name;
  Family family;
  bool bodies;     // the number of bodies comes before the sizes
  bool redundant;  // the number of redundant rows comes first
  int dimensions;  // sizes
  const char* usage;
};

constexpr std::array kForms{
    Form{"elasticity", Family::elasticity, false, false, 3, "elasticity NX [NY NZ]        3-D elasticity, clamped box"},
    Form{"plate", Family::plate, false, false, 2,
         "plate NX [NY]                thin plate, one layer of thickness 0.3"},
    Form{"shell", Family::shell, false, false, 2,
         "shell NX [NY]                cylindrical roof, one layer of thickness 0.3"},
    Form{"poisson", Family::poisson, false, false, 3, "poisson NX [NY NZ]           3-D Poisson, 7 points"},
    Form{"kkt", Family::kkt, true, false, 3,
         "kkt BODIES [NX NY NZ]        chain of flexible bodies (20 8 8 elements each)"},
    Form{"kkt-scaled", Family::kkt_scaled, true, false, 3,
         "kkt-scaled BODIES [NX NY NZ] the chain with rows and columns scaled over 12 decades"},
    Form{"kkt-redundant", Family::kkt_redundant, true, true, 3,
         "kkt-redundant K BODIES [NX NY NZ]  the chain with K redundant constraints"},
    Form{"gyroscopic", Family::gyroscopic, false, false, 3,
         "gyroscopic NX [NY NZ]        elasticity that spins: unsymmetric"},
    Form{"elasticity-mass", Family::elasticity_mass, false, false, 3,
         "elasticity-mass NX [NY NZ]   the mass matrix of elasticity NX [NY NZ]"},
};

[[noreturn]] void refuse(const std::string& what) {
  throw Error(StatusCode::invalid_input, fmt::format("{}; known systems:\n{}", what, generator_usage()));
}

const Form& form_of(const std::string& word) {
  const std::string name = lower_case(word);
  for (const auto& form : kForms)
    if (name == form.name || (name == "gyro" && form.family == Family::gyroscopic)) return form;
  refuse(fmt::format("'{}' is not a generated system", word));
}

const Form& form_of(Family family) {
  for (const auto& form : kForms)
    if (form.family == family) return form;
  throw std::invalid_argument("an unknown family of generated systems");
}

// The sizes in the words after the first; "20x8x8" counts as three.
std::vector<Index> sizes_of(std::span<const std::string> words) {
  constexpr std::int64_t kMost = 1'000'000'000;
  std::vector<Index> sizes;
  for (const auto& word : words) {
    const char* p = word.data();
    const char* end = p + word.size();
    for (;;) {
      std::int64_t value = 0;
      const ScanError error = scan_integer(p, end, value);
      const bool separated = p == end || *p == 'x' || *p == 'X';
      if (error != ScanError::none || !separated) refuse(fmt::format("'{}' is not a size", word));
      if (value < 1 || value > kMost) refuse(fmt::format("size {} is outside 1..{}", value, kMost));
      sizes.push_back(static_cast<Index>(value));
      if (p == end) break;
      ++p;
    }
  }
  return sizes;
}

}  // namespace

std::string generator_usage() {
  std::string usage;
  for (const auto& form : kForms) usage += fmt::format("  {}\n", form.usage);
  return usage;
}

GeneratorSpec parse_generator(std::span<const std::string> words) {
  if (words.empty()) refuse("no system was named");
  const Form& form = form_of(words[0]);
  const auto all = sizes_of(words.subspan(1));
  std::span<const Index> sizes(all);
  GeneratorSpec spec;
  spec.family = form.family;
  const auto take = [&](const char* what) {
    if (sizes.empty()) refuse(fmt::format("'{}' needs the number of {}", form.name, what));
    const Index value = sizes.front();
    sizes = sizes.subspan(1);
    return value;
  };
  if (form.redundant) spec.redundant = take("redundant rows");
  if (form.bodies) spec.bodies = take("bodies");
  const auto dimensions = at(form.dimensions);
  if (form.bodies && sizes.empty()) {
    spec.nx = 20, spec.ny = 8, spec.nz = 8;
  } else if (!form.bodies && sizes.size() == 1) {
    spec.nx = spec.ny = spec.nz = sizes[0];
  } else if (sizes.size() == dimensions) {
    spec.nx = sizes[0], spec.ny = sizes[1], spec.nz = dimensions == 3 ? sizes[2] : 1;
  } else {
    refuse(fmt::format("'{}' takes {} sizes of its grid, found {}", form.name, dimensions, sizes.size()));
  }
  if (dimensions == 2) spec.nz = 1;
  return spec;
}

std::string describe(const GeneratorSpec& spec) {
  const Form& form = form_of(spec.family);
  std::string text = form.name;
  if (form.redundant) text += fmt::format(" {}", spec.redundant);
  if (form.bodies) text += fmt::format(" {}", spec.bodies);
  text += fmt::format(" {} {}", spec.nx, spec.ny);
  if (form.dimensions == 3) text += fmt::format(" {}", spec.nz);
  return text;
}

}  // namespace espalier::matrix
