// Files of reduced matrices, and the one that says what their rows are.
#include <fmt/format.h>

#include "base/output_file.hpp"
#include "dynamics/page/json_text.hpp"
#include "dynamics/substructure/write_matrices.hpp"
#include "espalier/reduced_matrices.hpp"
#include "matrix/matrix_market.hpp"

namespace espalier {
namespace dynamics::model {
namespace {

constexpr int kNodeComponents = 6;

class ReducedWriter {
 public:
  ReducedWriter(const ReducedMatrices& r, const std::string& stem) : r_(r), stem_(stem) {
    for (const ReducedInterface& at : r.interfaces)
      for (int c = 1; c <= at.components; ++c) unknowns_.push_back({at.node, c});
    for (std::size_t k = 0; k < r.frequencies.size(); ++k)
      unknowns_.push_back({r.first_scalar + static_cast<std::int64_t>(k), 0});
    matrices_ = {square("KAA", r.stiffness), square("MAA", r.mass)};
    if (!r.damping.empty()) matrices_.push_back(square("BAA", r.damping));
  }

  std::vector<std::string> write(const ReducedFiles& wanted) {
    if (wanted.op4) write_file(".op4", output4_binary(with_shapes()));
    if (wanted.op4_text) write_file("_text.op4", output4_text(with_shapes()));
    if (wanted.dmig) write_file(".bdf", bulk_data());
    if (wanted.mtx) {
      market("_k.mtx", r_.stiffness, "stiffness");
      market("_m.mtx", r_.mass, "mass");
      if (!r_.damping.empty()) market("_c.mtx", r_.damping, "damping");
    }
    if (wanted.npz) write_file(".npz", arrays());
    write_file(".json", map());
    return files_;
  }

 private:
  [[nodiscard]] NamedMatrix square(const char* name, const std::vector<double>& values) const {
    return {name, r_.size, r_.size, values.data(), true};
  }
  [[nodiscard]] std::vector<NamedMatrix> with_shapes() const {
    std::vector<NamedMatrix> all = matrices_;
    all.push_back({"TGA", static_cast<Index>(r_.shapes.size()) / r_.size, r_.size, r_.shapes.data()});
    return all;
  }

  void write_file(const char* end, const std::string& content) {
    base::OutputFile out(stem_ + end);
    out.write(content);
    out.commit();
    files_.push_back(stem_ + end);
  }
  void market(const char* end, const std::vector<double>& values, const char* what) {
    matrix::write_matrix_market_vectors(stem_ + end, r_.size, r_.size, values,
                                        fmt::format("{} of '{}', reduced by espalier", what, r_.body));
    files_.push_back(stem_ + end);
  }

  [[nodiscard]] std::string bulk_data() const {
    std::string out = fmt::format(
        "$ '{}' reduced by espalier{}; axes: those of its mesh (basic system)\n"
        "$ case control: K2GG = KAA, M2GG = MAA{}\n"
        "$ KAAL, MAAL{} have the digits behind those that 16 characters hold: K2GG = KAA, KAAL adds them\n",
        r_.body, r_.units.empty() ? "" : ", units " + r_.units, r_.damping.empty() ? "" : ", B2GG = BAA",
        r_.damping.empty() ? "" : ", BAAL");
    for (const ReducedInterface& at : r_.interfaces) {
      out += fmt::format("$ {}\n{:<8}{:>16}{:>16}{:>16}{:>16}\n{:<8}{:>16}{:>16}{:>16}\n", at.name, "GRID*", at.node, 0,
                         nastran_field(at.position[0]), nastran_field(at.position[1]), "*",
                         nastran_field(at.position[2]), 0, at.components < kNodeComponents ? "456" : "");
    }
    const auto modes = static_cast<std::int64_t>(r_.frequencies.size());
    if (modes > 0)
      out += modes == 1 ? fmt::format("{:<8}{:>8}\n", "SPOINT", r_.first_scalar)
                        : fmt::format("{:<8}{:>8}{:>8}{:>8}\n", "SPOINT", r_.first_scalar, "THRU",
                                      r_.first_scalar + modes - 1);
    for (const NamedMatrix& m : matrices_) out += dmig_cards(m, unknowns_);
    return out;
  }

  [[nodiscard]] std::string arrays() const {
    std::vector<NamedArray> all;
    const auto real = [&](const char* name, const std::vector<double>& v, std::vector<std::size_t> shape) {
      all.push_back({name, "<f8", std::move(shape), v.data(), v.size() * sizeof(double)});
    };
    const auto whole = [&](const char* name, const std::vector<std::int64_t>& v, std::vector<std::size_t> shape) {
      all.push_back({name, "<i8", std::move(shape), v.data(), v.size() * sizeof(std::int64_t)});
    };
    const auto n = static_cast<std::size_t>(r_.size), places = r_.interfaces.size();
    std::vector<std::int64_t> rows, nodes;
    for (const NodalUnknown& u : unknowns_) rows.push_back(u.node);
    for (const NodalUnknown& u : unknowns_) rows.push_back(u.component);
    std::vector<double> positions;
    for (std::size_t i = 0; i < 3; ++i)
      for (const ReducedInterface& at : r_.interfaces) positions.push_back(at.position[i]);
    for (const ReducedInterface& at : r_.interfaces) nodes.push_back(at.node);
    std::vector<double> mesh;
    for (std::size_t i = 0; i < 3; ++i)
      for (std::size_t k = i; k < r_.node_positions.size(); k += 3) mesh.push_back(r_.node_positions[k]);
    real("K", r_.stiffness, {n, n});
    real("M", r_.mass, {n, n});
    if (!r_.damping.empty()) real("C", r_.damping, {n, n});
    real("shapes", r_.shapes, {r_.shapes.size() / n, n});
    whole("unknowns", rows, {n, 2});
    whole("interface_nodes", nodes, {places});
    real("interface_positions", positions, {places, 3});
    real("frequencies", r_.frequencies, {r_.frequencies.size()});
    whole("mesh_nodes", r_.nodes, {r_.nodes.size()});
    real("mesh_positions", mesh, {r_.nodes.size(), 3});
    return npz_file(all);
  }

  [[nodiscard]] std::string map() const {
    using page::json_list;
    using page::json_number;
    using page::json_numbers;
    std::vector<std::string> interfaces, modes, rows;
    for (const ReducedInterface& at : r_.interfaces)
      interfaces.push_back("\n    " +
                           page::JsonObject()
                               .text("name", at.name)
                               .raw("node", std::to_string(at.node))
                               .raw("position", json_numbers(at.position))
                               .raw("components", at.components == kNodeComponents ? "[1, 2, 3, 4, 5, 6]" : "[1, 2, 3]")
                               .raw("first_row", std::to_string(at.first + 1))
                               .done());
    const std::size_t before = unknowns_.size() - r_.frequencies.size();
    for (std::size_t k = 0; k < r_.frequencies.size(); ++k)
      modes.push_back("\n    " + page::JsonObject()
                                     .raw("scalar", std::to_string(unknowns_[before + k].node))
                                     .raw("row", std::to_string(before + k + 1))
                                     .number("frequency", r_.frequencies[k])
                                     .done());
    for (const NodalUnknown& u : unknowns_) rows.push_back(fmt::format("[{}, {}]", u.node, u.component));
    std::vector<std::string> turned;
    for (std::size_t i = 0; i < 3; ++i) turned.push_back(json_numbers(std::span(r_.rotation).subspan(3 * i, 3)));
    page::JsonObject names;
    names.text("stiffness", "KAA").text("mass", "MAA");
    if (!r_.damping.empty()) names.text("damping", "BAA");
    names.text("shapes", "TGA");
    page::JsonObject out;
    out.text("body", r_.body)
        .text("units", r_.units)
        .text("method", "Craig and Bampton: static shapes of the interfaces, modes with the interfaces at rest")
        .text("axes",
              "those of the mesh, for positions, displacements and rotations; 'placement' leads to the model's: "
              "global = rotation * mesh + position")
        .raw("placement",
             page::JsonObject().raw("position", json_numbers(r_.position)).raw("rotation", json_list(turned)).done())
        .number("total_mass", r_.total_mass)
        .raw("centre_of_mass", json_numbers(r_.centre))
        .raw("names", names.done())
        .raw("size", std::to_string(r_.size))
        .raw("interfaces", json_list(interfaces))
        .raw("modes", json_list(modes))
        .text("rows", "[node, component] of each row; component 0: the amplitude of a mode, of modal mass 1")
        .raw("unknowns", json_list(rows))
        .text("shapes",
              fmt::format("rows: {} numbers for each node of the mesh{}", 3 * r_.vectors_per_node,
                          r_.vectors_per_node == 1   ? ", its displacement"
                          : r_.vectors_per_node == 2 ? ", its displacement and the change of its director or slope"
                                                     : ", its displacement and the changes of its axis and of "
                                                       "the two directions of its section"))
        .raw("files", page::json_texts(files_))
        .raw("notices", page::json_texts(r_.notices));
    return out.done() + "\n";
  }

  const ReducedMatrices& r_;
  std::string stem_;
  std::vector<NodalUnknown> unknowns_;  // of each row
  std::vector<NamedMatrix> matrices_;
  std::vector<std::string> files_;
};

}  // namespace
}  // namespace dynamics::model

std::vector<std::string> write_reduced_matrices(const ReducedMatrices& matrices, const std::string& stem,
                                                const ReducedFiles& files) {
  if (!matrices.status.ok()) throw Error(matrices.status);
  return dynamics::model::ReducedWriter(matrices, stem).write(files);
}

}  // namespace espalier
