// Made by docs/site/model_parts.py --write from the calls in src/dynamics/model/read_*.cpp; do not edit.
// clang-format off
#include "dynamics/model/check/part_keys.hpp"

namespace espalier::dynamics::model {

std::span<const PartKeys> all_part_keys() {
  static constexpr PartKeys kPartKeys[] = {
      {"", "",
       "title units gravity markers statics integrator initial harmonic output solver bodies joints forces "
       "materials surfaces contacts inputs sensors events splines supports parameters repeat"},
      {"integrator", "",
       "start steps end method relative absolute absolute_velocity test_velocity max_order order "
       "initial_step max_step min_step step constraint_tolerance max_newton newton_tolerance refactor_rate "
       "refactor_step iteration spectral_radius hht_alpha tolerance"},
      {"statics", "",
       "time linear load tolerance first_step largest_step smallest_step max_steps max_iterations "
       "max_factorizations pseudo_time path"},
      {"initial", "",
       "rotation statics velocities position_tolerance velocity_tolerance modes"},
      {"harmonic", "",
       "tolerance max_solves loss_factor quantities shapes phases frequencies from to points logarithmic "
       "loads"},
      {"output", "",
       "quantities envelopes csv_interval vtu_interval format restart_interval energies constraints "
       "reactions step_data exact_times page paths"},
      {"bodies", "rigid",
       "type mass inertia box mesh density position rotation velocity angular_velocity gravity"},
      {"bodies", "point",
       "gravity type mass position velocity"},
      {"bodies", "solid",
       "gravity type position rotation velocity angular_velocity damping reduce mesh element_set hex8 "
       "reduced_hex20 material"},
      {"bodies", "cable",
       "gravity type position rotation velocity angular_velocity damping reduce start end elements radius "
       "axial bending mass_per_length material"},
      {"bodies", "beam",
       "gravity type position rotation velocity angular_velocity damping reduce points start end direction "
       "length curvature elements y radius height width axial shear_y shear_z torsion bending_y bending_z "
       "section_normal section_shear mass_per_length inertia_y inertia_z material"},
      {"bodies", "shell",
       "gravity type position rotation velocity angular_velocity damping reduce origin x y curvature nx ny "
       "thickness material"},
      {"bodies", "substructure",
       "gravity type position rotation velocity angular_velocity damping reduce stiffness mass nodes lines"},
      {"joints", "fixed",
       "type a b bodies at rotation axis x_axis pull attach active"},
      {"joints", "revolute",
       "type a b bodies at rotation axis x_axis pull attach active limits friction armature"},
      {"joints", "spherical",
       "type a b bodies at rotation axis x_axis pull attach active"},
      {"joints", "universal",
       "type a b bodies at rotation axis x_axis pull attach active"},
      {"joints", "cylindrical",
       "type a b bodies at rotation axis x_axis pull attach active limits angle_limits friction"},
      {"joints", "prismatic",
       "type a b bodies at rotation axis x_axis pull attach active limits friction armature"},
      {"joints", "planar",
       "type a b bodies at rotation axis x_axis pull attach active"},
      {"joints", "point-on-line",
       "type a b bodies at rotation axis x_axis pull attach active"},
      {"joints", "distance",
       "type a b bodies at rotation axis x_axis pull attach active length"},
      {"joints", "revolute-spherical",
       "type a b bodies at rotation axis x_axis pull attach active length"},
      {"joints", "rotation-motor",
       "type a b bodies at rotation axis x_axis pull attach active motion from"},
      {"joints", "translation-motor",
       "type a b bodies at rotation axis x_axis pull attach active motion from"},
      {"joints", "prescribed",
       "type a b bodies at rotation axis x_axis pull attach active direction motion from"},
      {"joints", "rolling",
       "type a b bodies at rotation axis x_axis pull attach active shape radius rim"},
      {"joints", "skate",
       "type a b bodies at rotation axis x_axis pull attach active"},
      {"joints", "gear",
       "type a b c d ratio pull attach active"},
      {"joints", "rack-and-pinion",
       "type a b c d radius pull attach active"},
      {"joints", "coupled-slides",
       "type a b c d ratio pull attach active"},
      {"forces", "spring",
       "type a b bodies at rotation axis x_axis active stiffness damping rest preload actuator"},
      {"forces", "axial-spring",
       "type a b bodies at rotation axis x_axis active stiffness damping rest preload actuator"},
      {"forces", "rotational-spring",
       "type a b bodies at rotation axis x_axis active stiffness damping rest preload actuator"},
      {"forces", "bushing",
       "type a b bodies at rotation axis x_axis active stiffness damping angular_stiffness angular_damping"},
      {"forces", "load",
       "type a force moment factor follower active"},
      {"forces", "pressure",
       "type body face pressure active"},
      {"forces", "guide",
       "type a b bodies at rotation axis x_axis active stiffness damping friction slip_speed smoothing "
       "both_sides start direction lengths curvatures"},
      {"forces", "torque-motor",
       "type a b bodies at rotation axis x_axis active torque"},
      {"forces", "force-motor",
       "type a b bodies at rotation axis x_axis active force"},
      {"surfaces", "plane",
       "body shape point normal rotation"},
      {"surfaces", "sphere",
       "body shape point radius"},
      {"surfaces", "capsule",
       "body shape point radius length axis rotation"},
      {"surfaces", "cylinder",
       "body shape point radius length axis rotation"},
      {"surfaces", "box",
       "body shape point size rotation"},
      {"surfaces", "mesh",
       "body shape point file scale rotation"},
      {"surfaces", "faces",
       "body shape set"},
      {"surfaces", "sprocket",
       "body shape point teeth pitch roller_radius width tip axis rotation"},
      {"surfaces", "line",
       "body shape radius divisions"},
      {"contacts", "",
       "active surfaces against self margin overlap penetration law stiffness exponent smoothing damping "
       "restitution friction static stribeck_speed tangential_stiffness tangential_damping"},
      {"materials", "",
       "law young poisson density"},
      {"markers", "",
       "same_as body global point axis x_axis rotation attach node near face nodes edge radius bore "
       "most_nodes"},
      {"supports", "",
       "body node near face nodes edge radius bore hold symmetry rotation motion"},
      {"splines", "",
       "kind outside points file x_scale y_scale separator x y"},
      {"events", "",
       "when contact stop once on off tolerance position_tolerance set"},
      {"paths", "",
       "body through points quantities"},
  };
  return kPartKeys;
}

}  // namespace espalier::dynamics::model
