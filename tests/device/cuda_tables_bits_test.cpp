// The tables that the CUDA kernels read, in core and out of core, bit by bit, without a GPU. Truth: hashes made with
// the code of 98f6ff2, before layouts became an input of the plan and one lister served both (issue 15). A change of
// the tables that is meant changes them: a test that fails prints the new ones.
#include <gtest/gtest.h>

#include <cstdint>
#include <map>
#include <string>
#include <type_traits>
#include <vector>

#include "analysis/ordering.hpp"
#include "device/cuda/out_of_core/layout.hpp"
#include "device/cuda/tables/device_plan.hpp"
#include "matrix/generators/generate.hpp"
#include "out_of_core/plan.hpp"
#include "parameters.hpp"

namespace espalier {
namespace cuda_tables_bits_test {

using device::cuda::DevicePlan;
using device::cuda::OutOfCoreSource;

// FNV-1a, 64 bits (Fowler, Noll, Vo).
class Hash {
 public:
  template <class T>
  void add(const T& value) {
    static_assert(std::has_unique_object_representations_v<T>, "padding has no value");
    const auto* bytes = reinterpret_cast<const unsigned char*>(&value);
    for (std::size_t k = 0; k < sizeof(T); ++k) value_ = (value_ ^ bytes[k]) * 1099511628211ULL;
  }
  template <class List>
  void list(const List& values) {
    add(static_cast<std::uint64_t>(values.size()));
    for (const auto& v : values) add(v);
  }
  [[nodiscard]] std::uint64_t value() const { return value_; }

 private:
  std::uint64_t value_ = 14695981039346656037ULL;
};

void add_tables(const DevicePlan& d, Hash& h) {
  h.list(d.fronts);
  h.list(d.links);
  h.list(d.bounds);
  h.list(d.waits);
  for (const auto& l : d.lists) {
    h.list(l.tasks);
    h.list(l.up);
    h.list(l.down);
    h.list(l.inverses);
    h.list(l.stealable_end);
    for (const std::int64_t n : {l.narrow_tasks, l.small_up, l.small_down}) h.add(n);
  }
  h.list(d.regions);
  h.list(d.region_device);
  for (const auto& p : d.places) {
    h.add(p.device);
    h.add(p.offset);
  }
  h.list(d.place_space);
  h.add(d.flags);
  h.add(d.first_stealable);
}

// The planner's view of a GPU that is not there.
class Layout : public out_of_core::OutOfCoreLayout {
 public:
  Layout(const plan::Plan& plan, Kind kind) : source_(plan, kind, 8) {
    for (const auto& x : fronts()) {
      sizes_.factor.push_back((x.factor_size() + 15) / 16 * 16);
      sizes_.contribution.push_back((x.contribution_size() + 15) / 16 * 16);
    }
  }
  [[nodiscard]] const device::cuda::OutOfCoreTables& tables() const { return source_.tables; }
  [[nodiscard]] const plan::Plan& plan() const override { return source_.plan; }
  [[nodiscard]] Offset element_bytes() const override { return 8; }
  [[nodiscard]] const plan::TaskList& order() const override { return tables().order(); }
  [[nodiscard]] const plan::ArraySizes& sizes() const override { return sizes_; }
  [[nodiscard]] Offset factor_offset(Index f, Index column) const override {
    return column < fronts()[f].pivot_tiles ? fronts()[f].column_offset(column) : sizes_.factor[f];
  }
  [[nodiscard]] Offset contribution_offset(Index f, Index column) const override {
    const auto& x = fronts()[f];
    const int first = column * x.width;
    return column < x.tiles - x.pivot_tiles ? x.contribution_offset(first, first) : sizes_.contribution[f];
  }
  void slab(Index f, Index begin, Index end, Index row, std::vector<out_of_core::Extent>& extents) const override {
    const auto& x = fronts()[f];
    const int top = x.column_begin(row);
    for (Index j = begin; j < end; ++j)
      for (int q = x.column_begin(j) / 16; q < x.column_end(j) / 16; ++q)
        extents.push_back({x.chunk_offset(q, top), static_cast<Offset>(x.total_pad - top) * 16});
  }
  [[nodiscard]] Offset share_bytes(Index f) const override { return tables().share_bytes(f); }
  [[nodiscard]] Offset table_bytes(const out_of_core::InCoreStep& s) const override { return tables().tables(s).bytes; }
  [[nodiscard]] Offset scratch_bytes(const out_of_core::InCoreStep& s) const override {
    return tables().scratch(s).bytes;
  }
  [[nodiscard]] Offset output_bytes(const out_of_core::InCoreStep& s) const override {
    return tables().scratch(s).flags;
  }
  [[nodiscard]] Offset table_bytes(Index f, Index b, Index e) const override { return tables().tables(f, b, e).bytes; }
  [[nodiscard]] Offset scratch_bytes(Index f, Index b, Index e) const override {
    return tables().scratch(f, b, e).bytes;
  }
  [[nodiscard]] Offset output_bytes(Index f, Index b, Index e) const override {
    return tables().scratch(f, b, e).flags;
  }
  [[nodiscard]] bool copies_values() const override { return true; }
  [[nodiscard]] Offset solve_bytes(const std::vector<Index>& fronts, Index columns) const override {
    return device::cuda::PartTables::most_bytes(plan(), tables(), fronts, element_bytes(), columns);
  }

 private:
  [[nodiscard]] const std::vector<device::cuda::Front>& fronts() const { return tables().device_plan().fronts; }
  OutOfCoreSource source_;
  plan::ArraySizes sizes_;
};

void add_unit(const device::cuda::UnitTables& u, Hash& h) {
  h.list(u.bytes);
  for (const int n : {u.narrow_end, u.end, u.group_end, u.width}) h.add(n);
  const device::cuda::ScratchPlaces& s = u.scratch;
  for (const Offset n : {s.pivot, s.inverse_d, s.inverse_e, s.replaced, s.failed, s.control, s.flags, s.finished,
                         s.bytes, Offset{s.pivots}, s.part_flags, s.set_flags})
    h.add(n);
}

// Two devices with little memory each.
void add_out_of_core(const plan::Plan& plan, Kind kind, double part, Hash& h) {
  const Layout layout(plan, kind);
  const auto budget = static_cast<Offset>(part * 8 * static_cast<double>(plan.memory.size));
  for (const auto& p : out_of_core::plan_out_of_core(layout, {{budget, 1}, {budget, 0.5}})) {
    h.add(p.arena_bytes);
    for (const auto& s : p.steps)
      if (!s.fronts.empty()) add_unit(layout.tables().build(s), h);
    for (const auto& g : p.groups) add_unit(layout.tables().build(g), h);
    for (const auto& op : p.ops) {
      for (const Offset n :
           {Offset{op.unit}, Offset{op.front}, Offset{op.begin}, Offset{op.end}, op.at[0], op.host[0], op.bytes})
        h.add(n);
      h.list(op.waits);
    }
  }
}

struct Parameter {
  std::vector<std::string> words;
  Kind kind;
  std::map<std::string, std::uint64_t> hashes;
  friend void PrintTo(const Parameter& p, std::ostream* out) { test::print(*out, p.words, p.kind); }
};

class CudaTablesBits : public ::testing::TestWithParam<Parameter> {};

TEST_P(CudaTablesBits, AreThoseOfTheCodeBefore) {
  const auto& [words, kind, known_hashes] = GetParam();
  const auto& hashes = known_hashes;  // C++20: lambdas of the macros may not name a structured binding
  base::ThreadPool pool{2};
  const SparseMatrix a = matrix::generate(matrix::parse_generator(words), &pool);
  const auto tree = analysis::build_tree(analysis::graph_of(a, pool), {}, pool);
  const auto expect = [&](const std::string& name, const Hash& h) {
    const auto known = hashes.find(name);
    EXPECT_TRUE(known != hashes.end() && known->second == h.value())
        << "{\"" << name << "\", 0x" << std::hex << h.value() << "ULL},";
  };
  for (const Index devices : {1, 2, 5})
    for (const bool stealing : {false, true}) {
      if (devices == 1 && stealing) continue;
      device::cuda::DeviceTuning tuning;
      tuning.narrow_rows = 300;  // small systems, too, shall have wide fronts
      tuning.stealing = stealing;
      const auto plan = plan::make_plan(tree, a, {}, device::cuda::cuda_plan_options(kind, tuning, devices), pool);
      for (const bool peer_access : {true, false}) {
        Hash h;
        add_tables(device::cuda::make_device_plan(plan, kind, peer_access, {}, &pool), h);
        expect(std::to_string(devices) + (stealing ? " stealing" : "") + (peer_access ? "" : " apart"), h);
      }
      if (stealing) continue;
      for (const double part : {0.8, 0.3}) {
        Hash h;
        add_out_of_core(plan, kind, part, h);
        expect(std::to_string(devices) + (part > 0.5 ? " most" : " little"), h);
      }
    }
}

INSTANTIATE_TEST_SUITE_P(Systems, CudaTablesBits,
                         ::testing::Values(Parameter{{"elasticity", "9"},
                                                     Kind::llt,
                                                     {{"1", 0xc6e3c879fde7a0a5ULL},
                                                      {"1 apart", 0xc6e3c879fde7a0a5ULL},
                                                      {"1 most", 0x50fa0db93d2a79edULL},
                                                      {"1 little", 0xa5e46d3d41808c0bULL},
                                                      {"2", 0x8f05f05c8f9b19eaULL},
                                                      {"2 apart", 0x4c6761ac940eec10ULL},
                                                      {"2 most", 0x5f8a978c3122e507ULL},
                                                      {"2 little", 0x89e0cc850e1c59afULL},
                                                      {"2 stealing", 0x61b4f3e991495151ULL},
                                                      {"2 stealing apart", 0x383998bea17dc98bULL},
                                                      {"5", 0x3433a8c27f8d49d3ULL},
                                                      {"5 apart", 0x7a57c265a8fed133ULL},
                                                      {"5 most", 0x3bf958efc2000c63ULL},
                                                      {"5 little", 0x59c7819192567bcULL},
                                                      {"5 stealing", 0x9bda6acc29e1587fULL},
                                                      {"5 stealing apart", 0x69d0c163dd31b1a8ULL}}},
                                           Parameter{{"elasticity", "9"},
                                                     Kind::ldlt,
                                                     {{"1", 0xf0eed895e537bbaeULL},
                                                      {"1 apart", 0xf0eed895e537bbaeULL},
                                                      {"1 most", 0x6684e285f22b0c6cULL},
                                                      {"1 little", 0x29eda866d5cb2ae1ULL},
                                                      {"2", 0x5c50074bdae444b1ULL},
                                                      {"2 apart", 0xcca098043ba30b63ULL},
                                                      {"2 most", 0xa1525fd35a0bb24cULL},
                                                      {"2 little", 0xfc843d8dbee2c69bULL},
                                                      {"2 stealing", 0x2a83a81c394ef389ULL},
                                                      {"2 stealing apart", 0x385e5c1994a045fbULL},
                                                      {"5", 0x411ba9aa0b99b13aULL},
                                                      {"5 apart", 0x58df976c583c589dULL},
                                                      {"5 most", 0x353cb81576e4a4fdULL},
                                                      {"5 little", 0x6ce2a28079fd0399ULL},
                                                      {"5 stealing", 0xfcac78c3358286f8ULL},
                                                      {"5 stealing apart", 0x694ce471197490feULL}}},
                                           Parameter{{"plate", "40", "40"},
                                                     Kind::llt,
                                                     {{"1", 0xab9bcafbc120b5beULL},
                                                      {"1 apart", 0xab9bcafbc120b5beULL},
                                                      {"1 most", 0xacde21872af8e0b9ULL},
                                                      {"1 little", 0x50f4277425f49c8dULL},
                                                      {"2", 0x22ad488deb191e61ULL},
                                                      {"2 apart", 0x1af3021ba06ed1dcULL},
                                                      {"2 most", 0x272a46ecc7d03e9bULL},
                                                      {"2 little", 0x29049c3bb95d5984ULL},
                                                      {"2 stealing", 0x9740cf6288ae034bULL},
                                                      {"2 stealing apart", 0x8e72ea67b568cc1aULL},
                                                      {"5", 0x34d6482a35bda64fULL},
                                                      {"5 apart", 0xd74e87d590c7bb72ULL},
                                                      {"5 most", 0xd64a95746c9bcef8ULL},
                                                      {"5 little", 0xa2523769eca40d16ULL},
                                                      {"5 stealing", 0x79af0b8adc6695f1ULL},
                                                      {"5 stealing apart", 0x9c8337933c001d4aULL}}},
                                           Parameter{{"gyroscopic", "8"},
                                                     Kind::lu,
                                                     {{"1", 0x2d75d24a267618ecULL},
                                                      {"1 apart", 0x2d75d24a267618ecULL},
                                                      {"1 most", 0xcd46a0add194f9d0ULL},
                                                      {"1 little", 0x340c101b66e0f73eULL},
                                                      {"2", 0xc1f66d61240a4d53ULL},
                                                      {"2 apart", 0xf7d1d4211102255fULL},
                                                      {"2 most", 0xef35ca94bdd45338ULL},
                                                      {"2 little", 0x6613d6d49b1d58a8ULL},
                                                      {"2 stealing", 0x79114f7ae6557886ULL},
                                                      {"2 stealing apart", 0xda57b87c75f42d72ULL},
                                                      {"5", 0xde1e5b404b32b9b4ULL},
                                                      {"5 apart", 0xc17f079c99b6073ULL},
                                                      {"5 most", 0xd25273ecb7a689dcULL},
                                                      {"5 little", 0xe69ec072b413e7a1ULL},
                                                      {"5 stealing", 0x18581f09591a030fULL},
                                                      {"5 stealing apart", 0xb96d62090b294a56ULL}}}));

}  // namespace cuda_tables_bits_test
}  // namespace espalier
