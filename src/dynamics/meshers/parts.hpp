/// \file
/// Parametric machine parts as hexahedral meshes. Lengths in metres by default values; every part is scaled from about
/// 10^3 to 10^6 unknowns by one number. Face sets (and node sets of the same names) are there for joints and loads.
#pragma once

#include "base/thread_pool.hpp"
#include "dynamics/mesh/mesh.hpp"

namespace espalier::dynamics {

/// How fine a part is meshed.
struct MeshSize {
  double unknowns = 1e4;                 ///< wished number of unknowns (3 per node); met within a factor of about 1.5
  ElementType type = ElementType::hex8;  ///< hex8 or hex20
  base::ThreadPool* pool = nullptr;      ///< threads that check the elements; null: the calling one
};

/// A box [0, lx] x [0, ly] x [0, lz]. Face sets: x0, x1, y0, y1, z0, z1.
struct BlockShape {
  double lx = 1, ly = 1, lz = 1;
};
Mesh make_block(const BlockShape& shape, int nx, int ny, int nz, ElementType type = ElementType::hex8);
Mesh make_block(const BlockShape& shape, const MeshSize& size);

/// Two eyes joined by a shank: connecting rods and chain links. The big eye's axis is the z axis, the small eye's axis
/// lies at (length, 0); thickness from -thickness/2 to +thickness/2 in z. Needs big_outer + small_outer < length.
/// Face sets: big_bore, small_bore, front (+z), back (-z).
struct RodShape {
  double length = 0.150;
  double big_inner = 0.024, big_outer = 0.034;
  double small_inner = 0.011, small_outer = 0.018;
  double shank_big = 0.030;    ///< width of the shank at the big eye; below 2 big_outer
  double shank_small = 0.022;  ///< width of the shank at the small eye; below 2 small_outer
  double thickness = 0.020;
};
Mesh make_connecting_rod(const RodShape& shape, const MeshSize& size);

/// A chain link: a rod with two equal eyes, `pitch` apart. Face sets: bore_a (at the origin), bore_b, front, back.
struct LinkShape {
  double pitch = 0.040;
  double inner = 0.006, outer = 0.012;
  double waist = 0.014;  ///< width of the shank
  double thickness = 0.008;
};
Mesh make_chain_link(const LinkShape& shape, const MeshSize& size);

/// A single-throw crankshaft about the z axis: journal, web, pin, web, journal; the pin's axis lies at (throw, 0).
/// Face sets: journal_left (z < 0), journal_right, pin (cylindrical surfaces), end_left, end_right (end faces).
struct CrankShape {
  double throw_radius = 0.060;
  double journal_radius = 0.022, pin_radius = 0.020;
  double web_big = 0.032;    ///< outer radius of the web around the journal
  double web_small = 0.026;  ///< outer radius of the web around the pin; web_big + web_small < throw_radius
  double web_neck = 0.046;   ///< width of the web between the eyes
  double journal_length = 0.040, web_thickness = 0.018, pin_length = 0.024;
};
Mesh make_crank(const CrankShape& shape, const MeshSize& size);

/// A guide rail of rectangular section: straight along x from -lead to 0, an arc of `radius` (centre (0, radius)), and
/// straight again. Face sets: running (the inner side), base (the outer side), start, end.
struct GuideShape {
  double lead = 0.1;
  double radius = 0.15;  ///< of the running surface
  double angle = 1.5707963267948966;
  double height = 0.01;  ///< thickness behind the running surface
  double width = 0.02;   ///< along z
};
Mesh make_guide(const GuideShape& shape, const MeshSize& size);

/// A bladed rotor about the z axis: hollow shaft, disc, twisted blades. Element sets: shaft, disc, blades. Face sets:
/// bearing_left (z < 0), bearing_right (outer shaft surface at the ends), bore, end_left, end_right, blade_tips.
struct RotorShape {
  int blades = 12;
  double bore_radius = 0.010, shaft_radius = 0.020, disc_radius = 0.080, tip_radius = 0.150;
  double shaft_length = 0.400, disc_thickness = 0.020, bearing_length = 0.020;
  double disc_position = 0.5;    ///< of the disc's middle along the shaft, 0 to 1
  double blade_fraction = 0.35;  ///< of the rim's circumference that blades occupy
  double blade_taper = 0.4;      ///< thickness lost at the tip
  double blade_twist = 0.6;      ///< radians between root and tip
};
Mesh make_bladed_rotor(const RotorShape& shape, const MeshSize& size);

/// An involute spur gear about the z axis with the basic rack of ISO 53, profile A: addendum 1, dedendum 1.25 and
/// fillet 0.38 modules, no profile shift. One tooth stands on the x axis; the middle of the width is at z = 0. Two
/// gears of one module and pressure angle mesh at half the sum of their pitch diameters, module times teeth. Face sets:
/// teeth (flanks, fillets, roots and tips), bore, front (+z), back (-z).
struct GearShape {
  int teeth = 20;
  double module = 0.002;                       ///< pitch diameter over number of teeth
  double pressure_angle = 0.3490658503988659;  ///< radians, 14 to 30 degrees; default 20
  double width = 0.010;
  double bore_radius = 0.008;
  double backlash = 0;  ///< between two equal gears, on the pitch circle: each tooth is thinner by half of it
  /// By which the flanks stand back at the tips, normal to them; it grows from half of the addendum on, in proportion
  /// to the rolled length.
  double tip_relief = 0;
};
/// @param flank   elements along an involute
/// @param across  a tooth
/// @param width   along the width
/// @throws std::invalid_argument that says what is wrong with the shape: undercut or pointed teeth, too large a bore
Mesh make_spur_gear(const GearShape& shape, int flank, int across, int width, ElementType type = ElementType::hex8);
Mesh make_spur_gear(const GearShape& shape, const MeshSize& size);

}  // namespace espalier::dynamics
