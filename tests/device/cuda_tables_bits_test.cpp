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

namespace espalier {
namespace {

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
  [[nodiscard]] const std::vector<plan::Task>& order() const override { return tables().order(); }
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
                                                     {{"1", 0xd999466da61d12c9ULL},
                                                      {"1 apart", 0xd999466da61d12c9ULL},
                                                      {"1 most", 0xc6df0aff3ddedba6ULL},
                                                      {"1 little", 0x7120354d1a066925ULL},
                                                      {"2", 0xa008101250cbda9eULL},
                                                      {"2 apart", 0x331e1e25971720e6ULL},
                                                      {"2 most", 0x6a0f0c86a574688dULL},
                                                      {"2 little", 0xef4c1efc006e9b1ULL},
                                                      {"2 stealing", 0xd4f320673727a29aULL},
                                                      {"2 stealing apart", 0xc5a3124c8413b5dfULL},
                                                      {"5", 0x6fde14e83d4c21afULL},
                                                      {"5 apart", 0x16e8e88a2d2509caULL},
                                                      {"5 most", 0x548d0bc9778380dbULL},
                                                      {"5 little", 0x8356fc4bdf9133b2ULL},
                                                      {"5 stealing", 0xc8bd41b86b82dcd3ULL},
                                                      {"5 stealing apart", 0xbac39e38cd4cd9ccULL}}},
                                           Parameter{{"elasticity", "9"},
                                                     Kind::ldlt,
                                                     {{"1", 0x23c7bac7cdb50876ULL},
                                                      {"1 apart", 0x23c7bac7cdb50876ULL},
                                                      {"1 most", 0xa906e87fb89eeeccULL},
                                                      {"1 little", 0x16cf442bcf913561ULL},
                                                      {"2", 0xccba9b13c82dcc18ULL},
                                                      {"2 apart", 0xd910bad4dc05f5caULL},
                                                      {"2 most", 0xb0334af690efa3abULL},
                                                      {"2 little", 0x76dd2190874945bfULL},
                                                      {"2 stealing", 0x78166dc92acce74cULL},
                                                      {"2 stealing apart", 0xd9297a7a7d1f926eULL},
                                                      {"5", 0xfb0d82d30c0b56c6ULL},
                                                      {"5 apart", 0x33267d7677f93cafULL},
                                                      {"5 most", 0x86b007afc8847c28ULL},
                                                      {"5 little", 0xb043668d5d71e5baULL},
                                                      {"5 stealing", 0xfeef877de1c835f8ULL},
                                                      {"5 stealing apart", 0x23ecdf6a8740d5b8ULL}}},
                                           Parameter{{"plate", "40", "40"},
                                                     Kind::llt,
                                                     {{"1", 0x8bd95a1f58a8680bULL},
                                                      {"1 apart", 0x8bd95a1f58a8680bULL},
                                                      {"1 most", 0x17cff00daae07cddULL},
                                                      {"1 little", 0x44c9b9fce1a25b93ULL},
                                                      {"2", 0xffd3abbdbbcd7cfULL},
                                                      {"2 apart", 0x313e15e84ca66704ULL},
                                                      {"2 most", 0x2f83097d20ff226dULL},
                                                      {"2 little", 0x679f3ff2eebfa1b4ULL},
                                                      {"2 stealing", 0x1f91fd98aaef102aULL},
                                                      {"2 stealing apart", 0xc8fc00eb8c6ab47bULL},
                                                      {"5", 0x926b03bb06d2a473ULL},
                                                      {"5 apart", 0xcae37d2bfb5d2734ULL},
                                                      {"5 most", 0x9bb770324610bcd4ULL},
                                                      {"5 little", 0x37cda7588ce9f36bULL},
                                                      {"5 stealing", 0x390b6de13adb93b0ULL},
                                                      {"5 stealing apart", 0x14aebe7771392955ULL}}},
                                           Parameter{{"gyroscopic", "8"},
                                                     Kind::lu,
                                                     {{"1", 0x7de49c966b8f2161ULL},
                                                      {"1 apart", 0x7de49c966b8f2161ULL},
                                                      {"1 most", 0xebad5c067b640e8fULL},
                                                      {"1 little", 0xc82e196c45b5e154ULL},
                                                      {"2", 0x6fc7a4bd6ab4f7ceULL},
                                                      {"2 apart", 0xe71f12c9c9c260e6ULL},
                                                      {"2 most", 0x16bdcb2f97e922c1ULL},
                                                      {"2 little", 0x7081a503e6c1373dULL},
                                                      {"2 stealing", 0x1a2515d287f1a8c4ULL},
                                                      {"2 stealing apart", 0xe6ab1010fb8156fdULL},
                                                      {"5", 0x778b8c60f9db3fd1ULL},
                                                      {"5 apart", 0x75b6a603c68bcbccULL},
                                                      {"5 most", 0xec3c065a78158a85ULL},
                                                      {"5 little", 0x2437c3d6c88d088cULL},
                                                      {"5 stealing", 0x9fbd85ca3b827ecdULL},
                                                      {"5 stealing apart", 0x6aa2033d1de4c2c9ULL}}}));

}  // namespace
}  // namespace espalier
