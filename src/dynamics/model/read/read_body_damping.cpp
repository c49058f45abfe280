// Damping and reduction of flexible bodies.
#include <fmt/format.h>

#include <numbers>
#include <vector>

#include "dynamics/model/read/body_readers.hpp"

namespace espalier::dynamics::model {
namespace {

/// ratio = mass / (2 w) + stiffness w / 2 at two frequencies.
RayleighDamping rayleigh_of_ratios(Section& d) {
  const std::vector<double> f = d.numbers("frequencies");
  const bool list = d.value("ratio")->type == Value::Type::array;
  const std::vector<double> z = list ? d.numbers("ratio") : std::vector(2, d.number("ratio"));
  if (f.size() != 2) fail(d.place("frequencies"), fmt::format("needs two numbers, has {}", f.size()));
  if (z.size() != 2) fail(d.place("ratio"), fmt::format("needs one number or two, has {}", z.size()));
  if (!(f[0] > 0 && f[1] > f[0])) fail(d.place("frequencies"), "needs two frequencies above 0, the lower one first");
  const double a = 2 * std::numbers::pi * f[0], b = 2 * std::numbers::pi * f[1];
  const RayleighDamping out{2 * a * b * (z[0] * b - z[1] * a) / (b * b - a * a),
                            2 * (z[1] * b - z[0] * a) / (b * b - a * a)};
  if (!(out.mass >= 0 && out.stiffness >= 0))
    fail(d.place("ratio"),
         fmt::format("these ratios would need mass = {:g} and stiffness = {:g}, which must not be negative: the ratio "
                     "of the higher frequency lies between {:g} and {:g}",
                     out.mass, out.stiffness, z[0] * a / b, z[0] * b / a));
  return out;
}

void read_damping(Section& d, BodySpec& body) {
  if (d.has("ratio") && d.has("frequencies")) {
    for (const char* other : {"mass", "stiffness"})
      if (d.has(other)) fail(d.place(other), "follows from 'ratio' and 'frequencies'; leave it out");
    body.damping = rayleigh_of_ratios(d);
  } else {
    if (d.has("frequencies")) fail(d.place("frequencies"), "needs 'ratio', that of both frequencies or a list of two");
    body.modal_damping = d.number("ratio", 0);
    if (!(body.modal_damping >= 0 && body.modal_damping < 1))
      fail(d.place("ratio"), "is a part of critical damping: it must be at least 0 and below 1 (2 %: 0.02)");
    body.damping.mass = d.number("mass", 0);
    body.damping.stiffness = d.number("stiffness", 0);
    if (body.damping.mass < 0) fail(d.place("mass"), "must not be negative");
    if (body.damping.stiffness < 0) fail(d.place("stiffness"), "must not be negative");
  }
  body.loss_factor = d.number("loss_factor", 0);
  if (!(body.loss_factor >= 0)) fail(d.place("loss_factor"), "must not be negative");
  if (d.has("frequency")) {
    if (!(body.loss_factor > 0)) fail(d.place("frequency"), "belongs to 'loss_factor', which is not given");
    body.loss_frequency = d.positive("frequency");
  }
  d.finish();
}

/// @param reduced the body is so already: all of it may be kept
ReductionOptions read_reduction(Section& s, bool reduced) {
  ReductionOptions r;
  if (!s.has("modes") && !s.has("frequency") && !reduced)
    fail(s.place(), "needs 'modes', how many are kept beside those of the interfaces, or 'frequency', below which");
  if (s.has("modes")) r.modes = s.integer("modes", 0, 0);
  r.frequency = s.positive("frequency", r.frequency);
  r.damping = s.number("damping", 0);
  if (!(r.damping >= 0)) fail(s.place("damping"), "must not be negative");
  s.finish();
  return r;
}

}  // namespace

void read_body_damping(Section& s, BodySpec& body) {
  if (auto d = s.table("damping")) read_damping(*d, body);
  if (auto r = s.table("reduce")) body.reduction = read_reduction(*r, s.text("type") == "substructure");
  if (!body.reduction || body.reduction->damping == 0) return;
  if (body.modal_damping > 0)
    fail(s.place("reduce"), "'damping' here and 'ratio' in the body's damping are the same; give one of them");
  body.modal_damping = body.reduction->damping;
}

}  // namespace espalier::dynamics::model
