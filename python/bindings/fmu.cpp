// FMUs of models. Private: espalier/_models/model.py gives it types and checks.
#include "espalier/fmu.hpp"

#include <nanobind/stl/string.h>
#include <nanobind/stl/vector.h>

#include "arrays.hpp"
#include "bindings.hpp"

namespace espalier::python {

using namespace nb::literals;

void bind_fmu(nb::module_& m) {
  m.def(
      "export_fmu",
      [](const std::string& text, const std::string& name, const std::string& path, int version,
         std::vector<std::string> inputs, std::vector<std::string> outputs, std::vector<std::string> parameters,
         std::vector<std::string> set) {
        FmuOptions options;
        options.version = version;
        options.inputs = std::move(inputs);
        options.outputs = std::move(outputs);
        options.parameters = std::move(parameters);
        options.set = std::move(set);
        FmuResult r;
        {
          const nb::gil_scoped_release others_run;
          r = export_fmu_of_text(text, name, path, options);
        }
        nb::list variables;
        for (const FmuVariable& v : r.variables) variables.append(nb::make_tuple(v.name, v.kind, v.unit, v.start));
        return nb::make_tuple(status_of(r.status), r.path, r.bytes, variables, r.files, r.model_exchange,
                              r.no_model_exchange);
      },
      "text"_a, "name"_a, "path"_a, "version"_a, "inputs"_a, "outputs"_a, "parameters"_a, "set"_a);
}

}  // namespace espalier::python
