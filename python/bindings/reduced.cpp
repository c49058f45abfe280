// Reduced matrices of bodies. Private: espalier/_models/reduced.py gives them types, checks and exceptions.
#include <nanobind/stl/array.h>
#include <nanobind/stl/string.h>
#include <nanobind/stl/vector.h>

#include <utility>

#include "arrays.hpp"
#include "bindings.hpp"
#include "espalier/reduced_matrices.hpp"
#include "host.hpp"

namespace espalier::python {

using namespace nb::literals;

namespace {

nb::list interfaces_of(const ReducedMatrices& r) {
  nb::list out;
  for (const ReducedInterface& at : r.interfaces)
    out.append(nb::make_tuple(at.name, at.node, at.position, at.components, at.first));
  return out;
}

}  // namespace

void bind_reduced(nb::module_& m) {
  nb::class_<ReducedMatrices>(m, "ReducedMatrices")
      .def_prop_ro("status", [](const ReducedMatrices& r) { return status_of(r.status); })
      .def_ro("body", &ReducedMatrices::body)
      .def_ro("units", &ReducedMatrices::units)
      .def_ro("size", &ReducedMatrices::size)
      .def_ro("first_scalar", &ReducedMatrices::first_scalar)
      .def_ro("total_mass", &ReducedMatrices::total_mass)
      .def_ro("centre", &ReducedMatrices::centre)
      .def_ro("position", &ReducedMatrices::position)
      .def_ro("rotation", &ReducedMatrices::rotation)
      .def_ro("vectors_per_node", &ReducedMatrices::vectors_per_node)
      .def_ro("notices", &ReducedMatrices::notices)
      .def_prop_ro("interfaces", &interfaces_of)
      .def("numbers", [](const ReducedMatrices& r) {  // matrices are symmetric; shapes have their columns as rows
        const auto n = static_cast<std::size_t>(r.size), rows = n == 0 ? 0 : r.shapes.size() / n;
        nb::dict out;
        out["stiffness"] = array_of(r.stiffness, {n, n});
        out["mass"] = array_of(r.mass, {n, n});
        if (!r.damping.empty()) out["damping"] = array_of(r.damping, {n, n});
        out["shapes"] = array_of(r.shapes, {n, rows});
        out["frequencies"] = array_of(r.frequencies, {r.frequencies.size()});
        out["nodes"] = array_of(r.nodes, {r.nodes.size()});
        out["node_positions"] = array_of(r.node_positions, {r.nodes.size(), 3});
        return out;
      });
  m.def(
      "reduced_matrices",
      [](const std::string& text, const std::string& name, std::string body, std::vector<std::string> interfaces,
         int modes, double frequency, std::int64_t first_node, std::vector<std::string> set) {
        SimulationOptions o;
        o.set = std::move(set);
        o.interrupted = &Host::interrupted;
        ReducedMatrices r;
        {
          const nb::gil_scoped_release released;
          r = reduced_matrices_of_text(text, name,
                                       {std::move(body), std::move(interfaces), modes, frequency, first_node}, o);
        }
        if (Host::raised) std::rethrow_exception(std::exchange(Host::raised, nullptr));
        return r;
      },
      "text"_a, "name"_a, "body"_a, "interfaces"_a, "modes"_a, "frequency"_a, "first_node"_a, "set"_a);
  m.def(
      "write_reduced_matrices",
      [](const ReducedMatrices& r, const std::string& stem, const std::vector<std::string>& formats) {
        ReducedFiles files;
        for (const std::string& f : formats) {
          files.op4 = files.op4 || f == "op4";
          files.op4_text = files.op4_text || f == "op4-text";
          files.dmig = files.dmig || f == "dmig";
          files.mtx = files.mtx || f == "mtx";
          files.npz = files.npz || f == "npz";
        }
        std::vector<std::string> written;
        try {
          written = write_reduced_matrices(r, stem, files);
        } catch (const Error& error) {
          return nb::make_tuple(status_of(error.status()), written);
        }
        return nb::make_tuple(status_of({}), written);
      },
      "matrices"_a, "stem"_a, "formats"_a);
}

}  // namespace espalier::python
