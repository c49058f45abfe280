#include "dynamics/model/answer/harmonic_run.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <numbers>

#include "dynamics/model/answer/harmonic_observer.hpp"
#include "dynamics/model/answer/structural_damping.hpp"
#include "dynamics/model/fields/field_quantity.hpp"
#include "harmonic/respond.hpp"

namespace espalier::dynamics::model {

using harmonic::Complex;

namespace {

using Loads = std::vector<std::vector<DrivenNumber>>;

// Equations are linear in what drives a force or a motor; how they depend on an input is the text's affair.
Loads driven_numbers(const HarmonicCase& of) {
  Loads loads;
  for (const HarmonicSpec::Load& load : of.spec.loads) {
    loads.emplace_back();
    for (const HarmonicSpec::Excitation& part : load.parts) {
      DrivenNumber number;
      number.amplitude = part.amplitude;
      if (const auto drive = of.mechanism.drives.find(part.of); drive != of.mechanism.drives.end()) {
        number.number = drive->second.get();
        number.step = of.mechanism.joint(part.of) != nullptr ? 1e-3 : 1;
      } else {
        constexpr std::string_view kPrefix = "inputs.";
        const std::string name = part.of.starts_with(kPrefix) ? part.of.substr(kPrefix.size()) : part.of;
        number.number = of.mechanism.controls->input(name);
        number.step = 1e-3 * std::max(1.0, std::abs(*number.number));
      }
      loads.back().push_back(number);
    }
  }
  return loads;
}

// [F; Phi] in the rows of the linearised system.
std::vector<double> equations_at(const HarmonicCase& of, const Linearised& a) {
  std::vector<double> f(static_cast<std::size_t>(a.n));
  of.equations.system().residual(of.state.view(), f);
  of.equations.evaluate_constraints(of.state.t, of.state.q, {});
  for (const Index row : a.rows) f.push_back(of.equations.phi()[static_cast<std::size_t>(row)]);
  return f;
}

// -d[F; Phi]/du, a central difference of fourth order; what rounding makes of zeros is zero.
std::vector<double> load_of(const HarmonicCase& of, const Linearised& a, const DrivenNumber& driven) {
  const double before = *driven.number;
  std::vector<double> at[4];
  const double ways[4] = {-2, -1, 1, 2};
  for (std::size_t k = 0; k < 4; ++k) {
    *driven.number = before + ways[k] * driven.step;
    at[k] = equations_at(of, a);
  }
  *driven.number = before;
  std::vector<double> out(at[0].size());
  for (std::size_t i = 0; i < out.size(); ++i) {
    const double d = 8 * (at[2][i] - at[1][i]) - (at[3][i] - at[0][i]);
    const double rounding = 32 * std::numeric_limits<double>::epsilon() * (std::abs(at[1][i]) + std::abs(at[2][i]));
    out[i] = std::abs(d) > rounding ? -d / (12 * driven.step) : 0;
  }
  return out;
}

// Columns of complex amplitudes. Constraints are multiplied by `factor` where the whole of K is.
std::vector<Complex> columns_of(const HarmonicCase& of, const Linearised& a, const Loads& loads, Complex factor) {
  const auto size = static_cast<std::size_t>(a.size()), n = static_cast<std::size_t>(a.n);
  std::vector<Complex> f(size * loads.size());
  for (std::size_t c = 0; c < loads.size(); ++c) {
    for (const DrivenNumber& driven : loads[c]) {
      const std::vector<double> unit = load_of(of, a, driven);
      for (std::size_t i = 0; i < size; ++i) f[c * size + i] += driven.amplitude * unit[i] * (i < n ? 1.0 : factor);
    }
    const auto first = f.begin() + static_cast<std::ptrdiff_t>(c * size);
    const HarmonicSpec::Load& load = of.spec.loads[c];
    if (std::all_of(first, first + static_cast<std::ptrdiff_t>(size), [](const Complex& x) { return x == 0.0; }))
      fail(load.place, fmt::format("the load '{}' acts on nothing in the state that the model is linearised at: its "
                                   "amplitude, its direction or what it acts on is zero, or its parts cancel",
                                   load.name));
  }
  return f;
}

void check_rest(const HarmonicCase& of) {
  constexpr double kRest = 1e-12;
  const std::vector<double>& v = of.state.v;
  const auto fastest =
      std::max_element(v.begin(), v.end(), [](double a, double b) { return std::abs(a) < std::abs(b); });
  if (fastest == v.end() || !(std::abs(*fastest) > kRest)) return;
  fail(of.spec.place,
       fmt::format("the model moves where it is linearised: {} is {:g}. Frequency responses are those about a state of "
                   "rest: leave initial velocities out, let motors begin with the rate 0, or say statics = true in "
                   "[initial]",
                   of.equations.system().coordinate_name(static_cast<Index>(fastest - v.begin())), *fastest));
}

// What is not linear in the motion can be given where each frequency is solved, or not at all.
void check_quantities(const HarmonicCase& of) {
  for (const Quantity& q : of.quantities) {
    if (q.name.find(".strain_energy") != std::string::npos || q.name.find(".direction_") != std::string::npos)
      fail(of.spec.place,
           fmt::format("\"{}\" has no amplitude: it does not swing with the load; ask for stresses", q.name));
    if (q.field && !q.field->is_linear() && of.spec.options.tolerance > 0)
      fail(of.spec.place,
           fmt::format("\"{}\" is a largest value over a period, which cannot be interpolated between frequencies: "
                       "leave 'tolerance' out, or ask for single components at single places",
                       q.name));
  }
}

}  // namespace

ModelHarmonicResult run_harmonic(const HarmonicCase& of) {
  if (of.quantities.empty())
    fail(of.spec.place, "names no quantities, and there are none in [output]; give quantities = [\"BODY.position.x\"]");
  check_quantities(of);
  check_rest(of);
  ModelHarmonicResult out;
  for (const Quantity& q : of.quantities) out.quantities.push_back(q.name);
  for (const HarmonicSpec::Load& load : of.spec.loads) out.loads.push_back(load.name);
  const StructuralDamping structural(of.mechanism);
  const Linearised a = linearise(of.equations, of.state);
  SparseMatrix h;
  if (structural.any()) {
    h = structural.matrix(of.state);
    h.rows = h.cols = a.size();
    h.col_ptr.resize(static_cast<std::size_t>(a.size()) + 1, h.col_ptr.back());
  }
  const Loads loads = driven_numbers(of);
  // All of K is multiplied by 1 + i eta, and so are Phi_q and its transpose, which have no damping: their right sides
  // are multiplied, too, and multipliers are (1 + i eta) times those of the solution.
  const Complex factor(1, of.spec.options.loss_factor);
  of.mechanism.system.set_load_factor(1);
  std::vector<Complex> f;
  try {
    f = columns_of(of, a, loads, factor);
  } catch (...) {
    of.mechanism.system.set_load_factor(of.load.value_or(1));
    throw;
  }
  HarmonicObserver observer(of.mechanism, of.state, a, of.quantities, loads, factor, of.load);
  observer.share_reactions(of.share);
  of.mechanism.system.set_load_factor(of.load.value_or(1));
  HarmonicOptions options = of.spec.options;
  options.solver = of.solver;
  out.response =
      harmonic::respond(a.stiffness, a.damping, a.mass, f, static_cast<Index>(loads.size()), options, &observer, h);
  out.status = out.response.status;
  if (!out.status.ok()) out.status.message = "harmonic: " + out.status.message;
  if (!of.equilibrium && max_norm(of.state.a) > 1e-9)
    out.notices.push_back(
        fmt::format("harmonic: the model is not in equilibrium where it is linearised (accelerations up to {:g}); "
                    "statics = true in "
                    "[initial] begins in equilibrium",
                    max_norm(of.state.a)));
  if (options.tolerance > 0 && out.status.ok() && !out.response.complete)
    out.notices.push_back("harmonic: not proven that no resonance was missed: " + out.response.completeness);
  return out;
}

std::vector<HarmonicPicture> harmonic_pictures(const ModelHarmonicResult& r, std::size_t load, int phases,
                                               Index velocities) {
  const auto n = static_cast<std::size_t>(velocities), size = static_cast<std::size_t>(r.response.n);
  std::vector<HarmonicPicture> out;
  for (std::size_t k = 0; k < r.response.shape_frequencies.size(); ++k) {
    const Complex* x = r.response.shapes.data() + (k * r.loads.size() + load) * size;
    const double w = 2 * std::numbers::pi * r.response.shape_frequencies[k];
    for (int p = 0; p < phases; ++p) {
      const double part = static_cast<double>(p) / phases;
      const Complex turn = std::polar(1.0, 2 * std::numbers::pi * part);
      HarmonicPicture picture{static_cast<double>(k + 1) + part, std::vector<double>(n), std::vector<double>(n)};
      for (std::size_t i = 0; i < n; ++i) {
        picture.shift[i] = (x[i] * turn).real();
        picture.v[i] = (Complex(0, w) * x[i] * turn).real();
      }
      out.push_back(std::move(picture));
    }
  }
  return out;
}

}  // namespace espalier::dynamics::model
