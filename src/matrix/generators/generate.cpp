#include "matrix/generators/generate.hpp"

#include <fmt/format.h>

#include <limits>
#include <memory>
#include <numeric>

#include "base/memory.hpp"
#include "matrix/file.hpp"
#include "matrix/generators/families.hpp"
#include "matrix/generators/random.hpp"
#include "matrix/transform.hpp"

namespace espalier::matrix {

namespace {

constexpr double kPlateThickness = 0.3;

// Different draws of one seed.
enum class Stream : std::uint64_t { factors, numbering, scaling, redundancy };
std::uint64_t stream_seed(const GeneratorSpec& spec, Stream stream) {
  return random_bits(spec.seed, static_cast<std::uint64_t>(stream));
}

// Entries per unknown, stored, rounded up: 14 blocks of 3 x 3 in a lower triangle, 27 in a general matrix.
std::int64_t entries_per_unknown(Family f) {
  if (f == Family::gyroscopic) return 81;
  if (f == Family::elasticity_mass) return 14;
  return f == Family::poisson ? 4 : 42;
}

void check(const GeneratorSpec& spec) {
  if (spec.nx < 1 || spec.ny < 1 || spec.nz < 1 || spec.bodies < 1 || spec.redundant < 0)
    throw Error(StatusCode::invalid_input, fmt::format("'{}': sizes must be at least 1", describe(spec)));
  const std::int64_t n = unknowns(spec);
  if (n >= std::numeric_limits<Index>::max())
    throw Error(StatusCode::invalid_input,
                fmt::format("'{}' has 2^31 - 1 unknowns or more; fewer are supported", describe(spec)));
  constexpr std::int64_t kBytesPerEntry = sizeof(double) + sizeof(Index);
  const std::int64_t bytes = n * entries_per_unknown(spec.family) * kBytesPerEntry;
  if (bytes > machine_memory())
    throw Error(StatusCode::out_of_memory,
                fmt::format("'{}' has {} unknowns; its matrix would take about {}, this machine has {}", describe(spec),
                            n, base::format_bytes(bytes), base::format_bytes(machine_memory())));
}

std::unique_ptr<GroupModel> make_model(const GeneratorSpec& s) {
  const Randomness random{stream_seed(s, Stream::factors)};
  switch (s.family) {
    case Family::elasticity:
      return make_clamped_box({s.nx, s.ny, s.nz}, 1.0, random);
    case Family::plate:
      return make_clamped_box({s.nx, s.ny, 1}, kPlateThickness, random);
    case Family::shell:
      return make_shell(s.nx, s.ny, random);
    case Family::poisson:
      return make_poisson(s.nx, s.ny, s.nz);
    case Family::elasticity_mass:
      return make_clamped_box_mass({s.nx, s.ny, s.nz});
    case Family::gyroscopic:
      return make_gyroscopic({s.nx, s.ny, s.nz}, random);
    default:
      return make_kkt_chain(s.bodies, {s.nx, s.ny, s.nz}, random);
  }
}

std::vector<Index> natural_order(Index n) {
  std::vector<Index> order(at(n));
  std::iota(order.begin(), order.end(), 0);
  return order;
}

// Unknown order in which `triples` groups of three and `singles` groups of one (behind them) are shuffled.
std::vector<Index> shuffled_unknowns(Index triples, Index singles, std::uint64_t seed) {
  std::vector<Index> order;
  for (const Index group : random_permutation(triples + singles, seed)) {
    if (group < triples) {
      order.insert(order.end(), {3 * group, 3 * group + 1, 3 * group + 2});
    } else {
      order.push_back(3 * triples + group - triples);
    }
  }
  return order;
}

SparseMatrix generate_redundant(const GeneratorSpec& spec, const GroupModel& model, base::ThreadPool* pool) {
  const SparseMatrix chain = assemble_groups(model, natural_order(model.groups()), Storage::symmetric_lower, pool);
  SparseMatrix a = append_redundant_rows(chain, 3 * spec.bodies, spec.redundant, stream_seed(spec, Stream::redundancy));
  if (spec.numbering == Numbering::natural) return a;
  const auto order = shuffled_unknowns(model.groups(), spec.redundant, stream_seed(spec, Stream::numbering));
  return permute_symmetric(a, order, pool);
}

}  // namespace

std::int64_t unknowns(const GeneratorSpec& s) {
  // Saturates far above what check() accepts instead of overflowing.
  const auto product = [](std::initializer_list<std::int64_t> factors) {
    constexpr std::int64_t kMost = std::int64_t{1} << 60;
    std::int64_t p = 1;
    for (const std::int64_t f : factors) p = f > 0 && p > kMost / f ? kMost : p * f;
    return p;
  };
  const std::int64_t x = s.nx, y = s.ny, z = s.nz;
  switch (s.family) {
    case Family::poisson:
      return product({x, y, z});
    case Family::plate:
    case Family::shell:
      return product({3, x, y + 1, 2});
    case Family::elasticity:
    case Family::elasticity_mass:
    case Family::gyroscopic:
      return product({3, x, y + 1, z + 1});
    default:
      return product({3, s.bodies, product({x + 1, y + 1, z + 1}) + 1}) + s.redundant;
  }
}

SparseMatrix generate(const GeneratorSpec& spec, base::ThreadPool* pool) {
  check(spec);
  const auto model = make_model(spec);
  if (spec.family == Family::kkt_redundant) return generate_redundant(spec, *model, pool);
  const auto place = spec.numbering == Numbering::natural
                         ? natural_order(model->groups())
                         : random_permutation(model->groups(), stream_seed(spec, Stream::numbering));
  const Storage storage = spec.family == Family::gyroscopic ? Storage::general : Storage::symmetric_lower;
  SparseMatrix a = assemble_groups(*model, place, storage, pool);
  if (spec.family == Family::kkt_scaled) scale_badly(a, stream_seed(spec, Stream::scaling));
  return a;
}

}  // namespace espalier::matrix
