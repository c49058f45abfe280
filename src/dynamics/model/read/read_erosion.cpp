// The table erosion of a solid body.
#include "dynamics/model/description.hpp"
#include "dynamics/model/read/section.hpp"

namespace espalier::dynamics::model {

ErosionSpec read_erosion(Section s) {
  ErosionSpec out;
  out.place = s.place();
  out.strain = s.positive("strain", out.strain);
  out.stress = s.positive("stress", out.stress);
  out.principal_stress = s.positive("principal_stress", out.principal_stress);
  s.finish();
  if (!(out.strain > 0 || out.stress > 0 || out.principal_stress > 0))
    fail(out.place,
         "needs a limit at which elements fail: 'strain' (largest principal strain), 'stress' (von Mises), "
         "'principal_stress', or several of them");
  return out;
}

void check_erosion(const Description& model) {
  for (const BodySpec& body : model.bodies) {
    if (body.erosion() == nullptr) continue;
    const Place& place = body.erosion()->place;
    if (model.statics || !model.moves)
      fail(place,
           "elements fail in motions, [integrator]: an equilibrium has no time in which they could, and a piece that "
           "comes loose has none. Load the body slowly in a motion, or take 'erosion' out");
    if (body.reduction)
      fail(place, "does not go with 'reduce': a reduced body has no elements that could fail; take one of them out");
    if (body.modal_damping > 0)
      fail(place,
           "does not go with damping by ratio, which couples all nodes across what has failed: give the ratio at two "
           "frequencies (damping = { ratio = ..., frequencies = [f1, f2] }), or damping = { stiffness = ... }");
    for (const SurfaceSpec& surface : model.surfaces)
      if (surface.body == body.name)
        fail(surface.place, "the body '" + body.name +
                                "' has 'erosion': contact does not know yet which faces fail and which are laid bare. "
                                "Take the surface out, or let the other body erode");
  }
}

}  // namespace espalier::dynamics::model
