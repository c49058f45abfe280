#include "dynamics/device/divided_body.hpp"

#include <algorithm>
#include <utility>
#include <vector>

#include "base/at.hpp"
#include "base/parallel.hpp"

namespace espalier::dynamics {

namespace {

class DividedBody final : public DeviceBody {
 public:
  DividedBody(std::vector<BodySubdomain> parts, base::ThreadPool* pool, const MakePart& make) : pool_(pool) {
    for (BodySubdomain& part : parts) {
      SubdomainOnGpu there = make(part);
      parts_.push_back({std::move(part), std::move(there), {}, {}});
    }
  }

  void bind(std::span<const Offset> column_start, std::span<const std::int32_t> shift) override {
    for (Subdomain& part : parts_) {
      if (part.there.first)
        bind_in_place(part, column_start, shift);
      else
        bind_apart(part, column_start, shift);
      // What is not looked at again.
      part.of.groups = {};
      part.of.pattern = {};
      part.of.entries = {};
      part.of.reference = part.of.mass = {};
    }
  }

  void start_forces(const BodyState& state) override {
    for (Subdomain& part : parts_) part.there.body->start_forces(of_part(part, state));
  }

  Offset finish_forces(double load, const double* /*weight*/, double* f) override {
    Offset inverted = -1;
    for (Subdomain& part : parts_) {
      part.forces.assign(3 * part.of.vertices.size(), 0.0);
      note(inverted, part, part.there.body->finish_forces(load, part.of.weight.data(), part.forces.data()));
      for_each_of(part.of.own, [&](std::size_t, std::size_t local) {
        for (std::size_t i = 0; i < 3; ++i) f[3 * at(part.of.vertices[local]) + i] += part.forces[3 * local + i];
      });
    }
    return inverted;
  }

  void put_forces(double load, double* f) override {
    for (Subdomain& part : parts_) {
      part.there.body->put_forces(load, part.there.carrier->forces());
      part.there.carrier->take_forces(f);
    }
  }

  void start_tangent(const BodyState& state, const TangentWeights& weights, double* values) override {
    for (Subdomain& part : parts_) {
      PartCarrier& carrier = *part.there.carrier;
      part.there.body->start_tangent(of_part(part, state), weights, carrier.values(values));
      carrier.take_values(values);
    }
  }

  Offset finish() override {
    Offset inverted = -1;
    for (Subdomain& part : parts_) {
      note(inverted, part, part.there.body->finish());
      part.there.carrier->finish();
    }
    return inverted;
  }

 private:
  struct Subdomain {
    BodySubdomain of;
    SubdomainOnGpu there;
    std::vector<double> state;   // of the host, on its way: q, v, a
    std::vector<double> forces;  // likewise
  };

  // use(k, list[k])
  template <class Use>
  void for_each_of(const std::vector<Index>& list, const Use& use) const {
    constexpr std::int64_t kVertices = 4096;  // some ten microseconds
    base::for_each_range(pool_, std::ssize(list), kVertices, [&](std::int64_t begin, std::int64_t end) {
      for (auto k = at(begin); k < at(end); ++k) use(k, at(list[k]));
    });
  }

  BodyState of_part(Subdomain& part, const BodyState& body) const {
    if (body.there) return part.there.carrier->bring(body);
    const std::size_t numbers = 3 * part.of.vertices.size();
    part.state.resize(3 * numbers);
    const auto gathered = [&](const double* from, std::size_t place) -> const double* {
      if (from == nullptr) return nullptr;
      double* const to = part.state.data() + place * numbers;
      for_each_of(part.of.vertices,
                  [&](std::size_t k, std::size_t vertex) { std::copy_n(from + 3 * vertex, 3, to + 3 * k); });
      return to;
    };
    return {gathered(body.q, 0), gathered(body.v, 1), gathered(body.a, 2), false};
  }

  static void note(Offset& inverted, const Subdomain& part, Offset found) {
    if (found < 0) return;
    const Offset element = part.of.elements[at(found)];
    inverted = inverted < 0 ? element : std::min(inverted, element);
  }

  // visit(entry of the part, its local column, j) for each column of a block, column by column.
  template <class Visit>
  static void for_each_piece(const BodySubdomain& part, const Visit& visit) {
    for (const Index c : part.own)
      for (int j = 0; j < 3; ++j)
        for (Offset e = part.pattern.ptr[at(c)]; e < part.pattern.ptr[at(c) + 1]; ++e) visit(e, c, j);
  }

  static Offset position(const BodySubdomain& part, Offset e, Index c, int j, std::span<const Offset> column_start,
                         std::span<const std::int32_t> shift) {
    return column_start[3 * at(part.vertices[at(c)]) + at(j)] + shift[3 * at(part.entries[at(e)]) + at(j)];
  }

  static void bind_in_place(Subdomain& part, std::span<const Offset> column_start,
                            std::span<const std::int32_t> shift) {
    std::vector<Offset> starts(3 * part.of.vertices.size());
    std::vector<std::int32_t> shifts(3 * part.of.entries.size());
    for_each_piece(part.of, [&](Offset e, Index c, int j) {
      starts[3 * at(c) + at(j)] = column_start[3 * at(part.of.vertices[at(c)]) + at(j)];
      shifts[3 * at(e) + at(j)] = shift[3 * at(part.of.entries[at(e)]) + at(j)];
    });
    part.there.body->bind(starts, shifts);
  }

  static void bind_apart(Subdomain& part, std::span<const Offset> column_start, std::span<const std::int32_t> shift) {
    std::vector<Offset> starts(3 * part.of.vertices.size()), positions;
    std::vector<std::int32_t> shifts(3 * part.of.entries.size());
    for_each_piece(part.of, [&](Offset e, Index c, int j) {
      const Offset here = 3 * static_cast<Offset>(positions.size());
      Offset& start = starts[3 * at(c) + at(j)];
      if (e == part.of.pattern.ptr[at(c)]) start = here;
      shifts[3 * at(e) + at(j)] = static_cast<std::int32_t>(here - start);
      positions.push_back(position(part.of, e, c, j, column_start, shift));
    });
    part.there.body->bind(starts, shifts);
    part.there.carrier->bind(positions);
  }

  base::ThreadPool* pool_;
  std::vector<Subdomain> parts_;
};

}  // namespace

std::unique_ptr<DeviceBody> make_divided_body(const DeviceBodyTables& body, const GpuPlaces& places, Index fewest,
                                              base::ThreadPool* pool, const MakePart& make) {
  if (places.gpus.size() < 2 || places.of_unknown.empty() || body.elements() < fewest) return nullptr;
  std::vector<Index> place_of_vertex(at(body.vertices()));
  for (Index v = 0; v < body.vertices(); ++v) place_of_vertex[at(v)] = places.of_unknown[at(body.first) + 3 * at(v)];
  if (std::all_of(place_of_vertex.begin(), place_of_vertex.end(), [](Index place) { return place == 0; }))
    return nullptr;
  return std::make_unique<DividedBody>(divide_body(body, place_of_vertex), pool, make);
}

}  // namespace espalier::dynamics
